"""The answer of a calibration, with its words."""

from __future__ import annotations

from dataclasses import dataclass, field

from stiffmap.common.short import short_repr
from stiffmap.identification.calibration.corrected import Correction
from stiffmap.identification.calibration.facts import Facts
from stiffmap.identification.calibration.wording import lines, table


@short_repr
@dataclass(frozen=True, eq=False)
class Calibration(Facts):
    """What a machine's numbers are, given their uncertainties and the readings; SI."""

    correction: Correction = field(repr=False, kw_only=True)
    """How some of the readings, with effects besides, make such a machine."""

    def lines(self) -> list[str]:
        """The verdict in a few lines."""
        return lines(self)

    def table(self, most: int | None = None) -> list[str]:
        """The unknowns, one a line, those first that the readings determine best."""
        return table(self, most)

    def __str__(self) -> str:
        return "\n".join(self.lines())
