"""Units of an experiment file to SI; a unit that is needed and not declared is an error."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from stiffmap.common.errors import FileError
from stiffmap.common.tables.header import refuse_twice
from stiffmap.common.units import (
    FORCES,
    LENGTHS,
    MOMENTS,
    PLANE_ANGLES,
    known,
    name_and_unit,
    size_of,
    unit_of,
)
from stiffmap.experiment.experiment import WRENCH, Channel, Floats
from stiffmap.experiment.files.fields import known as known_columns
from stiffmap.experiment.files.fields import quantity_of
from stiffmap.experiment.files.schema import ExperimentFile
from stiffmap.experiment.files.table import Table

ANGLES = {a: float(PLANE_ANGLES[a]) for a in ("rad", "mrad", "deg")}

TIMES = {"hours": ("h", "hour", "hours"), "temperature": ("°c", "degc", "c")}


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
    commands: dict[str, str]
    """Quantity of columns of joints, whose names the file chooses."""

    @staticmethod
    def of(model: ExperimentFile, file: str) -> Scales:
        """Factors of a file."""
        units = model.units
        angle = None if units.angle is None else ANGLES[units.angle]
        force = None if units.force is None else float(FORCES[units.force])
        own = {name: factor(unit) for name, unit in units.own().items()}
        seconds = {f"{name}2": c.unit for name, c in model.command.items()}
        joints = seconds | {name: c.unit for name, c in (model.joints | model.command).items()}
        own |= {name: factor(unit) for name, unit in joints.items()}
        quantities = {name: "angle" if unit in ANGLES else "length" for name, unit in joints.items()}
        return Scales(factor(units.length), force, angle, own, file, quantities)

    def of_header(self, table: Table, whole: Collection[str] = ()) -> Table:
        """The table with the bare names of columns such as ``x [mm]``, whose numbers are then in the file's units; where the
        file declares none, that of the header holds. Names in `whole` are no such columns. Raises `FileError`."""
        split = [(h, "") if h in whole else name_and_unit(h) for h in table.header]
        names = tuple(name for name, _ in split)
        refuse_twice(names, table.file, 1)
        factors = {name: self._factor(name, unit, table) for name, unit in split if unit}
        return replace(table, header=names, factors=factors)

    def _factor(self, column: str, text: str, table: Table) -> float:
        """Unit of a column over the one that its numbers are taken to be in."""
        base = column.removeprefix("u_").removesuffix("_cmd")
        if text.lower() in TIMES.get(base, ()):
            return 1.0
        if base not in (*known_columns(), *self.commands):
            return 1.0  # refused by its name later
        quantity = self.commands.get(base) or quantity_of(base)
        unit = unit_of(text, quantity) if quantity else None
        if quantity is None or unit is None or unit.mass or base in TIMES:
            expected = TIMES[base][0] if base in TIMES else known(quantity) if quantity else "none"
            table.fail(f"unit of column '{column}': expected {expected}; found '{text}'")
        moment = None if self.force is None else self.force * self.length
        common = {"length": self.length, "angle": self.radian, "force": self.force, "moment": moment}
        return unit.size / self.own.setdefault(base, common[quantity] or unit.size)

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
