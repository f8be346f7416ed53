"""What a person says of a sheet, and the sheet with everything that was made of it until it is understood."""

from __future__ import annotations

from collections.abc import Sequence
from copy import deepcopy
from dataclasses import dataclass, field, fields
from typing import Any, NoReturn

import numpy as np
from numpy.typing import ArrayLike

from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import StiffmapError
from stiffmap.common.tables.header import IN_SI, stated_unit, with_unit
from stiffmap.common.tables.table import Table, column_letter
from stiffmap.common.tables.table_file import find_column
from stiffmap.common.units import QUANTITIES, Unit, known, unit_of
from stiffmap.experiment.files.fields import quantity_of
from stiffmap.experiment.spreadsheet.guess import READINGS, Column, guess

SI = {q: unit for unit, q in QUANTITIES.items()}
USUAL = {"length": "mm", "force": "N", "moment": "N*m", "angle": "deg", "temperature": "degC"}


def _are_radians(angles: Floats) -> bool:
    """Whether angles are no more than a turn in radians, and not whole numbers."""
    return not (np.abs(angles) > 2.0 * np.pi).any() and bool((angles % 1.0 > 0.0).any())


class Question(StiffmapError):
    """What cannot be guessed. `kind`: ``column`` or ``unit``; `meaning`: of which column of an experiment."""

    def __init__(self, message: str, kind: str, meaning: str) -> None:
        super().__init__(message)
        self.kind, self.meaning = kind, meaning
        self.waits = False
        """Whether an answer would be taken: not where a step that nobody asks about raises it."""


@dataclass
class Answers:
    """What --map, --unit, --set and --noise say, or would say."""

    chosen: dict[str, list[str]] = field(default_factory=dict)
    """Meaning -> headers."""
    units: dict[str, str] = field(default_factory=dict)
    constants: dict[str, float] = field(default_factory=dict)
    noise: dict[str, float] = field(default_factory=dict)

    def below(self, other: Answers) -> Answers:
        """These, where `other` says nothing."""
        return Answers(
            {k: v for k, v in self.chosen.items() if k not in other.constants} | other.chosen,
            self.units | other.units,
            {k: v for k, v in self.constants.items() if k not in other.chosen} | other.constants,
            self.noise | other.noise,
        )


@dataclass
class Meant(Answers):
    """A sheet with the columns that were made of others, and what they mean."""

    sheet: Table = field(kw_only=True)
    said: list[str] = field(default_factory=list)
    """What the reader must know, in words."""
    head: dict[str, Any] = field(default_factory=dict)
    """Further keys of experiment.yaml."""
    columns: dict[str, tuple[str, str]] = field(default_factory=dict)
    """Of commanded joints: column of data.csv -> full name of the drive, unit."""
    placed: bool = False
    """Whether an instrument read, with commanded joints, places or lengths in coordinates of its own."""
    unloaded: dict[str, int] = field(default_factory=dict)
    """Reading that is a difference -> the column that was read without the load."""
    spent: dict[str, float] = field(default_factory=dict)
    """Numbers of --set of which columns were made."""
    answered: bool = False
    """Whether a person has answered a question."""

    @staticmethod
    def of_sheet(sheet: Table, answers: Answers) -> Meant:
        """A sheet as it was read, with what is said of it."""
        own = (deepcopy(getattr(answers, f.name)) for f in fields(Answers))
        return Meant(*own, sheet=sheet)

    def spend(self, name: str) -> float:
        """A number of --set that is in a column from now on; 0 where there is none."""
        if name in self.constants:
            self.spent[name] = self.constants.pop(name)
        return self.spent.get(name, 0.0)

    def to_remember(self, sheet: Table, given: Answers) -> Answers:
        """The answers without columns that were made, which the next sheet of this form has not got, but as `given`."""
        there = {*sheet.header, *(f"{sign}{h}" for h in sheet.header for sign in "+-")}
        own = {k: v for k, v in self.chosen.items() if set(v) <= there}
        return Answers(own | given.chosen, self.units | given.units, self.spent | self.constants, self.noise)

    def add(self, name: str, unit: str, values: ArrayLike, meaning: str) -> None:
        """A column more, the only one of its meaning, in a unit that no word about its meaning changes."""
        header = with_unit(name, unit)
        if header not in self.sheet.header:
            self.sheet = self.sheet.with_column(header, values)
        self.chosen[meaning] = [header]
        if unit:
            self.units.pop(meaning, None)

    @property
    def guessed(self) -> list[Column]:
        """All columns with their meanings."""
        return guess(self.sheet.header, self.chosen, self.sheet.file)

    def ask_column(self, message: str, meaning: str) -> NoReturn:
        """Raise Question: which column has a meaning."""
        there = ", ".join(f"'{h}'" for h in self.sheet.header)
        raise Question(f"{self.sheet.file}: {message}; columns: {there}", "column", meaning)

    def index(self, header: str) -> int:
        """Of a column as a person says it; FileError."""
        return find_column(header, self.sheet.header, self.sheet.file)

    def written_unit(self, column: int, *names: str, quantity: str = "") -> str:
        """What --unit says of one of these names, else the header, else the column next to it, else --unit of the quantity, else a
        line above the table."""
        own = next((self.units[n] for n in names if self.units.get(n)), "") or self.sheet.unit(column)
        return own or self._next_to(column) or self.usual_unit(quantity or quantity_of(names[0]) or "length")

    def usual_unit(self, quantity: str) -> str:
        """Of columns that have none: what --unit says of the quantity, else a line above the table."""
        return self.units.get(quantity) or stated_unit(self.sheet.above, quantity)

    def unit(self, column: int, *names: str, quantity: str = "") -> Unit:
        """Of a column, by its names for --unit: the first one is shown, by the last one it is to be said. Raises Question."""
        quantity = quantity or quantity_of(names[0]) or "length"
        text = self.written_unit(column, *names, quantity=quantity)
        if not text and quantity in SI and IN_SI.fullmatch(name := self.sheet.names[column]):
            text, said = SI[quantity], f"'{name}' is in {SI[quantity]}, as such logs are"
            self.said += [said] if said not in self.said else []
        found = unit_of(text, quantity) if text else None
        if found is not None:
            return found
        name, last = self.sheet.names[column], names[-1]
        usual = "um" if last in READINGS and quantity == "length" else USUAL[quantity]
        if quantity == "angle" and _are_radians(self.sheet.numbers(column)):
            usual = "rad"
        way = f"write it in the header, as in '{name} [{usual}]', or say --unit {last}={usual}"
        if not text:
            why = f" has no unit: {way} (--unit {quantity}={usual}: of every {quantity} without one)"
        else:
            another = unit_of(text) is not None or text.strip() == "mN"
            why = f": the unit '{text}' is not {'one of this quantity' if another else 'known'}; those of {quantity} are: {known(quantity)}; {way}"
        raise Question(f"{self.sheet.file}: column '{name}' ({names[0]}){why}", "unit", last)

    def _next_to(self, column: int) -> str:
        """The unit in the cells of the next column, where these mean nothing and hold nothing else."""
        following = self.guessed[column + 1 : column + 2]
        if not following or following[0].meaning != "note":
            return ""
        cells = self.sheet.columns[column + 1]
        if self.sheet.is_numeric(column + 1) or any(cell and unit_of(cell) is None for cell in cells):
            return ""
        units = set(cells) - {""}
        if len(units) > 1:
            raise StiffmapError(
                f"{self.sheet.file}: column '{self.sheet.names[column + 1]}' ({column_letter(column + 1)}): expected one unit in all "
                f"rows; found {', '.join(sorted(units))}"
            )
        return units.pop() if units else ""

    def metres(self, columns: Sequence[int], names: Sequence[str]) -> Floats:
        """(n, columns) lengths, by their names for --unit."""
        sizes = [self.unit(i, name).size for i, name in zip(columns, names, strict=True)]
        return np.column_stack([self.sheet.numbers(i) for i in columns]) * sizes

    def coordinates(self) -> Floats:
        """(n, drives) commanded coordinates, m and rad."""
        out = []
        for meaning, (_, unit) in self.columns.items():
            header = self.chosen[meaning][0]
            out.append(Unit(unit).size * self.sheet.numbers(self.sheet.header.index(header)))
        return np.column_stack(out)

    def middle(self) -> Floats:
        """(drives,) the row that is nearest to the middle of all."""
        at = self.coordinates()
        return np.asarray(at[np.nanargmin(np.linalg.norm(at - np.nanmedian(at, axis=0), axis=1))])
