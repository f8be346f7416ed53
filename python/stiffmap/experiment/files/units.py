"""Units of an experiment file to SI; a unit that is needed and not declared is an error."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from stiffmap.common.errors import FileError
from stiffmap.common.units import (
    FORCES,
    LENGTHS,
    MOMENTS,
    PLANE_ANGLES,
    known,
    name_and_unit,
    quantity_of,
    size_of,
    unit_of,
)
from stiffmap.experiment.experiment import WRENCH, Channel, Floats
from stiffmap.experiment.files.schema import ExperimentFile
from stiffmap.experiment.files.table import Table
from stiffmap.experiment.readings import kinds

ANGLES = {a: float(PLANE_ANGLES[a]) for a in ("rad", "mrad", "deg")}

PLAIN = ("id", "branch", "setup", "point", "load_point", "instrument", "target", "approach_", "pq", "repeat", "order",
         "hours", "temperature")  # fmt: skip
"""Beginnings of columns of words and plain numbers."""
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
    quantities: dict[str, str]
    """Of columns whose name does not say it."""

    @staticmethod
    def of(model: ExperimentFile, file: str) -> Scales:
        """Factors of a file."""
        units = model.units
        angle = None if units.angle is None else ANGLES[units.angle]
        force = None if units.force is None else float(FORCES[units.force])
        own = {name: factor(unit) for name, unit in units.own().items()}
        own |= {name: factor(c.unit) for name, c in model.joints.items()}
        own |= {name: factor(c.unit) for name, c in model.command.items()}
        turning = {n: c.unit in ANGLES for n, c in model.joints.items()}
        turning |= {n: c.unit in ANGLES for n, c in model.command.items()}
        turning |= {n: k.channel.unit == "rad" for k in kinds() for n in (k.name, k.absolute) if n}
        quantities = {n: "angle" if turns else "length" for n, turns in turning.items()}
        return Scales(factor(units.length), force, angle, own, file, quantities)

    def of_header(self, table: Table, whole: Collection[str] = ()) -> Table:
        """The table with the bare names of columns such as ``x [mm]``, whose numbers are then in the file's units; where the
        file declares none, that of the header holds. Names in `whole` are no such columns. Raises `FileError`."""
        split = [(h, "") if h in whole else name_and_unit(h) for h in table.header]
        names = tuple(name for name, _ in split)
        twice = next((n for n in names if names.count(n) > 1), None)
        if twice:
            raise FileError(f"column '{twice}' occurs twice", file=table.file, line=1)
        factors = {name: self._factor(name, unit, table) for name, unit in split if unit}
        return replace(table, header=names, factors=factors)

    def _factor(self, column: str, text: str, table: Table) -> float:
        """Unit of a column over the one that its numbers are taken to be in."""
        base = column.removeprefix("u_").removesuffix("_cmd")
        quantity = self.quantities.get(base) or ("" if base.startswith(PLAIN) else quantity_of(base))
        unit = unit_of(text, quantity) if quantity else None
        if base in TIMES and text.lower() in TIMES[base]:
            return 1.0
        if unit is None or unit.mass:
            expected = known(quantity) if quantity else TIMES.get(base, ("none",))[0]
            raise FileError(
                f"unit of column '{column}': expected {expected}; found '{text}'", file=table.file, line=1
            )
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
