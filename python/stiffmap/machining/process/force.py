"""The force of a process at its own engagement over one revolution: slices along the helix, every tooth, run-out (theory.md, M1 and M4);
its mean, peak, harmonics, what it needs of the spindle."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from math import pi, tan

import numpy as np

from stiffmap.common.broadcasting import Floats
from stiffmap.common.short import short_repr
from stiffmap.machining.process.description import (
    EndMill,
    Process,
    mean_force,
    own_arc,
    tangential_force,
    with_coefficients,
)
from stiffmap.machining.process.load import GivenProcess, as_process

STEPS = 720
"""Angles of a revolution, about; the nearest multiple of the teeth is taken."""
SLICES = 60
SMALL = 1e-8
"""m of a central difference of the force."""


@cache
def gauss(count: int) -> tuple[Floats, Floats]:
    """Nodes (count,) of Gauss' rule on -1 … 1 and weights; not to be written to."""
    node, weight = np.polynomial.legendre.leggauss(count)
    return np.asarray(node, dtype=float), np.asarray(weight, dtype=float)


def revolution(process: Process, steps: int = STEPS, slices: int = SLICES) -> tuple[Floats, Floats]:
    """(k,) rad of the spindle and (k, 3) N in the axes of `mean_force`; of a coated tool its constant force."""
    p = with_coefficients(process)
    tool = p.tool
    if not isinstance(p.law, EndMill):
        angle = 2 * pi * np.arange(steps) / steps
        return angle, np.tile(mean_force(p, p.cut.radial, p.cut.axial), (steps, 1))
    count = tool.teeth * max(1, round(steps / tool.teeth))
    angle = 2 * pi * (np.arange(count) + 0.5) / count
    z = p.cut.axial * (np.arange(slices) + 0.5) / slices
    inside = _inside(p, z)
    phi = np.mod(angle[:, None, None] - inside, 2 * pi)
    first, last = own_arc(p)
    cuts = (phi >= first) & (phi <= last)
    chip = np.where(cuts, chip_thickness(p, phi, inside), 0.0)
    cuts &= chip > 0
    law = vars(p.law)
    s, c, dz = np.sin(phi), np.cos(phi), p.cut.axial / slices
    # N of each slice of each tooth
    t, r, a = (np.where(cuts, law[f"K{n}e"] + law[f"K{n}c"] * chip, 0.0) * dz for n in "tra")
    force = np.stack([(-t * c - r * s).sum((1, 2)), (t * s - r * c).sum((1, 2)), a.sum((1, 2))], axis=-1)
    return angle, force


def _inside(p: Process, z: Floats) -> Floats:
    """(teeth, z) rad: position in the tool of each tooth at heights (z,) m, against the rotation."""
    tool = p.tool
    return 2 * pi * np.arange(tool.teeth)[:, None] / tool.teeth + 2 * z * tan(tool.helix) / tool.diameter


def chip_thickness(p: Process, phi: Floats, inside: Floats) -> Floats:
    """m, of tooth j at the angles phi (..., teeth, z): from the deepest surface that any earlier tooth left (M4)."""
    tool = p.tool
    if tool.runout == 0.0:
        return np.asarray(p.chip * np.sin(phi))
    radius = tool.runout * np.cos(tool.runout_angle - inside)  # (teeth, z)
    # `inside` counts against the rotation: the tooth that passed an angle m teeth earlier is tooth j - m
    before = [
        m * p.chip * np.sin(phi) + radius - np.roll(radius, m, axis=0) for m in range(1, tool.teeth + 1)
    ]
    return np.asarray(np.maximum(np.min(before, axis=0), 0.0))


NAMES = ("Ktc", "Kte", "Krc", "Kre", "Kac", "Kae")
ARC_NODES, HEIGHT_NODES = 160, 8


def mean_basis_with_runout(process: Process) -> Floats:
    """(3, 6) N per unit of `NAMES`: the mean where run-out may lift teeth out of the cut, by quadrature
    over angle and height; the law itself does not count."""
    p = process
    node, weight = gauss(ARC_NODES)
    first, last = own_arc(p)
    phi = (first + (last - first) * (node + 1) / 2)[:, None, None]
    zn, zw = gauss(HEIGHT_NODES)
    chip = chip_thickness(p, phi, _inside(p, p.cut.axial * (zn + 1) / 2))
    w = (last - first) / 2 * weight[:, None, None] * (p.cut.axial / 2 * zw) / (2 * pi)
    # a tooth's chip and edge parts summed over height and teeth, over the angle
    parts = [(chip * w).sum((1, 2)), ((chip > 0) * w).sum((1, 2))]
    s, c = np.sin(phi[:, 0, 0]), np.cos(phi[:, 0, 0])
    zero = np.zeros_like(s)
    ways = ((-c, s, zero), (-s, -c, zero), (zero, zero, zero + 1))
    return np.array([[(part * way[i]).sum() for way in ways for part in parts] for i in range(3)])


def leaves_cut(process: Process) -> bool:
    """Whether run-out lifts a tooth out of the cut somewhere along its arc."""
    p = with_coefficients(process)
    if not isinstance(p.law, EndMill) or p.tool.runout == 0.0:
        return False
    first, last = own_arc(p)
    phi = np.linspace(first, last, 721)[1:-1, None, None]
    radius = p.tool.runout * np.cos(p.tool.runout_angle - _inside(p, np.linspace(0, p.cut.axial, 31)))
    single = p.chip * np.sin(phi) + radius - np.roll(radius, 1, axis=0)
    return bool((single < 0).any())


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


def cutting_force(process: GivenProcess) -> CuttingForce:
    """Force of a process, or of the shipped one or file of that name.

    `mean` is the closed form where no tooth leaves the cut, a quadrature where run-out lifts one out of it.
    Raises FileError for a process file that cannot be used.
    """
    p = with_coefficients(as_process(process))
    lifted = leaves_cut(p)
    mean = mean_force(p, p.cut.radial, p.cut.axial)
    if lifted:
        mean = mean_basis_with_runout(p) @ np.array([vars(p.law)[n] for n in NAMES])
    angle, force = revolution(p)
    n = max(p.tool.teeth, 1)
    spectrum = 2 * np.abs(np.fft.rfft(force, axis=0)) / len(angle)
    order = np.arange(1, n * ORDERS + 1)
    order = order[order < len(spectrum)]
    step = min(
        SMALL, p.tool.diameter - p.cut.radial
    )  # no width changes the arc of a tool that is engaged all around
    ends = mean_force(p, p.cut.radial + np.array([step, -step]), p.cut.axial)
    side = (ends[0] - ends[1]) / (2 * step or 1.0)
    depth = mean_force(p, p.cut.radial, 1.0)
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
