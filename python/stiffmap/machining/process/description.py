"""What a process is: tool, law of the cutting force, speeds and engagement, frozen, SI; and its mean force over a revolution, in closed
form and for many engagements at once (theory.md, M1 to M6).

Axes: along the feed, to its left seen against the tool (normal), and along the tool from holder to tip. Forces act
on the tool. A tooth at the angle phi, counted with the rotation from the normal, cuts a chip c sin(phi).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from math import acos, pi

import numpy as np
from numpy.typing import ArrayLike

from stiffmap.common.broadcasting import Floats
from stiffmap.common.short import short_repr

SIDES = ("climb", "conventional", "slot")
"""Where the part's wall is: right of the travel, left of it, on both sides (clockwise spindle, from above)."""


@dataclass(frozen=True)
class Tool:
    """A cylindrical tool, m and rad."""

    diameter: float
    teeth: int = 0
    """0: coated, infinitely many."""
    helix: float = 0.0
    runout: float = 0.0
    """Distance of the tool's axis from the spindle's."""
    runout_angle: float = 0.0
    """Of that distance, from the first tooth's tip against the sense of the cut."""
    stick_out: float = 0.0
    modulus: float = 0.0
    """N/m² of the tool's shank, which bends by its stick-out; 0: rigid."""

    @property
    def compliance(self) -> float:
        """m/N at the tip, across the tool: a cantilever of the tool's diameter."""
        if not self.modulus:
            return 0.0
        return 64 * self.stick_out**3 / (3 * pi * self.modulus * self.diameter**4)


@dataclass(frozen=True)
class EndMill:
    """Shear (N/m²) and edge (N/m) coefficients per tooth (theory.md, M1)."""

    Ktc: float
    Krc: float
    Kac: float = 0.0
    Kte: float = 0.0
    Kre: float = 0.0
    Kae: float = 0.0


@dataclass(frozen=True)
class Kienzle:
    """Chip pressure k = kc11 (h / 1 mm)^-mc; radial and axial parts as shares of the tangential one (M2)."""

    kc11: float
    """N/m², at a chip of 1 mm."""
    mc: float
    radial: float = 0.3
    axial: float = 0.0


@dataclass(frozen=True)
class Trimming:
    """A tool coated with diamond (M3)."""

    specific_energy: float
    """J/m³ of removed material."""
    rubbing: float = 0.0
    """N/m² of contact: tangential force that the feed does not change."""
    radial: float = 0.0
    """Radial force as a share of the tangential one."""


Law = EndMill | Kienzle | Trimming


@dataclass(frozen=True)
class Cut:
    """Engagement, m."""

    side: str
    radial: float
    """Width of the cut, across the feed; of a slot the tool's diameter."""
    axial: float
    """Depth, along the tool."""
    through: bool = True
    """The tool passes through the stock: its depth does not follow the tool's axial deflection."""


@short_repr
@dataclass(frozen=True)
class Process:
    """Tool, law, speeds and cut of one operation."""

    name: str
    tool: Tool
    law: Law
    spindle: float
    """rad/s."""
    feed: float
    """m/s along the path."""
    cut: Cut
    tolerance: float | None = None
    """m, of the part across its wall."""
    title: str = ""
    source: str = ""
    uncertainty: Mapping[str, float] = field(default_factory=dict)
    """Standard uncertainty of numbers of the law, by name."""
    note: str = ""
    """What a conversion has done to the law."""

    @property
    def chip(self) -> float:
        """m, feed per tooth; of a coated tool per revolution."""
        return self.feed * 2 * pi / self.spindle / max(self.tool.teeth, 1)

    @property
    def cutting_speed(self) -> float:
        """m/s at the tool's rim."""
        return self.spindle * self.tool.diameter / 2

    @property
    def mean_chip(self) -> float:
        """m, mean thickness of a chip over the engaged arc."""
        return self.chip * self.cut.radial / (self.tool.diameter / 2) / self.arc

    @property
    def arc(self) -> float:
        """rad, engaged arc of the tool."""
        return acos(max(-1.0, 1 - 2 * self.cut.radial / self.tool.diameter))


def with_coefficients(process: Process) -> Process:
    """The process with a law of chips and edges: Kienzle's by its secant at the mean chip thickness, and said so (M2)."""
    law = process.law
    if not isinstance(law, Kienzle):
        return process
    mm = 1e-3
    k = law.kc11 * (process.mean_chip / mm) ** -law.mc
    note = (
        f"Kienzle's law is taken by its secant at the mean chip thickness, {1e3 * process.mean_chip:.4g} mm: "
        f"{k / 1e6:.4g} N/mm²"
    )
    return replace(
        process,
        law=EndMill(k, law.radial * k, law.axial * k),
        note=note,
        uncertainty={"Ktc": process.uncertainty.get("kc11", 0.0) / law.kc11 * k},
    )


def densities(process: Process) -> tuple[Floats, Floats]:
    """(3,) and (3,) N per m of depth and rad of arc: constant part, and part that grows with sin(phi); tangential, radial, axial."""
    p = with_coefficients(process)
    law, tool = p.law, p.tool
    if isinstance(law, Trimming):
        way = np.array([1.0, law.radial, 0.0])
        return tool.diameter / 2 * law.rubbing * way, law.specific_energy * p.feed / p.spindle * way
    assert isinstance(law, EndMill)
    rate = tool.teeth / (2 * pi)
    edge = np.array([law.Kte, law.Kre, law.Kae])
    return rate * edge, rate * p.chip * np.array([law.Ktc, law.Krc, law.Kac])


def widened(process: Process, radial: ArrayLike, curvature: ArrayLike = 0.0) -> Floats:
    """m: width of a straight cut with the same engaged arc as on a curved path (M5), from 0 to the diameter.

    curvature: 1/m of the path of the tool's centre, positive where the part lies outside the curve (inside corner).
    """
    ae = np.asarray(radial, dtype=float)
    r = process.tool.diameter / 2
    return np.clip(ae * (1 + np.asarray(curvature) * (r - ae / 2)), 0.0, 2 * r)


def engaged(process: Process, width: Floats) -> tuple[Floats, Floats]:
    """rad: first and last angle of the engaged arc for a straight cut of this width (m)."""
    arc = np.arccos(np.clip(1 - 2 * width / process.tool.diameter, -1.0, 1.0))
    zero, half = np.zeros_like(arc), np.full_like(arc, pi)
    if process.cut.side == "climb":
        return half - arc, half
    return (zero, arc) if process.cut.side == "conventional" else (half - half, half)


def own_arc(process: Process) -> tuple[float, float]:
    """rad: first and last angle of the engaged arc of the process's own cut."""
    first, last = engaged(process, widened(process, process.cut.radial))
    return float(first), float(last)


def mean_force(process: Process, width: ArrayLike, axial: ArrayLike, faster: ArrayLike = 1.0) -> Floats:
    """(..., 3) N, mean force for straight cuts of this width and depth (m); of a slot the width does not count.

    faster: (...) feed per revolution as a multiple of the process's own.
    """
    w, a, more = np.broadcast_arrays(width, axial, faster)
    edge, each = densities(process)
    chip = [more * k for k in each]
    f, t = engaged(process, w)
    cos, sin = np.cos(t) - np.cos(f), np.sin(t) - np.sin(f)
    square = (np.sin(t) ** 2 - np.sin(f) ** 2) / 2
    twice = (t - f) / 2 - (np.sin(2 * t) - np.sin(2 * f)) / 4
    force = np.stack(
        [
            -edge[0] * sin - chip[0] * square + edge[1] * cos - chip[1] * twice,
            -edge[0] * cos + chip[0] * twice - edge[1] * sin - chip[1] * square,
            edge[2] * (t - f) - chip[2] * cos,
        ],
        axis=-1,
    )
    return np.asarray(np.maximum(a, 0.0)[..., None] * force)


def tangential_force(process: Process, width: ArrayLike, axial: ArrayLike) -> Floats:
    """N, mean tangential force at the rim: torque over radius."""
    w, a = np.broadcast_arrays(np.asarray(width, float), np.asarray(axial, float))
    edge, chip = densities(process)
    f, t = engaged(process, w)
    return np.asarray(np.maximum(a, 0.0) * (edge[0] * (t - f) - chip[0] * (np.cos(t) - np.cos(f))))
