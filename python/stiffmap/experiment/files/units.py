"""Units of an experiment file to SI; a unit that is needed and not declared is an error."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

from stiffmap.common.errors import FileError
from stiffmap.common.tables.header import refuse_twice, split_unit
from stiffmap.common.tables.table import Table
from stiffmap.common.units import known, name_and_unit, size_of, unit_of
from stiffmap.experiment.files.fields import base_of, quantity_of
from stiffmap.experiment.files.fields import known as known_columns
from stiffmap.experiment.files.schema import ExperimentFile

COMMON = ("length", "force", "angle")
"""Quantities whose columns have one unit, where a column has none of its own."""
ANGLES = ("rad", "mrad", "deg")
TIMES = {"hours": ("h", "hour", "hours"), "temperature": ("°c", "degc", "c")}


class Units:
    """SI sizes of the units that a file declares, of all columns of a quantity or of single ones."""

    def __init__(self, model: ExperimentFile, file: str) -> None:
        self.file = file
        given = model.units.model_dump(exclude_none=True, exclude={"temperature"})
        self.common = {name: size_of(given.pop(name)) for name in COMMON if name in given}
        if "force" in self.common:
            self.common["moment"] = self.common["force"] * self.common["length"]
        joints = {f"{name}2": c.unit for name, c in model.command.items()}
        joints |= {name: c.unit for name, c in (model.joints | model.command).items()}
        self.own = {name: size_of(u) for name, u in (given | joints).items()}
        self.joints = {name: "angle" if unit in ANGLES else "length" for name, unit in joints.items()}
        self.columns = {*known_columns(), *self.joints}

    def of_header(self, table: Table, whole: Collection[str] = ()) -> Table:
        """The table with the bare names of columns such as ``x [mm]``, ``x_mm`` and ``X`` and the SI sizes of their units: those of
        the header, else those of the file. Names in `whole` are bare. Raises `FileError`."""
        split = [(h, "") if h in whole else self._split(h) for h in table.header]
        names = tuple(name for name, _ in split)
        refuse_twice(names, table.file, 1)
        of_header = {name: self._written(name, unit, table) for name, unit in split if unit}
        return replace(table, header=names, sizes={n: self.size(n) for n in names} | of_header)

    def size(self, column: str, default: float | None = None) -> float:
        """SI size of the unit of a column, its standard deviation or its command, as the file declares it; `default`, or
        `FileError`, where it declares none."""
        base = base_of(column)
        quantity = self.joints.get(base) or quantity_of(base)
        if base in self.own:
            return self.own[base]
        return 1.0 if quantity in (None, "temperature") else self.of(quantity, column, default)

    def of(self, quantity: str, column: str, default: float | None = None) -> float:
        """The same of all columns of a quantity."""
        size = self.common.get(quantity, default)
        if size is None:
            lost = "force" if quantity == "moment" else quantity
            raise FileError(
                f"units: the unit '{lost}' is not declared (column '{column}' needs it)", file=self.file
            )
        return size

    def _split(self, header: str) -> tuple[str, str]:
        """Name and unit: in the first way of writing that makes it a known column."""
        ways = (name_and_unit(header), split_unit(header))
        each = ((name, unit) for text, unit in ways for name in (text, text.lower()))
        return next((way for way in each if base_of(way[0]) in self.columns), ways[0])

    def _written(self, column: str, text: str, table: Table) -> float:
        """SI size of the unit in a header; where the file declares none, it is that of the column's noise as well."""
        base = base_of(column)
        if text.lower() in TIMES.get(base, ()) or base not in self.columns:
            return 1.0  # what is not known is refused by its name later
        quantity = self.joints.get(base) or quantity_of(base)
        unit = unit_of(text, quantity) if quantity else None
        if quantity is None or unit is None or unit.mass or base in TIMES:
            expected = TIMES[base][0] if base in TIMES else known(quantity) if quantity else "none"
            table.fail(f"unit of column '{column}': expected {expected}; found '{text}'")
        self.own.setdefault(base, self.common.get(quantity, unit.size))
        return unit.size
