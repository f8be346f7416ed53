"""How long a diagnosis may take, what it is doing, and whether it was told to stop."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

Progress = Callable[[str], None]


@dataclass(eq=False)
class Clock:
    """A time budget that the steps of one diagnosis share.

    until
        Of `time.monotonic`; from then on no new step begins and the best so far is the answer.
    """

    until: float = float("inf")
    progress: Progress | None = None
    stopped: bool = False

    @staticmethod
    def of(budget: float | None, progress: Progress | None = None) -> Clock:
        """A clock that starts now; `budget` in seconds, None: no end."""
        return Clock(float("inf") if budget is None else time.monotonic() + budget, progress)

    def say(self, what: str) -> None:
        """Tell what is tried now."""
        if self.progress is not None:
            self.progress(what)

    @property
    def over(self) -> bool:
        """Whether no new step may begin."""
        if time.monotonic() > self.until:
            self.stopped = True
        return self.stopped

    def stop(self) -> None:
        """No new step, from now on."""
        self.stopped = True
