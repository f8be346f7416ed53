"""A mode of the machine, moving."""

from __future__ import annotations

import threading
import time
from typing import Any

import numpy as np

from stiffmap.common.errors import StiffmapError
from stiffmap.ui.plot.modes import swung
from stiffmap.ui.plot.skeleton import skeleton
from stiffmap.ui.view.moment import Moment
from stiffmap.ui.view.scene import GHOST
from stiffmap.workspace.performance.motion.inertia import NaturalFrequencies

MODES, RATE, PERIOD, SWING = 6, 20.0, 1.5, 0.05
"""Modes shown, pictures per second, seconds of a swing on the screen, its size as part of the extent."""


class Swing:
    """Moves the ghost through a mode while it is switched on."""

    def __init__(self, viewer: Any) -> None:
        self._viewer = viewer
        self._on = threading.Event()
        self._end = False
        self._found: tuple[Moment, NaturalFrequencies | None] | None = None
        self._thread = threading.Thread(target=self._run, daemon=True, name="stiffmap view mode")
        self._thread.start()

    def play(self, on: bool) -> None:
        """Start or hold."""
        if on:
            self._on.set()
        else:
            self._on.clear()
            self._viewer.worker.ask()

    def frequencies(self, moment: Moment) -> NaturalFrequencies | None:
        """The lowest modes; None where bodies lack masses or the pose has none."""
        try:
            w = moment.modes(moment.state.position, MODES)
        except StiffmapError:
            w = None
        if w is not None and not np.isfinite(w.frequency).any():
            w = None
        self._found = (moment, w)
        return w

    def _run(self) -> None:
        while True:
            self._on.wait()
            if self._end:
                return
            begun = time.perf_counter()
            found = self._found
            mode = self._viewer.controls.mode.value - 1
            if found is not None and found[1] is not None and mode < len(found[1].frequency):
                self._frame(found[0], found[1], mode, 2 * np.pi * begun / PERIOD)
            time.sleep(max(0.0, 1 / RATE - (time.perf_counter() - begun)))

    def _frame(self, moment: Moment, w: NaturalFrequencies, mode: int, phase: float) -> None:
        scene = self._viewer.scene
        if not np.isfinite(w.frequency[mode]):
            return
        at = swung(moment.machine, w, mode, phase, SWING * scene.extent)
        moved = skeleton(moment.machine, at).links
        scene.lines("/ghost", moved, GHOST, 0.004 * scene.extent)

    def stop(self) -> None:
        """End the thread."""
        self._end = True
        self._on.set()
