"""Questions about a sheet, and answers that are remembered for the next sheet of the same form."""

from __future__ import annotations

import os
import re
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any, TypeVar

from stiffmap.common.errors import FileError, StiffmapError
from stiffmap.common.fingerprints import digest
from stiffmap.common.number_text import number_in
from stiffmap.common.outputs import make_folder, write_text
from stiffmap.common.tables.table import Table, column_letter
from stiffmap.common.units import known, unit_of
from stiffmap.common.yaml_text import read, text_of
from stiffmap.experiment.experiment import WRENCH
from stiffmap.experiment.files.fields import READ, quantity_of
from stiffmap.experiment.spreadsheet.answers import Answers, Meant, Question
from stiffmap.experiment.spreadsheet.convert import ImportedSheet, understand
from stiffmap.experiment.spreadsheet.guess import READINGS
from stiffmap.experiment.spreadsheet.together import together

Ask = Callable[[str], str]
Made = TypeVar("Made")
KEPT: dict[str, Callable[[Any], Any]] = {
    "map": lambda v: list(map(str, v)),
    "unit": str,
    "set": float,
    "noise": float,
}
"""Keys of a file of answers, in the order of `Answers`, and what their values are."""
MOST = 30
"""Questions about one sheet."""
ASKED = {
    "reading": (READINGS, "Which reading, and in which column? For example dx=A; repeats: dx=B,C"),
    "load": (
        WRENCH,
        "Which column is the load, and along which axis? For example fx=A, fz=-A against the axis, or fx=100 N in all rows",
    ),
}
"""Questions whose answer says what a column means, and what it may mean."""
APART = "socket"
"""What is asked as a number alone."""
PLACE = "Which column is the position {}? A letter, or a number in mm that holds in all rows"


class Unanswered(StiffmapError):
    """Nobody answers a question."""


def profile_file(sheet: Table) -> Path:
    """Where the answers for sheets of this form are kept: in the user's configuration folder, by the header."""
    home = os.environ.get("XDG_CONFIG_HOME") or Path.home() / ".config"
    form = digest([re.sub(r"\s+", " ", h.strip().lower()) for h in sheet.header])[:16]
    return Path(home) / "stiffmap" / "sheets" / f"{form}.yaml"


def remembered(sheet: Table) -> Answers | None:
    """Answers for an earlier sheet of this form; None where there are none. FileError for a damaged file."""
    file = profile_file(sheet)
    if not file.is_file():
        return None
    data = read(file).data
    try:
        return Answers(*({k: of(v) for k, v in data.get(key, {}).items()} for key, of in KEPT.items()))
    except (AttributeError, TypeError, ValueError):
        raise FileError(
            "expected the mappings map, unit, set and noise; delete the file", file=str(file)
        ) from None


def remember(sheet: Table, a: Answers) -> Path:
    """Keep answers; returns the file. Raises FileError."""
    file = profile_file(sheet)
    make_folder(file.parent)
    write_text(file, text_of({key: v for key, v in zip(KEPT, vars(a).values(), strict=False) if v}))
    return file


def ask_all(m: Meant, ask: Ask | None, loaded: bool = False) -> ImportedSheet:
    """What is understood of the sheet with the answers to every question that it leaves, which `m` gathers, and with columns of
    the other sign where an answer wants them; raises StiffmapError."""

    def understood() -> ImportedSheet:
        signed = Meant.of_sheet(m.sheet, m)
        together(signed, False)
        m.sheet, m.chosen = signed.sheet, signed.chosen
        return understand(m, loaded)

    found = asked(m, ask, understood)
    read = dict.fromkeys(READ.get(r, r) for r in READINGS if r in found.units)
    if ask is not None and found.rows.repeats < 2:
        for r in (r for r in read if r not in m.noise):
            said = ask(
                f"One standard deviation of a reading of {r}, in its unit? Empty: repeats show it"
            ).strip()
            if said:
                _keep_number(m.noise, r, said)
                m.answered = True
    return found


def asked(m: Meant, ask: Ask | None, step: Callable[[], Made]) -> Made:
    """What a step gives with the answers to every question that it leaves, which `m` gathers; raises StiffmapError."""
    for _ in range(MOST):
        try:
            return step()
        except Question as question:
            if ask is None:
                question.waits = True
                raise
            try:
                _answer(m, question, ask)
            except StiffmapError as nobody:
                raise Unanswered(str(nobody)) from None
            m.answered = True
    raise StiffmapError(f"{m.sheet.file}: the sheet is not understood after {MOST} answers")


def _answer(m: Meant, question: Question, ask: Ask) -> None:
    """Ask, and keep the answer; after one that is none the same question comes again."""
    meaning = question.meaning
    if question.kind == "unit":
        quantity = quantity_of(meaning) or "length"
        header = f"'{m.chosen[meaning][0]}'" if meaning in m.chosen else meaning
        unit = ask(f"Unit of {header} ({known(quantity)})?").strip()
        if unit_of(unit, quantity) is not None:
            m.units[meaning] = unit
        return
    if meaning == APART:
        _keep_number(m.constants, meaning, ask("How far is it from one socket to the next, in mm?"))
        return
    allowed, wanted = ASKED.get(meaning, ((), PLACE))
    columns = "\n".join(f"  {column_letter(i)}  {h}" for i, h in enumerate(m.sheet.header))
    said = ask(f"{columns}\n{wanted.format(meaning)}").strip()
    if allowed:
        meaning, _, said = (part.strip() for part in said.partition("="))
        meaning = meaning.lower()
        if meaning not in allowed:
            return
    load = meaning in WRENCH
    sign = said[:1] if load and said[:1] in ("+", "-") else ""
    wanted_columns = said.split(",") if meaning in READINGS else [said.removeprefix(sign)]
    found = [_column(m.sheet, w) for w in wanted_columns]
    if None not in found:
        m.chosen[meaning] = [f"{sign}{header}" for header in found]
    elif meaning not in READINGS:
        _keep_number(m.constants, meaning, said.lower().removesuffix("n").strip() if load else said)


def _keep_number(where: dict[str, float], name: str, said: str) -> None:
    with suppress(ValueError):
        where[name] = number_in(said.replace(",", "."))


def _column(sheet: Table, said: str) -> str | None:
    """The header of a column that is named by its letter or by its header."""
    word = said.strip()
    letters = {column_letter(i): h for i, h in enumerate(sheet.header)}
    return letters.get(word.upper()) or next(
        (h for h in sheet.header if h.lower() == word.lower() and word), None
    )
