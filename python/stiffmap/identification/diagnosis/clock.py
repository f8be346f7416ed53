"""How long a diagnosis may take, how much it may try, what it is doing, and whether it was asked to stop."""

from __future__ import annotations

import signal
import time
from collections.abc import Callable, Hashable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from threading import current_thread, main_thread
from types import FrameType

from stiffmap.experiment.prediction.predict import Predictor

Progress = Callable[[str], None]
MOST, SHARE, PATIENCE = 900.0, 0.2, 300.0
"""Predictions of `ROWS` rows that a diagnosis may ask for after its sensitivities, the share of one search, and how many one fit
may: an honest one needs a few tens."""
ROWS = 540
"""More rows make a prediction dearer, though not in proportion: the bound goes with the root of their number."""


@dataclass(eq=False)
class Clock:
    """A time budget that the steps of one diagnosis share.

    until
        Of `time.monotonic`; from then on no new step begins and the best so far is the answer.
    """

    until: float = float("inf")
    progress: Progress | None = None
    stopped: bool = False
    predictions: Callable[[], float] = float
    """How many were asked for so far: unlike seconds the same on every machine."""
    most: float = float("inf")
    """Predictions after which no search goes on beyond what it must do to come to an end."""
    share: float = float("inf")
    """Predictions of one search, likewise."""
    left_out: dict[str, None] = field(default_factory=dict)
    """What was not tried for that."""
    promises: dict[Hashable, float] = field(default_factory=dict)
    """What full fits kept of what screening had promised, by what was fitted."""
    given_up: set[Hashable] = field(default_factory=set)
    """What was too dear to fit, and is not tried again."""
    _search: float = float("inf")

    @staticmethod
    def of(budget: float | None, progress: Progress | None = None) -> Clock:
        """A clock that starts now; `budget` in seconds, None: no end."""
        return Clock(float("inf") if budget is None else time.monotonic() + budget, progress)

    def bound(self, predictor: Predictor) -> None:
        """From here on the search may ask a predictor for so much, and so may each fit."""
        self.count(lambda: predictor.effort, len(predictor.experiment))
        predictor.patience = PATIENCE

    def count(self, predictions: Callable[[], float], rows: int) -> None:
        """From here on the search may ask for so many predictions of an experiment with so many rows."""
        more = MOST * (ROWS / max(rows, 1)) ** 0.5
        self.predictions, self.most, self.share = predictions, predictions() + more, SHARE * more

    def begin_search(self) -> None:
        """A search begins, with a share of its own."""
        self._search = self.predictions() + self.share

    @property
    def tired(self) -> bool:
        """Whether a search may only come to an end."""
        return self.spent or self.predictions() > self._search

    @property
    def spent(self) -> bool:
        """Whether all searches may."""
        return self.predictions() > self.most

    def leave_out(self, what: str) -> None:
        """Note what is not tried."""
        self.left_out[what] = None

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
            self.stop()
            self.say("nothing more: the best so far is the answer (Ctrl-C again: no answer)")

        signal.signal(signal.SIGINT, once)
        try:
            yield
        finally:
            signal.signal(signal.SIGINT, signal.default_int_handler)
