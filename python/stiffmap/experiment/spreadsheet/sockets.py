"""A ball in sockets, or a probe on a datum sphere: nothing is measured, but where the point then is, in an unknown frame."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np

from stiffmap.common.errors import FileError
from stiffmap.common.tables.cells import Cells
from stiffmap.common.tables.sheet import Sheet
from stiffmap.experiment.spreadsheet.convert import Question
from stiffmap.experiment.spreadsheet.dialogue import Answers
from stiffmap.experiment.spreadsheet.guess import READINGS, SEEN, Column, guess
from stiffmap.experiment.spreadsheet.instrument import with_column
from stiffmap.experiment.spreadsheet.joints import Commanded

SOCKET = r"(ball[ _-]?)?(socket|seat|nest|cup|datum|pfanne|kugelpfanne|sphere|ball|kugel)[ _.-]?(id|name|no\.?|nr\.?|number|nummer)?"
PLACE = r"position|pos\.?|place|location|station|ort|stelle|platz"
BALL = "the one ball"


def seated(c: Commanded, a: Answers) -> tuple[Commanded, Answers]:
    """The table with columns ``px py pz`` of where the point stood, one target, and a set-up for each place; as it is where something
    was read.

    The point stood where ``--set px=0`` and so on say, or in sockets, in a line ``--set socket=`` mm apart. Raises Question where nobody
    says how far, and FileError for a row without a socket.
    """
    columns, sheet, constants = guess(c.sheet.header, c.chosen), c.sheet, dict(a.constants)
    fixed, socket = all(s in constants for s in SEEN), _named(columns, SOCKET)
    if any(k.meaning in READINGS for k in columns) or not (fixed or socket):
        return c, a
    where = [np.full(len(sheet.lines), constants.pop(s)) for s in SEEN] if fixed else []
    number, names = _sockets(sheet, socket) if socket and not fixed else (np.zeros(0, np.intp), [""])
    places = "one place" if len(names) == 1 else f"{len(names)} places"
    told = f"nothing was measured: the point stood in {places} of an unknown frame"
    if socket and not fixed:
        apart = constants.pop("socket", 0.0)
        if len(names) > 1 and not apart:
            raise Question(
                f"{sheet.file}: how far is it from one '{socket.name}' to the next ({', '.join(names)})? Say --set socket=NUMBER (mm) "
                "where they stand in a line, or give columns px, py, pz with the place of each row's",
                "column",
                "socket",
            )
        where = [apart * number, 0.0 * number, 0.0 * number]
        told += f": '{socket.name}' {', '.join(names)}" + (f", {apart:g} mm apart" if apart else "")
    for s, values in zip(SEEN, where, strict=True):
        sheet = with_column(sheet, f"{s} [mm]", [float(v) for v in values])
    ball = Cells.of([BALL] * len(sheet.lines))
    sheet = replace(sheet, header=(*sheet.header, BALL), columns=(*sheet.columns, ball))
    chosen = {"target": [BALL]} | c.chosen | {s: [f"{s} [mm]"] for s in SEEN}
    place = _named(columns, PLACE)
    if place and "setup" not in {k.meaning for k in columns}:
        chosen["setup"] = [sheet.header[place.index]]
        told += f"; a frame for each '{place.name}'"
    return replace(c, sheet=sheet, chosen=chosen, told=(*c.told, told)), replace(a, constants=constants)


def _named(columns: list[Column], pattern: str) -> Column | None:
    """The first column that is nothing else and has such a name."""
    return next((k for k in columns if k.meaning == "note" and re.fullmatch(pattern, k.name, re.I)), None)


def _sockets(sheet: Sheet, socket: Column) -> tuple[np.ndarray[tuple[int], np.dtype[np.intp]], list[str]]:
    """(n,) number of each row's socket, from 0, and their names."""
    cells = [cell.strip() for cell in sheet.columns[socket.index]]
    if "" in cells:
        message = f"column '{socket.name}': expected the name or number of a socket; found an empty cell"
        raise FileError(message, file=sheet.file, line=sheet.lines[cells.index("")])
    names = sorted(set(cells), key=lambda name: (len(name), name))
    return np.array([names.index(cell) for cell in cells]), names
