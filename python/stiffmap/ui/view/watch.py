"""A machine's file is read again when it is edited."""

from __future__ import annotations

import threading
from collections.abc import Callable
from pathlib import Path

EVERY = 0.4
"""s between two looks."""
Stamp = tuple[int, int] | None


def stamp(path: Path) -> Stamp:
    """What changes when a file is written; None where there is none."""
    try:
        s = path.stat()
    except OSError:
        return None
    return s.st_mtime_ns, s.st_size


class Watch:
    """Calls back when the file's stamp changes."""

    def __init__(self, path: Path, changed: Callable[[], None]) -> None:
        self._path, self._changed = path, changed
        self._end = threading.Event()
        self._seen = stamp(path)
        self._thread = threading.Thread(target=self._run, daemon=True, name="stiffmap view file")
        self._thread.start()

    def _run(self) -> None:
        while not self._end.wait(EVERY):
            now = stamp(self._path)
            if now is not None and now != self._seen:
                self._seen = now
                self._changed()

    def stop(self) -> None:
        """End the thread."""
        self._end.set()
