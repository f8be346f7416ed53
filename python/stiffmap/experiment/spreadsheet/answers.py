"""What a person says of a sheet, and the sheet with everything that was made of it until it is understood."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from stiffmap.common.broadcasting import Floats
from stiffmap.common.tables.sheet import Sheet
from stiffmap.common.units import Unit


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

    sheet: Sheet = field(kw_only=True)
    said: list[str] = field(default_factory=list)
    """What the reader must know, in words."""
    head: dict[str, Any] = field(default_factory=dict)
    """Further keys of experiment.yaml."""
    columns: dict[str, tuple[str, str]] = field(default_factory=dict)
    """Of commanded joints: column of data.csv -> full name of the drive, unit."""
    placed: bool = False
    """Whether an instrument read, with commanded joints, places or lengths in coordinates of its own."""
    spent: dict[str, float] = field(default_factory=dict)
    """Numbers of --set of which columns were made."""
    answered: bool = False
    """Whether a person has answered a question."""

    @staticmethod
    def of_sheet(sheet: Sheet, answers: Answers) -> Meant:
        """A sheet as it was read, with what is said of it."""
        chosen = {k: list(v) for k, v in answers.chosen.items()}
        a = answers
        return Meant(chosen, dict(a.units), dict(a.constants), dict(a.noise), sheet=sheet)

    def spend(self, name: str) -> float:
        """A number of --set that is in a column from now on; 0 where there is none."""
        if name in self.constants:
            self.spent[name] = self.constants.pop(name)
        return self.spent.get(name, 0.0)

    def to_remember(self, sheet: Sheet, given: Answers) -> Answers:
        """The answers without columns that were made, which the next sheet of this form has not got, but as `given`."""
        there = {*sheet.header, *(f"{sign}{h}" for h in sheet.header for sign in "+-")}
        own = {k: v for k, v in self.chosen.items() if set(v) <= there}
        return Answers(own | given.chosen, self.units, self.spent | self.constants, self.noise)

    def add(self, name: str, values: ArrayLike, meaning: str) -> None:
        """A column more, the only one of its meaning."""
        if name not in self.sheet.header:
            self.sheet = self.sheet.with_column(name, values)
        self.chosen[meaning] = [name]

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
