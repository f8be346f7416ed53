"""Units of an experiment file to SI; a unit that is needed and not declared is an error."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from stiffmap.common.errors import FileError
from stiffmap.common.units import FORCES, LENGTHS, MOMENTS, PLANE_ANGLES, size_of
from stiffmap.experiment.experiment import WRENCH, Channel, Floats
from stiffmap.experiment.files.schema import ExperimentFile

ANGLES = {a: float(PLANE_ANGLES[a]) for a in ("rad", "mrad", "deg")}


def factor(unit: str) -> float:
    """SI size of a unit of length, angle, force or moment."""
    return size_of(unit, PLANE_ANGLES, MOMENTS, LENGTHS, FORCES)


@dataclass(frozen=True)
class Scales:
    """Factors from the file's units to SI."""

    length: float
    force: float | None
    radian: float | None
    own: dict[str, float]
    """Of columns that declare their unit themselves."""
    file: str

    @staticmethod
    def of(model: ExperimentFile, file: str) -> Scales:
        """Factors of a file."""
        units = model.units
        angle = None if units.angle is None else ANGLES[units.angle]
        force = None if units.force is None else float(FORCES[units.force])
        own = {name: factor(unit) for name, unit in units.own().items()}
        own |= {name: factor(c.unit) for name, c in model.joints.items()}
        own |= {name: factor(c.unit) for name, c in model.command.items()}
        return Scales(factor(units.length), force, angle, own, file)

    def lengths(self, columns: Sequence[str]) -> Floats:
        """Factors of columns of lengths."""
        return np.array([self.own.get(c, self.length) for c in columns])

    def angle(self, column: str) -> float:
        """Factor of a rotation column; raises `FileError` where no unit is declared."""
        if column in self.own:
            return self.own[column]
        if self.radian is None:
            raise FileError(
                f"units: the unit 'angle' is not declared (column '{column}' needs it)", file=self.file
            )
        return self.radian

    def motion(self, channels: tuple[Channel, ...]) -> Floats:
        """(c,) factors of readings; rotations without a declared unit become NaN: see `angle`."""
        turn = math.nan if self.radian is None else self.radian
        return np.array([self.own.get(c.name, self.length if c.unit == "m" else turn) for c in channels])

    def wrench(self, columns: list[str]) -> Floats:
        """(6,) factors of [fx fy fz mx my mz]; raises `FileError` where no unit is declared."""
        lost = [c for c in columns if c not in self.own]
        if lost and self.force is None:
            raise FileError(
                f"units: the unit 'force' is not declared (column '{lost[0]}' needs it)", file=self.file
            )
        force = 1.0 if self.force is None else self.force
        return np.array([self.own.get(c, force if c[0] == "f" else force * self.length) for c in WRENCH])
