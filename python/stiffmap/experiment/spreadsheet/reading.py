"""A sheet of a workbook that fits, and everything that the user says of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

from stiffmap.common.errors import StiffmapError
from stiffmap.common.tables.lines import EXCEL
from stiffmap.common.tables.sheet import Layout, read_sheet
from stiffmap.common.tables.workbook import sheet_names
from stiffmap.experiment.spreadsheet.answers import Answers, Meant
from stiffmap.experiment.spreadsheet.convert import Imported, Question
from stiffmap.experiment.spreadsheet.dialogue import (
    Ask,
    Unanswered,
    ask_all,
    asked,
    profile_file,
    remember,
    remembered,
)
from stiffmap.experiment.spreadsheet.guess import has_meaning
from stiffmap.experiment.spreadsheet.instrument import Instrument, as_readings
from stiffmap.experiment.spreadsheet.joints import as_seen, commanded, turned
from stiffmap.experiment.spreadsheet.sockets import seated
from stiffmap.experiment.spreadsheet.together import oriented, together


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
) -> tuple[Meant, Imported]:
    """The sheet that fits with the answers in use, and what was understood of it."""
    names = sheet_names(file) if sheet is None and file.suffix.lower() in EXCEL else [sheet]
    if len(names) == 1:
        return _one(file, sheet, how, given, ask)
    reasons: dict[str, StiffmapError] = {}
    for name in names:
        try:
            return _one(file, name, how, given, None)
        except StiffmapError as problem:
            reasons[str(name)] = problem
    tables = [n for n, p in reasons.items() if type(p) is Question]
    if ask is not None and tables:
        return _one(file, tables[0], how, given, ask)
    lines = "; ".join(f"'{n}': {str(p).removeprefix(str(file)).lstrip(':, ')}" for n, p in reasons.items())
    raise StiffmapError(f"{file}: none of its {len(names)} sheets fits (--sheet NAME reads one). {lines}")


def _one(
    file: Path, name: str | None, how: Reading, given: Answers, ask: Ask | None
) -> tuple[Meant, Imported]:
    form = read_sheet(file, name, how.layout)
    kept = remembered(form)
    m = Meant.of_sheet(form, given if kept is None else kept.below(given))
    if kept is not None:
        m.said.append(f"answers of an earlier sheet of this form are used: {profile_file(form)}")
    together(m, how.deflection)
    commanded(m, how.drives)
    if m.columns:
        asked(m, ask, partial(seated, m))
        as_seen(m, how.difference)
    elif how.wrote is not None:
        as_readings(m, how.wrote)
    if not m.placed:
        turned(m, how.difference)
    oriented(m)
    try:
        found = ask_all(m, ask, how.deflection and not m.placed)
    except Unanswered as left:
        said = m.to_remember(form, given)
        if said == given:
            raise
        raise StiffmapError(f"{left}; the answers so far are remembered: {remember(form, said)}") from None
    if m.answered:
        kept_in = remember(form, m.to_remember(form, given))
        m.said.append(f"the answers are remembered for sheets of this form: {kept_in}")
    m.said += found.said
    return m, found
