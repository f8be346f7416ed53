"""Marks the slow tests: `./test.sh` leaves them out, `./test.sh --all` runs them.

`slow.txt` lists them as measured, by the part of their name before the parameters or with them. A test that is slow
wherever it runs may carry `@pytest.mark.slow` itself. No file may be slow as a whole: its feature would then go
untested in the fast lane.
"""

from __future__ import annotations

from collections import defaultdict
from pathlib import Path

import pytest

HERE = Path(__file__).parent
SLOW = {
    line.split("#")[0].strip()
    for line in (HERE / "slow.txt").read_text(encoding="utf-8").splitlines()
    if line.split("#")[0].strip()
}


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
