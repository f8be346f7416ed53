"""Measured rows and tool paths in the scene, each at a magnification that is stated there."""

from __future__ import annotations

import numpy as np

from stiffmap.broadcasting import Floats
from stiffmap.experiment import Experiment
from stiffmap.experiment.comparison.residual import residual
from stiffmap.machine import Machine
from stiffmap.plot.loaded import round_factor
from stiffmap.plot.style import BLUE, GREEN, VERMILLION
from stiffmap.view.moment import Moment
from stiffmap.view.place import orientation
from stiffmap.view.scene import Scene

DRAWN = 0.06
"""Of the machine's extent, the longest arrow and the widest ribbon."""
MOST_POINTS = 400
"""Of a path that are solved."""
BEFORE, AFTER = VERMILLION, BLUE


class Data:
    """What is drawn next to the machine: rows of an experiment, a path of the tool (n, 3) m, or both."""

    def __init__(self, experiment: Experiment | None = None, path: Floats | None = None) -> None:
        self.experiment, self.path = experiment, None if path is None else thinned(path)
        self._before: tuple[Floats, Floats] | None = None
        self._drawn: Machine | None = None

    def __call__(self, scene: Scene, moment: Moment) -> None:
        """Draw into a scene."""
        if self.experiment is not None:
            self._rows(scene, moment)
        if self.path is not None:
            self._ribbon(scene, moment, self.path)

    def _rows(self, scene: Scene, moment: Moment) -> None:
        if self._drawn is moment.machine:
            return
        assert self.experiment is not None
        now = residual_arrows(moment.machine, self.experiment)
        if self._before is None:
            self._before = now
        self._drawn = moment.machine
        places, before = self._before
        factor = round_factor(DRAWN * scene.extent, float(np.linalg.norm(before, axis=1).max(initial=0.0)))
        for name, colour, arrows in (("before", BEFORE, before), ("after", AFTER, now[1])):
            pieces = np.stack([places, places + factor * arrows], axis=1)
            same = name == "after" and arrows is before
            scene.lines(f"/rows/{name}", pieces[:0] if same else pieces, colour, 0.004 * scene.extent)
        mean = [1e6 * float(np.sqrt(np.mean(np.sum(a**2, axis=1)))) for a in (before, now[1])]
        text = f"residuals × {factor:g}: before {mean[0]:.3g} µm rms (red), now {mean[1]:.3g} µm (blue)"
        scene.api.add_label("/rows/label", text, position=tuple(places[0]))

    def _ribbon(self, scene: Scene, moment: Moment, path: Floats) -> None:
        wanted, cut, corrected, factor = path_errors(moment, path, DRAWN * scene.extent)
        for name, colour, line in (
            ("wanted", GREEN, wanted),
            ("cut", VERMILLION, cut),
            ("compensated", BLUE, corrected),
        ):
            pieces = np.stack([line[:-1], line[1:]], axis=1)
            good = np.isfinite(pieces).all(axis=(1, 2))
            scene.lines(f"/path/{name}", pieces[good], colour, 0.003 * scene.extent)
        rungs = np.stack([wanted, cut], axis=1)
        good = np.isfinite(rungs).all(axis=(1, 2))
        scene.lines("/path/ribbon", rungs[good], VERMILLION, 1.0, "screen")
        text = f"errors × {factor:g}: wanted green, cut red, compensated once blue"
        scene.api.add_label("/path/label", text, position=tuple(wanted[0]))


def thinned(path: Floats) -> Floats:
    """At most some hundred points of a path."""
    p = np.asarray(path, dtype=float).reshape(-1, 3)
    return np.asarray(p[:: max(1, -(-len(p) // MOST_POINTS))])


def residual_arrows(machine: Machine, experiment: Experiment) -> tuple[Floats, Floats]:
    """Places (n, 3) m of the rows that read a displacement along an axis, and their residuals (n, 3) m; 0 where an
    axis is not read."""
    r = residual(machine, experiment)
    values = np.zeros((len(r.values), 3))
    for i, c in enumerate(r.experiment.channels):
        for axis, name in enumerate(("dx", "dy", "dz")):
            if c.name == name:
                values[:, axis] = r.values[:, i]
    read = np.isfinite(values).any(axis=1)
    return np.asarray(r.experiment.position[read]), np.nan_to_num(values[read])


def path_errors(moment: Moment, path: Floats, size: float) -> tuple[Floats, Floats, Floats, float]:
    """The path that is wanted, as cut under the state's load, and after one mirror step, errors times a round factor.

    The mirror step commands the path less its deflection; what is left is solved there.
    """
    s, m = moment.state, moment.machine

    def off(at: Floats) -> Floats:
        solution = m.solve(
            at, s.wrench, rotation=orientation(s), gravity=s.gravity, start=s.start_array, stiffness=False
        )
        return np.asarray(solution.displacement[:, :3])

    cut = off(path)
    command = path - cut
    good = np.isfinite(command).all(axis=1)
    left = np.full_like(path, np.nan)
    left[good] = off(command[good]) + command[good] - path[good]
    most = float(np.nanmax(np.linalg.norm(cut, axis=1), initial=0.0))
    factor = round_factor(size, most)
    return path, path + factor * cut, path + factor * left, factor
