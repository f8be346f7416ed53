"""A sheet of a workbook that fits, and everything that the user says of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path

from stiffmap.common.errors import StiffmapError
from stiffmap.common.tables.lines import EXCEL
from stiffmap.common.tables.sheet import Layout, Sheet, read_sheet
from stiffmap.common.tables.workbook import sheet_names
from stiffmap.experiment.spreadsheet.convert import Imported
from stiffmap.experiment.spreadsheet.dialogue import (
    Answers,
    Ask,
    Unanswered,
    ask_all,
    asked,
    profile_file,
    remember,
    remembered,
)
from stiffmap.experiment.spreadsheet.guess import guess, has_meaning
from stiffmap.experiment.spreadsheet.instrument import Instrument, as_readings
from stiffmap.experiment.spreadsheet.joints import Commanded, as_seen, commanded, turned
from stiffmap.experiment.spreadsheet.sockets import seated
from stiffmap.experiment.spreadsheet.together import Meant, oriented, together


@dataclass(frozen=True)
class Reading:
    """How a sheet is read: what wrote it, drives that it may command (name -> slides), sign of its differences."""

    wrote: Instrument | None
    drives: Mapping[str, bool]
    difference: str
    deflection: bool = True
    """Loaded less unloaded: rows need a load."""
    layout: Layout = field(default_factory=lambda: Layout(has_meaning))


def read_and_ask(
    file: Path, sheet: str | None, how: Reading, given: Answers, ask: Ask | None
) -> tuple[Sheet, Imported, Answers, list[str], Commanded | None]:
    """The sheet that fits, what was understood of it, the answers in use, what the user should know of them, and the joints
    that the sheet commands."""

    def one(
        name: str | None, ask: Ask | None
    ) -> tuple[Sheet, Imported, Answers, list[str], Commanded | None]:
        table, answers, told = read_sheet(file, name, how.layout), given, list[str]()
        form = table
        if (kept := remembered(form)) is not None:
            answers = kept.below(given)
            told.append(f"answers of an earlier sheet of this form are used: {profile_file(form)}")
        meant = together(table, answers.chosen, answers.units, how.deflection)
        table, told = meant.sheet, told + meant.said
        answers = replace(answers, chosen=meant.chosen, units=meant.units)
        joints = commanded(table, how.drives, answers.chosen, answers.units)
        before = whole = answers
        if joints is not None:
            (placed, answers), whole = asked(table, whole, ask, partial(seated, joints))
            joints = as_seen(placed, answers.units, how.difference)
            table, answers = joints.sheet, replace(answers, chosen=joints.chosen)
            told += joints.told
        elif how.wrote is not None:
            table, mapped, assumed, constants = as_readings(
                table, how.wrote, answers.constants, answers.chosen
            )
            answers = replace(
                answers, chosen=mapped | answers.chosen, units=assumed | answers.units, constants=constants
            )
        if joints is None or not joints.head:
            table, other = turned(table, guess(table.header, answers.chosen), how.difference)
            answers = replace(answers, chosen=answers.chosen | other)
        commands = [c for m in joints.columns for c in joints.chosen[m]] if joints else []
        beside = Meant(table, dict(answers.chosen), dict(answers.units))
        oriented(beside, commands, answers.noise)
        answers = replace(answers, chosen=beside.chosen, units=beside.units)
        loaded = how.deflection and not (joints and joints.head)
        try:
            table, found, final = ask_all(table, answers, ask, joints, beside.head, loaded)
        except Unanswered as left:
            said = left.answers.of(form, replace(given, constants=whole.constants))
            if said != given:
                raise StiffmapError(
                    f"{left}; the answers so far are remembered: {remember(form, said)}"
                ) from None
            raise
        if ask is not None and (final != answers or whole is not before):
            said = final.of(form, replace(given, constants=whole.constants))
            told.append(f"the answers are remembered for sheets of this form: {remember(form, said)}")
        return table, found, final, [*told, *beside.said, *found.said], joints

    names = sheet_names(file) if sheet is None and file.suffix.lower() in EXCEL else [sheet]
    if len(names) == 1:
        return one(sheet, ask)
    reasons = {}
    for name in names:
        try:
            return one(name, None)
        except StiffmapError as problem:
            reasons[str(name)] = problem
    tables = [n for n, p in reasons.items() if type(p).__name__ == "Question"]
    if ask is not None and tables:
        return one(tables[0], ask)
    lines = "; ".join(f"'{n}': {str(p).removeprefix(str(file)).lstrip(':, ')}" for n, p in reasons.items())
    raise StiffmapError(f"{file}: none of its {len(names)} sheets fits (--sheet NAME reads one). {lines}")
