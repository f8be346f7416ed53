"""Runs tests in a copy of this process, where all that does not change is imported already."""

from __future__ import annotations

import contextlib
import importlib
import os
import re
import resource
import signal
import sys
import time
import traceback
from dataclasses import dataclass
from pathlib import Path

MODULES = (
    "numpy scipy.optimize scipy.linalg scipy.stats scipy.spatial.transform xarray netCDF4 pydantic yaml typer rich "
    "matplotlib.pyplot pandas jinja2 pytest concurrent.futures openpyxl"
)


@dataclass(frozen=True)
class Outcome:
    """What one run of tests said."""

    caught: bool
    by: str  # the first test that failed, or why the run ended
    seconds: float  # of the wall


def warm() -> None:
    """Imports what every test needs, but nothing of stiffmap."""
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    for name in MODULES.split():
        importlib.import_module(name)
    assert "stiffmap" not in sys.modules


def run(
    package: Path, tests: list[str], log: Path, cpu_seconds: int, environment: dict[str, str], *options: str
) -> Outcome:
    """The fast tests of these files against the package in `package`; `options` are pytest's."""
    begun = time.monotonic()
    child = os.fork()
    if child == 0:
        os.setsid()
        out = os.open(log, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
        os.dup2(out, 1)
        os.dup2(out, 2)
        resource.setrlimit(resource.RLIMIT_CPU, (cpu_seconds, cpu_seconds + 5))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        os.environ.update(environment, PYTHONPATH=str(package))
        sys.path.insert(0, str(package))
        import pytest

        plain = ["-q", "-m", "not slow", "-p", "no:cacheprovider", "-p", "no:xdist", "--tb=line"]
        plain += ["-W", "ignore::pytest.PytestAssertRewriteWarning"]  # imported before
        code = 1
        try:
            code = int(pytest.main([*plain, "--hypothesis-seed=0", *options, *tests]))
        except BaseException:
            traceback.print_exc()
        finally:
            sys.stdout.flush()
            os._exit(code)
    _, status = os.waitpid(child, 0)
    with contextlib.suppress(ProcessLookupError):
        os.killpg(child, signal.SIGKILL)  # what its tests have started
    seconds = time.monotonic() - begun
    if os.WIFSIGNALED(status):
        return Outcome(True, signal.Signals(os.WTERMSIG(status)).name, seconds)
    if os.WEXITSTATUS(status) == 0:
        return Outcome(False, "", seconds)
    failed = failures(log)
    if not failed:  # no judgement: pytest itself failed
        raise RuntimeError(f"pytest ended with {os.WEXITSTATUS(status)} and no failed test, see {log}")
    return Outcome(True, failed[0], seconds)


def failures(log: Path) -> list[str]:
    """Names of the tests that failed, with their parameters, which may hold blanks."""
    return re.findall(
        r"^(?:FAILED|ERROR) (.+?)(?: - .*)?$", log.read_text(errors="replace"), flags=re.MULTILINE
    )
