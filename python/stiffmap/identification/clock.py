"""How long a diagnosis may take, what it is doing, and whether it was asked to stop."""

from __future__ import annotations

import signal
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from threading import current_thread, main_thread
from types import FrameType

from stiffmap.common.broadcasting import real_number, refused

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
    left_out: list[str] = field(default_factory=list)
    """What was not tried for that."""

    @staticmethod
    def of(budget: float | None, progress: Progress | None = None) -> Clock:
        """A clock that starts now; `budget` in seconds, None: no end."""
        most = float("inf") if budget is None else real_number(budget, "time_limit", "seconds")
        if not most >= 0:
            raise refused("time_limit", "seconds, 0 or more", f"{most:g}")
        return Clock(time.monotonic() + most, progress)

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

    @contextmanager
    def on_interrupt(self) -> Iterator[None]:
        """Ctrl-C stops the clock, wherever it comes; the next one raises KeyboardInterrupt, as it does where somebody
        else handles it or outside the main thread."""
        mine = current_thread() is main_thread()
        before = signal.getsignal(signal.SIGINT) if mine else None
        if before is not signal.default_int_handler:
            yield
            return

        def once(number: int, frame: FrameType | None) -> None:
            signal.signal(signal.SIGINT, signal.default_int_handler)
            self.stopped = True
            self.say("nothing more: the best so far is the answer (Ctrl-C again: no answer)")

        signal.signal(signal.SIGINT, once)
        try:
            yield
        finally:
            signal.signal(signal.SIGINT, signal.default_int_handler)
