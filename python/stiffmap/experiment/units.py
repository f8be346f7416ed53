"""Units of an experiment file to SI; a unit that is needed and not declared is an error."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from stiffmap.errors import FileError
from stiffmap.experiment.experiment import WRENCH, Floats
from stiffmap.experiment.schema import ExperimentFile
from stiffmap.files.units import FORCES, LENGTHS


@dataclass(frozen=True)
class Scales:
    """Factors from the file's units to SI."""

    length: float
    force: float | None
    radian: float | None
    file: str

    @staticmethod
    def of(model: ExperimentFile, file: str) -> Scales:
        """Factors of a file."""
        units = model.units
        angle = {None: None, "rad": 1.0, "deg": math.pi / 180.0}[units.angle]
        force = None if units.force is None else float(FORCES[units.force])
        return Scales(float(LENGTHS[units.length]), force, angle, file)

    def angle(self, column: str) -> float:
        """Factor of a rotation column; raises `FileError` where no unit is declared."""
        if self.radian is None:
            raise FileError(
                f"units: the unit 'angle' is not declared (column '{column}' needs it)", file=self.file
            )
        return self.radian

    @property
    def motion(self) -> Floats:
        """(6,) factors of [dx dy dz rx ry rz]; rotations without a declared unit become NaN: see `angle`."""
        turn = math.nan if self.radian is None else self.radian
        return np.array([self.length] * 3 + [turn] * 3)

    def wrench(self, columns: list[str]) -> Floats:
        """(6,) factors of [fx fy fz mx my mz]; raises `FileError` where no unit is declared."""
        if columns and self.force is None:
            raise FileError(
                f"units: the unit 'force' is not declared (column '{columns[0]}' needs it)", file=self.file
            )
        force = 1.0 if self.force is None else self.force
        return np.array([force if c.startswith("f") else force * self.length for c in WRENCH])
