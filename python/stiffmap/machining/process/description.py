"""What a process is: tool, law of the cutting force, speeds and engagement. Frozen, SI."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import acos, pi

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
