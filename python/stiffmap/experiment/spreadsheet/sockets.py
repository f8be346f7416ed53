"""A ball in sockets, or a probe on a datum sphere: nothing is measured, but where the point then is, in an unknown frame."""

from __future__ import annotations

import re

import numpy as np

from stiffmap.common.tables.table import Table
from stiffmap.experiment.files.fields import SEEN
from stiffmap.experiment.spreadsheet.answers import Meant, Question
from stiffmap.experiment.spreadsheet.guess import READINGS, Column

SOCKET = r"(ball[ _-]?)?(socket|seat|nest|cup|datum|pfanne|kugelpfanne|sphere|ball|kugel)[ _.-]?(id|name|no\.?|nr\.?|number|nummer)?"
PLACE = r"position|pos\.?|place|location|station|ort|stelle|platz"
BALL = "the one ball"


def seated(m: Meant) -> None:
    """Columns ``px py pz`` of where the point stood, one target, and a set-up for each place; nothing where something was read.

    The point stood where ``--set px=0`` and so on say, or in sockets, in a line ``--set socket=`` mm apart. Raises Question where nobody
    says how far, and FileError for a row without a socket.
    """
    columns = m.guessed
    fixed, socket = all(s in m.constants for s in SEEN), _named(columns, SOCKET)
    if any(k.meaning in READINGS for k in columns) or not (fixed or socket):
        return
    count = len(m.sheet.lines)
    where = [np.full(count, m.spend(s)) for s in SEEN] if fixed else []
    number, names = _sockets(m.sheet, socket) if socket and not fixed else (np.zeros(0, np.intp), [""])
    places = "one place" if len(names) == 1 else f"{len(names)} places"
    told = f"nothing was measured: the point stood in {places} of an unknown frame"
    if socket and not fixed:
        apart = m.spend("socket")
        if len(names) > 1 and not apart:
            raise Question(
                f"{m.sheet.file}: how far is it from one '{socket.name}' to the next ({', '.join(names)})? Say --set socket=NUMBER (mm) "
                "where they stand in a line, or give columns px, py, pz with the place of each row's",
                "column",
                "socket",
            )
        where = [apart * number, 0.0 * number, 0.0 * number]
        told += f": '{socket.name}' {', '.join(names)}" + (f", {apart:g} mm apart" if apart else "")
    for s, values in zip(SEEN, where, strict=True):
        m.sheet = m.sheet.with_column(f"{s} [mm]", values)
    m.sheet = m.sheet.with_cells(BALL, [BALL] * count)
    m.chosen = {"target": [BALL]} | m.chosen | {s: [f"{s} [mm]"] for s in SEEN}
    place = _named(columns, PLACE)
    if place and "setup" not in {k.meaning for k in columns}:
        m.chosen["setup"] = [m.sheet.header[place.index]]
        told += f"; a frame for each '{place.name}'"
    m.said.append(told)


def _named(columns: list[Column], pattern: str) -> Column | None:
    """The first column that is nothing else and has such a name."""
    return next((k for k in columns if k.meaning == "note" and re.fullmatch(pattern, k.name, re.I)), None)


def _sockets(sheet: Table, socket: Column) -> tuple[np.ndarray[tuple[int], np.dtype[np.intp]], list[str]]:
    """(n,) number of each row's socket, from 0, and their names."""
    cells = [cell.strip() for cell in sheet.columns[socket.index]]
    if "" in cells:
        message = f"column '{socket.name}': expected the name or number of a socket; found an empty cell"
        sheet.fail(message, cells.index(""))
    names = sorted(set(cells), key=lambda name: (len(name), name))
    return np.array([names.index(cell) for cell in cells]), names
