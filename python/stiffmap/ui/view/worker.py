"""A thread that draws the newest state: what came in between is never drawn."""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable

YIELD = 0.002
"""s after the first stage, in which the server's thread sends what it drew before dearer stages compute."""
Stage = Callable[[], None]


class Worker:
    """Runs stages, from the quick one to the dear ones, and begins anew as soon as something is asked."""

    def __init__(self, stages: list[Stage], failed: Callable[[Exception], None]) -> None:
        self.stages, self._failed = stages, failed
        self._wake = threading.Condition()
        self._asked = self._done = self._finished = 0
        self._since: float | None = None
        self._stopped = False
        self.latencies: deque[float] = deque(maxlen=1000)
        """s, from an event to the end of the first stage that answers it."""
        self._thread = threading.Thread(target=self._run, daemon=True, name="stiffmap view")
        self._thread.start()

    def ask(self) -> None:
        """Something has changed."""
        with self._wake:
            self._asked += 1
            if self._since is None:
                self._since = time.perf_counter()
            self._wake.notify_all()

    def idle(self, seconds: float = 30.0) -> bool:
        """Wait until all is drawn; False where that takes longer."""
        with self._wake:
            return self._wake.wait_for(lambda: self._finished == self._asked, seconds)

    def _run(self) -> None:
        while True:
            with self._wake:
                self._wake.wait_for(lambda: self._stopped or self._asked != self._done)
                if self._stopped:
                    return
                self._done, since, self._since = self._asked, self._since, None
            self._draw(since)
            with self._wake:
                self._finished = self._done
                self._wake.notify_all()

    def _draw(self, since: float | None) -> None:
        for i, stage in enumerate(self.stages):
            if i and (self._asked != self._done or self._stopped):
                return  # what is being drawn is old already
            try:
                stage()
            except Exception as problem:  # the thread lives on; the panel shows it
                self._failed(problem)
            if i == 0 and since is not None:
                self.latencies.append(time.perf_counter() - since)
                time.sleep(YIELD)

    def stop(self) -> None:
        """End the thread after what it is doing."""
        with self._wake:
            self._stopped = True
            self._wake.notify_all()
        if threading.current_thread() is not self._thread:
            self._thread.join(timeout=5)
