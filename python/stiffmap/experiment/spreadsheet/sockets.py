"""A ball put into sockets, or a probe on a datum sphere: nothing is measured, but where the point then is, in an unknown frame."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np

from stiffmap.common.errors import FileError
from stiffmap.common.number_text import number_in
from stiffmap.common.tables.cells import Cells
from stiffmap.common.tables.header import split_unit
from stiffmap.common.tables.sheet import Sheet, number
from stiffmap.experiment.spreadsheet.convert import Question
from stiffmap.experiment.spreadsheet.dialogue import Answers, Ask
from stiffmap.experiment.spreadsheet.guess import READINGS, SEEN, guess
from stiffmap.experiment.spreadsheet.instrument import with_column
from stiffmap.experiment.spreadsheet.joints import Commanded

SOCKET = re.compile(
    r"(ball[ _-]?)?(socket|seat|nest|cup|datum|pfanne|kugelpfanne|sphere|ball|kugel)[ _.-]?(id|name|no\.?|nr\.?|number|nummer)?",
    re.IGNORECASE,
)
PLACE = re.compile(r"position|pos\.?|place|location|station|ort|stelle|platz", re.IGNORECASE)
BALL = "the one ball"


def seated(c: Commanded, a: Answers, ask: Ask | None) -> tuple[Commanded, Answers]:
    """The table with columns ``px py pz`` of where the point stood, one target and, of a column of places, set-ups; as it is where
    something was read.

    The places are those of a column of sockets, in a line, ``--set socket=`` mm apart; or ``--set px=0`` and so on in all rows.
    Raises Question where nobody says how far apart, and FileError for a row without a socket.
    """
    sheet, chosen, constants = c.sheet, dict(c.chosen), dict(a.constants)
    columns = guess(sheet.header, chosen)
    at = next((k.index for k in columns if k.meaning == "note" and SOCKET.fullmatch(k.name)), None)
    fixed = all(s in constants for s in SEEN)
    if any(k.meaning in READINGS for k in columns) or (at is None and not fixed):
        return c, a
    told = "nothing was measured: the point stood at (0, 0, 0) mm of an unknown frame"
    if fixed:
        along = [np.full(len(sheet.lines), constants.pop(s)) for s in SEEN]
        told = "nothing was measured: the point stood where --set px, py, pz say, in an unknown frame"
    else:
        assert at is not None
        numbers = _sockets(sheet, at)
        apart = 0.0
        if numbers.any():
            apart = constants.pop("socket") if "socket" in constants else _apart(sheet, at, ask)
            told = f"nothing was measured: sockets stand in a line, {apart:g} mm apart, in an unknown frame"
        along = [apart * numbers, np.zeros(len(numbers)), np.zeros(len(numbers))]
    for s, values in zip(SEEN, along, strict=True):
        sheet = with_column(sheet, f"{s} [mm]", [float(v) for v in values])
        chosen[s] = [f"{s} [mm]"]
    ball = Cells.of(["ball"] * len(sheet.lines))
    sheet = replace(sheet, header=(*sheet.header, BALL), columns=(*sheet.columns, ball))
    chosen.setdefault("target", [BALL])
    place = next((k for k in columns if k.meaning == "note" and PLACE.fullmatch(k.name)), None)
    if place is not None and "setup" not in {k.meaning for k in columns}:
        chosen["setup"] = [sheet.header[place.index]]
        told += f", one for each '{place.name}'"
    return replace(c, sheet=sheet, chosen=chosen, told=(*c.told, told)), replace(a, constants=constants)


def _sockets(sheet: Sheet, at: int) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    """(n,) number of each row's socket, from 0."""
    cells = [cell.strip() for cell in sheet.columns[at]]
    for cell, line in zip(cells, sheet.lines, strict=True):
        if not cell:
            message = (
                f"column '{sheet.header[at]}': expected the name or number of a socket; found an empty cell"
            )
            raise FileError(message, file=sheet.file, line=line)
    found = {cell: number(cell, sheet.decimal_comma) for cell in cells}
    values = [v for v in found.values() if v is not None]
    if len(values) < len(found):
        found = {cell: float(k) for k, cell in enumerate(sorted(found))}
        values = [0.0]
    return np.array([found[cell] for cell in cells], dtype=float) - min(values)


def _apart(sheet: Sheet, at: int, ask: Ask | None) -> float:
    """mm from one socket to the next."""
    name = split_unit(sheet.header[at])[0]
    if ask is not None:
        try:
            return number_in(
                ask(f"How far is it from one '{name}' to the next, in a line, mm?").strip().replace(",", ".")
            )
        except ValueError:
            pass
    raise Question(
        f"{sheet.file}: how far is it from one '{name}' to the next? Say --set socket=NUMBER (mm) where they stand in a line, or "
        "give columns px, py, pz with the place of each row's socket",
        "column",
        "socket",
    )
