"""The force of a process at its own engagement: mean, peak, harmonics, what it needs of the spindle."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import pi
from os import PathLike
from typing import Any

import numpy as np

from stiffmap.common.broadcasting import Floats
from stiffmap.common.short import short_repr
from stiffmap.machining.process.description import Process
from stiffmap.machining.process.load import load_process
from stiffmap.machining.process.mean import mean_force, slopes, tangential_force, with_coefficients
from stiffmap.machining.process.revolution import leaves_cut, mean_with_runout, revolution

ORDERS = 12
"""Harmonics of the tooth passing that are kept."""


@short_repr
@dataclass(frozen=True, eq=False)
class CuttingForce:
    """Force on the tool in the axes feed, normal (left of the feed, seen against the tool), tool axis (holder to tip), N."""

    mean: Floats
    """(3,)."""
    angle: Floats
    """(k,) rad of the spindle."""
    force: Floats
    """(k, 3) over a revolution."""
    order: Floats
    """(m,) multiples of the spindle's frequency."""
    amplitude: Floats
    """(m, 3) amplitude of each."""
    spindle_frequency: float
    """Hz."""
    tangential: float
    """N, mean at the rim; of run-out that lifts teeth out of the cut it does not know."""
    power: float
    """W at the spindle."""
    stiffness_side: float
    """N/m: how the normal force falls per metre that the tool is pushed off the wall."""
    stiffness_depth: float
    """N/m: how the normal force falls per metre that the tool is lifted; 0 where the tool passes through."""
    note: str = ""

    @property
    def peak(self) -> float:
        """N, largest size over a revolution."""
        return float(np.linalg.norm(self.force, axis=1).max())

    @property
    def frequency(self) -> Floats:
        """(m,) Hz of `amplitude`."""
        return self.order * self.spindle_frequency


def cutting_force(process: Process | str | PathLike[str] | Mapping[str, Any]) -> CuttingForce:
    """Force of a process, or of the shipped one or file of that name.

    `mean` is the closed form where no tooth leaves the cut, a quadrature where run-out lifts one out of it.
    Raises FileError for a process file that cannot be used.
    """
    given = process if isinstance(process, Process) else load_process(process)
    p = with_coefficients(given)
    lifted = leaves_cut(p)
    mean = mean_with_runout(p) if lifted else mean_force(p, p.cut.radial, p.cut.axial)
    angle, force = revolution(p)
    n = max(p.tool.teeth, 1)
    spectrum = 2 * np.abs(np.fft.rfft(force, axis=0)) / len(angle)
    order = np.arange(1, n * ORDERS + 1)
    order = order[order < len(spectrum)]
    side, depth = slopes(p, p.cut.radial, p.cut.axial)
    tangential = float(tangential_force(p, p.cut.radial, p.cut.axial))
    wall = -1.0 if p.cut.side == "climb" else 1.0  # the part lies on this side of the normal
    notes = [p.note] if p.note else []
    if lifted:
        notes.append("run-out lifts a tooth out of the cut: the mean is not that without run-out")
    return CuttingForce(
        mean=mean,
        angle=angle,
        force=force,
        order=order.astype(float),
        amplitude=spectrum[order],
        spindle_frequency=p.spindle / (2 * pi),
        tangential=tangential,
        power=tangential * p.cutting_speed,
        stiffness_side=float(-wall * side[1]),
        stiffness_depth=0.0 if p.cut.through else float(abs(depth[1])),
        note="; ".join(notes),
    )


def force_uncertainty(process: Process) -> Floats:
    """(3,) N, standard uncertainty of the mean force from those of the law's numbers (independent, to first order)."""
    base = mean_force(process, process.cut.radial, process.cut.axial)
    total = np.zeros(3)
    for name, u in process.uncertainty.items():
        moved = replace(process, law=replace(process.law, **{name: getattr(process.law, name) + u}))
        total += (mean_force(moved, process.cut.radial, process.cut.axial) - base) ** 2
    return np.sqrt(total)
