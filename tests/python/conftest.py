"""Marks the slow tests: `./test.sh` leaves them out, `./test.sh --all` runs them.

`slow.txt` lists them as measured, by the part of their name before the parameters or with them. A test that is slow
wherever it runs may carry `@pytest.mark.slow` itself. No file may be slow as a whole: its feature would then go
untested in the fast lane.

A worker that crashes says how it ended, and where, in the summary.

Where a run has all that tests need (`.ci/run`), `--skips-listed` makes it fail if a test skips that `skips.txt` does
not list.
"""

from __future__ import annotations

import faulthandler
import subprocess
from collections import defaultdict
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest

HERE = Path(__file__).parent


def listed(name: str) -> set[str]:
    """Names of tests in a file, one a line, with their reasons as comments."""
    lines = (HERE / name).read_text(encoding="utf-8").splitlines()
    return {line.split("#")[0].strip() for line in lines} - {""}


SLOW = listed("slow.txt")
SKIPPED: set[str] = set()
ENDS: list[str] = []
"""How workers ended that crashed, and what they were doing."""


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--skips-listed", action="store_true", help="fail where a test skips that skips.txt lacks"
    )


def faults(root: Path, worker: str) -> Path:
    """Where a worker of pytest-xdist writes what it was doing when it crashed."""
    return root / "build" / f"crash-{worker}.txt"


@pytest.hookimpl(trylast=True)
def pytest_configure(config: pytest.Config) -> None:
    if worker := getattr(config, "workerinput", None):
        path = faults(config.rootpath, worker["workerid"])
        path.parent.mkdir(exist_ok=True)
        faulthandler.enable(path.open("w", encoding="utf-8"))


@pytest.hookimpl(optionalhook=True)
def pytest_testnodedown(node: Any, error: object) -> None:
    if error is not None:
        code, path = "no exit code yet", faults(node.config.rootpath, node.gateway.id)
        with suppress(subprocess.TimeoutExpired):
            code = node.gateway._io.popen.wait(10)
        lines = path.read_text(encoding="utf-8").splitlines() if path.exists() else []
        ENDS.append("\n".join([f"{node.gateway.id} ended: {code}", *lines[:40]]))


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    for end in ENDS:
        terminalreporter.write_line(end)


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    if report.skipped and not hasattr(report, "wasxfail"):
        SKIPPED.add(report.nodeid)


def pytest_collectreport(report: pytest.CollectReport) -> None:
    if report.skipped:  # a whole file
        SKIPPED.add(report.nodeid)


def unlisted(skipped: set[str], known: set[str]) -> list[str]:
    """Skipped tests that no line names, with their parameters, without them, or by their file."""
    names = {node: node.removeprefix("tests/python/") for node in skipped}
    return sorted(n for n in names.values() if not {n, n.split("[")[0], n.split("::")[0]} & known)


def pytest_sessionfinish(session: pytest.Session) -> None:
    if hasattr(session.config, "workerinput") or not session.config.getoption("--skips-listed"):
        return
    more = unlisted(SKIPPED, listed("skips.txt"))
    if more and session.exitstatus == pytest.ExitCode.OK:
        session.exitstatus = pytest.ExitCode.TESTS_FAILED
    for name in more:
        print(f"\nskipped, and not in tests/python/skips.txt: {name}")


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    files: dict[Path, list[bool]] = defaultdict(list)
    for item in items:
        name = f"{item.path.relative_to(HERE).as_posix()}::{item.nodeid.split('::', 1)[1]}"
        if name in SLOW or name.split("[")[0] in SLOW:
            item.add_marker(pytest.mark.slow)
        files[item.path].append(item.get_closest_marker("slow") is not None)
    whole = [path.name for path, slow in files.items() if len(slow) > 1 and all(slow)]
    if whole:
        raise pytest.UsageError(f"slow as a whole, so that the fast lane lacks them: {', '.join(whole)}")
