"""Marks the slow tests: `./test.sh` leaves them out, `./test.sh --all` runs them.

`slow.txt` lists them as measured, by the part of their name before the parameters or with them. A test that is slow
wherever it runs may carry `@pytest.mark.slow` itself. No file may be slow as a whole: its feature would then go
untested in the fast lane.

Where a run has all that tests need (`.ci/run`), `--skips-listed` makes it fail if a test skips that `skips.txt` does
not list.
"""

from __future__ import annotations

from collections import defaultdict
from pathlib import Path

import pytest

HERE = Path(__file__).parent


def listed(name: str) -> set[str]:
    """Names of tests in a file, one a line, with their reasons as comments."""
    lines = (HERE / name).read_text(encoding="utf-8").splitlines()
    return {line.split("#")[0].strip() for line in lines} - {""}


SLOW = listed("slow.txt")
SKIPPED: set[str] = set()


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--skips-listed", action="store_true", help="fail where a test skips that skips.txt lacks"
    )


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
