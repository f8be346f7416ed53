"""Units of an experiment file to SI; a unit that is needed and not declared is an error."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from stiffmap.errors import FileError
from stiffmap.experiment.experiment import WRENCH, Channel, Floats
from stiffmap.experiment.schema import ExperimentFile
from stiffmap.files.units import FORCES, LENGTHS

ANGLES = {"rad": 1.0, "deg": math.pi / 180.0}


def factor(unit: str) -> float:
    """SI size of a unit of length or angle."""
    return ANGLES[unit] if unit in ANGLES else float(LENGTHS[unit])


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
        own = {name: factor(c.unit) for name, c in model.joints.items()}
        own |= {name: factor(c.unit) for name, c in model.command.items()}
        return Scales(float(LENGTHS[units.length]), force, angle, own, file)

    def angle(self, column: str) -> float:
        """Factor of a rotation column; raises `FileError` where no unit is declared."""
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
        if columns and self.force is None:
            raise FileError(
                f"units: the unit 'force' is not declared (column '{columns[0]}' needs it)", file=self.file
            )
        force = 1.0 if self.force is None else self.force
        return np.array([force if c.startswith("f") else force * self.length for c in WRENCH])
