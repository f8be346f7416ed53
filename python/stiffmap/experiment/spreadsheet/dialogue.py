"""Questions about a sheet, and answers that are remembered for the next sheet of the same form."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, TypeVar

from stiffmap.common.errors import FileError, StiffmapError
from stiffmap.common.fingerprints import digest
from stiffmap.common.number_text import number_in
from stiffmap.common.outputs import make_folder, write_text
from stiffmap.common.tables.sheet import Sheet, column_letter
from stiffmap.common.units import known, quantity_of, unit_of
from stiffmap.common.yaml_text import read, text_of
from stiffmap.experiment.spreadsheet.convert import FORCE, MOMENT, Imported, Question, understand
from stiffmap.experiment.spreadsheet.guess import READINGS, SEEN
from stiffmap.experiment.spreadsheet.joints import Commanded
from stiffmap.experiment.spreadsheet.together import together

Ask = Callable[[str], str]
Made = TypeVar("Made")
MOST = 30
"""Questions about one sheet."""


@dataclass
class Answers:
    """What --map, --unit, --set and --noise say, or would say."""

    chosen: dict[str, list[str]] = field(default_factory=dict)
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

    def of(self, sheet: Sheet, given: Answers) -> Answers:
        """These without columns that were made, which the next sheet of this form has not got, but as `given`."""
        there = {*sheet.header, *(f"{sign}{h}" for h in sheet.header for sign in "+-")}
        own = {k: v for k, v in self.chosen.items() if set(v) <= there}
        return Answers(own | given.chosen, self.units, given.constants | self.constants, self.noise)


class Unanswered(StiffmapError):
    """Nobody answers a question; `answers` are those that were given before."""

    answers = Answers()


def profile_file(sheet: Sheet) -> Path:
    """Where the answers for sheets of this form are kept: in the user's configuration folder, by the header."""
    home = os.environ.get("XDG_CONFIG_HOME") or Path.home() / ".config"
    form = digest([re.sub(r"\s+", " ", h.strip().lower()) for h in sheet.header])[:16]
    return Path(home) / "stiffmap" / "sheets" / f"{form}.yaml"


def remembered(sheet: Sheet) -> Answers | None:
    """Answers for an earlier sheet of this form; None where there are none. FileError for a damaged file."""
    file = profile_file(sheet)
    if not file.is_file():
        return None
    data = read(file).data
    try:
        return Answers(
            {k: [str(h) for h in v] for k, v in data.get("map", {}).items()},
            {k: str(v) for k, v in data.get("unit", {}).items()},
            {k: float(v) for k, v in data.get("set", {}).items()},
            {k: float(v) for k, v in data.get("noise", {}).items()},
        )
    except (AttributeError, TypeError, ValueError):
        raise FileError(
            "expected the mappings map, unit, set and noise; delete the file", file=str(file)
        ) from None


def remember(sheet: Sheet, a: Answers) -> Path:
    """Keep answers; returns the file. Raises FileError."""
    file = profile_file(sheet)
    make_folder(file.parent)
    data: dict[str, Any] = {"map": a.chosen, "unit": a.units, "set": a.constants, "noise": a.noise}
    write_text(file, text_of({k: v for k, v in data.items() if v}))
    return file


def ask_all(
    sheet: Sheet,
    a: Answers,
    ask: Ask | None,
    joints: Commanded | None = None,
    head: Mapping[str, Any] | None = None,
    loaded: bool = False,
) -> tuple[Sheet, Imported, Answers]:
    """The sheet, with columns of the other sign where an answer wants them, understood with the answers to every question that it leaves; raises StiffmapError."""
    commands, further = (joints.columns, joints.head) if joints else ({}, {})
    further = further | dict(head or {})

    def signed(a: Answers) -> tuple[Sheet, Answers, Imported]:
        meant = together(sheet, a.chosen, a.units, False)
        a = replace(a, chosen=meant.chosen)
        found = understand(meant.sheet, a.chosen, a.units, a.constants, commands, further, loaded)
        return meant.sheet, a, found

    (table, a, found), _ = asked(sheet, a, ask, signed)
    read = dict.fromkeys(f"d{m[1]}" if m in SEEN else m for m in READINGS if m in found.units)
    lost = [m for m in read if m not in a.noise]
    if ask is not None and lost and found.repeats < 2:
        a = _noise(lost, a, ask)
    return table, found, a


def asked(
    sheet: Sheet, a: Answers, ask: Ask | None, understood: Callable[[Answers], Made]
) -> tuple[Made, Answers]:
    """What is understood with the answers to every question that this leaves, and those; raises StiffmapError."""
    for _ in range(MOST):
        try:
            return understood(a), a
        except Question as question:
            if ask is None:
                raise
            try:
                a = _answered(sheet, question, a, ask)
            except StiffmapError as nobody:
                left = Unanswered(str(nobody))
                left.answers = a
                raise left from None
    raise StiffmapError(f"{sheet.file}: the sheet is not understood after {MOST} answers")


def _answered(sheet: Sheet, question: Question, a: Answers, ask: Ask) -> Answers:
    if question.kind == "unit":
        quantity = quantity_of(question.meaning)
        header = _header_of(sheet, question.meaning, a)
        unit = ask(f"Unit of {header} ({known(quantity)})?").strip()
        if unit_of(unit, quantity) is None:
            return a  # the same question again
        return Answers(a.chosen, a.units | {question.meaning: unit}, a.constants, a.noise)
    columns = "\n".join(f"  {column_letter(i)}  {h}" for i, h in enumerate(sheet.header))
    if question.meaning == "reading":
        said = ask(
            f"{columns}\nWhich reading, and in which column? For example dx={column_letter(0)}; repeats: dx=B,C"
        )
        meaning, _, where = said.partition("=")
        meaning = meaning.strip().lower()
        found = [_column(sheet, w) for w in where.split(",")]
        if meaning not in READINGS or None in found:
            return a
        return Answers(a.chosen | {meaning: [str(f) for f in found]}, a.units, a.constants, a.noise)
    if question.meaning == "load":
        said = ask(
            f"{columns}\nWhich column is the load, and along which axis? For example fx={column_letter(0)}, fz=-{column_letter(0)} "
            "against the axis, or fx=100 N in all rows"
        )
        meaning, _, where = said.partition("=")
        meaning, sign = meaning.strip().lower(), where.strip()[:1] if where.strip()[:1] in ("+", "-") else ""
        if meaning not in (*FORCE, *MOMENT):
            return a
        column = _column(sheet, where.strip().removeprefix(sign))
        if column is not None:
            return Answers(a.chosen | {meaning: [f"{sign}{column}"]}, a.units, a.constants, a.noise)
        try:
            value = number_in(where.lower().removesuffix("n").strip().replace(",", "."))
        except ValueError:
            return a
        return Answers(a.chosen, a.units, a.constants | {meaning: value}, a.noise)
    apart = question.meaning == "socket"
    said = ask(
        "How far is it from one socket to the next, in mm?"
        if apart
        else f"{columns}\nWhich column is the position {question.meaning}? A letter, or a number in mm that holds in all rows"
    ).strip()
    column = None if apart else _column(sheet, said)
    if column is not None:
        return Answers(a.chosen | {question.meaning: [column]}, a.units, a.constants, a.noise)
    try:
        return Answers(
            a.chosen, a.units, a.constants | {question.meaning: number_in(said.replace(",", "."))}, a.noise
        )
    except ValueError:
        return a


def _header_of(sheet: Sheet, meaning: str, a: Answers) -> str:
    return f"'{a.chosen[meaning][0]}'" if meaning in a.chosen else meaning


def _noise(lost: list[str], a: Answers, ask: Ask) -> Answers:
    noise: Mapping[str, float] = {}
    for m in lost:
        said = ask(f"One standard deviation of a reading of {m}, in its unit? Empty: repeats show it").strip()
        if said:
            try:
                noise = {**noise, m: number_in(said.replace(",", "."))}
            except ValueError:
                continue
    return Answers(a.chosen, a.units, a.constants, {**a.noise, **noise})


def _column(sheet: Sheet, said: str) -> str | None:
    """The header of a column that is named by its letter or by its header."""
    word = said.strip()
    letters = {column_letter(i): h for i, h in enumerate(sheet.header)}
    return letters.get(word.upper()) or next(
        (h for h in sheet.header if h.lower() == word.lower() and word), None
    )
