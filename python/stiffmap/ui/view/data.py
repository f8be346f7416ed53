"""Measured rows, a diagnosis and tool paths in the scene; what is magnified says by how much."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from os import PathLike
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from stiffmap.common.broadcasting import Floats
from stiffmap.common.kept import Kept
from stiffmap.common.number_text import length_text
from stiffmap.experiment import Experiment
from stiffmap.experiment.calls import residual
from stiffmap.identification.diagnosis.report.findings import Effect
from stiffmap.identification.diagnosis.report.result import Diagnosis, read_diagnosis
from stiffmap.identification.diagnosis.report.sentences import effect_text
from stiffmap.solve.machine import Machine, load_machine
from stiffmap.ui.plot.loaded import round_factor
from stiffmap.ui.plot.skeleton import element_links
from stiffmap.ui.plot.style import BLUE, GREEN, VERMILLION
from stiffmap.ui.view.moment import Moment
from stiffmap.ui.view.plane import rgb
from stiffmap.ui.view.scene import DIAGNOSED, Scene

DRAWN = 0.06  # of the machine's extent, the longest arrow and the widest ribbon
MOST_POINTS = 400  # of a path that are solved
BEFORE, NOW, NAMED = VERMILLION, BLUE, DIAGNOSED
"""Residuals of the machine as opened, with what was changed in the view, and with what a diagnosis named."""
Arrows = tuple[Floats, Floats]
"""Places (n, 3) m and what is drawn there (n, 3) m."""

RESULT, CORRECTED = "diagnosis.json", "machine.yaml"
"""Files of the folder that ``stiffmap diagnose -o`` wrote."""


class ShownFindings(NamedTuple):
    """A verdict, the effects that it names, and the machine with them."""

    verdict: str
    effects: Sequence[Effect]
    machine: Machine


def findings(diagnosis: Diagnosis | str | PathLike[str]) -> ShownFindings:
    """Of a `Diagnosis`, or of the folder of one (or its ``diagnosis.json``); FileError where that cannot be read."""
    if not isinstance(diagnosis, str | PathLike):
        return ShownFindings(diagnosis.verdict, diagnosis.effects, diagnosis.machine)
    file = Path(diagnosis)
    file = file / RESULT if file.is_dir() else file
    return ShownFindings(*read_diagnosis(file), load_machine(file.with_name(CORRECTED)))


class Data:
    """What is drawn next to the machine: rows of an experiment, what a diagnosis named, a path of the tool (n, 3) m."""

    def __init__(
        self,
        experiment: Experiment | None = None,
        path: Floats | None = None,
        diagnosis: ShownFindings | None = None,
        opened: Machine | None = None,
    ) -> None:
        """opened: the machine whose residuals come before; None: the first that is drawn."""
        self.experiment, self.path = experiment, None if path is None else thinned(path)
        self.diagnosis, self.opened = diagnosis, opened
        self._residuals: Kept[Machine, Arrows] = Kept(3)  # before, now, diagnosed
        self._drawn: tuple[Machine, Scene] | None = None
        self._said: dict[str, str] = {}

    def __call__(self, scene: Scene, moment: Moment) -> None:
        if self.experiment is not None:
            self._rows(scene, moment, self.experiment)
        if self.diagnosis is not None:
            self._effects(scene, moment, self.diagnosis)
        if self.path is not None:
            self._ribbon(scene, moment, self.path)

    @property
    def html(self) -> str:
        """What the colours mean and how large they are drawn, for the panel."""
        said = self._said.copy()  # as a page may be made of it in another thread meanwhile
        return "".join(f'<p style="margin:.4em 0"><b>{k}</b>: {v}</p>' for k, v in said.items())

    def _rows(self, scene: Scene, moment: Moment, e: Experiment) -> None:
        if self._drawn == (moment.machine, scene):
            return

        def left(machine: Machine) -> Arrows:
            return self._residuals.made(machine, lambda: residual_arrows(machine, e))

        self.opened = self.opened or moment.machine
        before, now = left(self.opened), left(moment.machine)
        diagnosed = None if self.diagnosis is None else left(self.diagnosis.machine)
        self._drawn = (moment.machine, scene)
        places = before[0]
        if not len(places):
            self._said["Experiment"] = f"{escape(e.name)} reads no displacement of the tool along an axis"
            return
        factor = round_factor(DRAWN * scene.extent, float(np.linalg.norm(before[1], axis=1).max()))
        words = []
        for name, colour, said, which, found in (
            ("before", BEFORE, "red", "as opened", before),
            ("now", NOW, "blue", "as changed here", None if np.array_equal(now, before) else now),
            ("diagnosed", NAMED, "pink", "with the diagnosis", diagnosed),
        ):
            at, arrows = found or (np.zeros((0, 3)),) * 2
            pieces = np.stack([at, at + factor * arrows], axis=1)
            scene.lines(f"/rows/{name}", pieces, colour, 0.004 * scene.extent)
            if found is not None:
                rms = float(np.sqrt(np.mean(np.sum(arrows**2, axis=1))))
                words.append(f"{said} {which} {length_text(rms)} rms")
        text = f"{len(places)} rows, residuals (measured less predicted) × {factor:g}: {', '.join(words)}"
        self._said["Experiment"] = f"{escape(e.name)}, {text}"
        scene.points("/rows/places", places, rgb("#444444"), 0.005)

    def _effects(self, scene: Scene, moment: Moment, found: ShownFindings) -> None:
        links = [element_links(moment.machine, e.element, e.legs) for e in found.effects]
        scene.diagnosed = list(dict.fromkeys(i for each in links for i in each))
        named = "; ".join(escape(effect_text(e)) for e in found.effects) or "no effect is named"
        self._said["Diagnosis (pink)"] = f"{escape(found.verdict)}: {named}"
        for i, (e, lit) in enumerate(zip(found.effects, links, strict=True)):
            if lit:
                middle = scene.rest.links[lit[0]].mean(axis=0)
                scene.api.add_label(f"/diagnosis/{i}", f"{e.kind} of {e.element}", position=tuple(middle))

    def _ribbon(self, scene: Scene, moment: Moment, path: Floats) -> None:
        wanted, cut, corrected, factor = path_errors(moment, path, DRAWN * scene.extent)
        lines = (("wanted", GREEN, wanted), ("cut", VERMILLION, cut), ("compensated", BLUE, corrected))
        for name, colour, line in lines:
            pieces = np.stack([line[:-1], line[1:]], axis=1)
            good = np.isfinite(pieces).all(axis=(1, 2))
            scene.lines(f"/path/{name}", pieces[good], colour, 0.003 * scene.extent)
        vertices, faces = ribbon(wanted, cut)
        scene.mesh("/path/ribbon", vertices, faces, VERMILLION)
        off = [length_text(largest(line - wanted) / factor) for line in (cut, corrected)]
        failed = int((~np.isfinite(cut).all(axis=1)).sum())
        more = f"; {failed} of {len(path)} points have no equilibrium" if failed else ""
        self._said["Path"] = (
            f"errors × {factor:g}: wanted green, as cut red (most {off[0]}), "
            f"compensated by one mirror step blue (most {off[1]}){more}"
        )


def largest(arrows: Floats) -> float:
    """Greatest length; 0 where none is finite."""
    return float(np.nanmax(np.linalg.norm(arrows, axis=1), initial=0.0))


def ribbon(one: Floats, other: Floats) -> tuple[Floats, NDArray[np.uint32]]:
    """Vertices (2n, 3) and triangles (m, 3) between two lines (n, 3), where both are finite."""
    n = len(one)
    i = np.arange(n - 1)
    good = np.asarray(np.isfinite(np.hstack([one, other])).all(axis=1))
    i = i[good[:-1] & good[1:]]
    faces = np.concatenate([np.stack(t, axis=1) for t in ((i, i + 1, n + i), (i + 1, n + i + 1, n + i))])
    return np.nan_to_num(np.concatenate([one, other])), faces.astype(np.uint32)


def thinned(path: Floats) -> Floats:
    """At most some hundred points of a path."""
    p = np.asarray(path, dtype=float).reshape(-1, 3)
    return np.asarray(p[:: max(1, -(-len(p) // MOST_POINTS))])


def residual_arrows(machine: Machine, experiment: Experiment) -> Arrows:
    """Places (n, 3) m of the rows that read a displacement along an axis, and their residuals (n, 3) m; 0 where an
    axis is not read."""
    r = residual(machine, experiment)
    values = r.values[:, :3]
    read = np.isfinite(values).any(axis=1)
    return np.asarray(r.experiment.position[read]), np.nan_to_num(values[read])


def path_errors(moment: Moment, path: Floats, size: float) -> tuple[Floats, Floats, Floats, float]:
    """The path that is wanted, as cut under the state's load, and after one mirror step, errors times a round factor.

    The mirror step commands the path less its deflection; what is left is solved there.
    """

    def off(at: Floats) -> Floats:
        return np.asarray(moment.solve(at, stiffness=False).displacement[:, :3])

    cut = off(path)
    command = path - cut
    good = np.isfinite(command).all(axis=1)
    left = np.full_like(path, np.nan)
    left[good] = off(command[good]) + command[good] - path[good]
    factor = round_factor(size, largest(cut))
    return path, path + factor * cut, path + factor * left, factor
