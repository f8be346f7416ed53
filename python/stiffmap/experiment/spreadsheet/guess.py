"""Which column of a sheet is what, and in which unit."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from stiffmap.common.tables.header import MEASURED, meaning_of, split_unit
from stiffmap.common.tables.table_file import find_column
from stiffmap.common.units import TIMES, unit_of
from stiffmap.experiment.channels import AXES
from stiffmap.experiment.experiment import WRENCH
from stiffmap.experiment.files.fields import APPROACH, SEEN

REPEATED = re.compile(r"^(.*?)[ _.-]*(?:#|run|messung|wdh|rep|repeat)?[ _.-]*(\d+)$", re.IGNORECASE)
TORQUE = re.compile(r"^[tT](?=[ _]?[xyzXYZ]$)")
"""Tx, Ty, Tz of a load cell, where the unit is one of moments or, next to Fx, Fy, Fz, one that nobody knows."""
AXIS = r"(?i)(?:(?<![a-z])|(?<=\b[dp]))[xyz](?![a-z])"
"""In a header."""
MEASURED_AXIS = rf"\*[ ._-]?({MEASURED})|({MEASURED})[ ._-]?\*"
"""A header of a measured coordinate, with a star for its axis."""
READINGS = (*AXES, "dd", "ll", *SEEN)


@dataclass(frozen=True)
class Column:
    """A column of the sheet, as understood."""

    index: int
    name: str
    """As in the sheet, without its unit."""
    unit: str
    """As written in brackets; empty where none is."""
    meaning: str
    """Column of an experiment; ``note`` for what is kept in addition."""
    repeat: int = 0
    """From 1, of repeats side by side; 0: none."""


def guess(headers: Sequence[str], chosen: Mapping[str, Sequence[str]], file: str = "") -> list[Column]:
    """Meaning of every column; ``chosen`` (meaning -> headers) goes before any guess.

    Several headers of one meaning are repeats side by side, in that order. Raises FileError, which
    names the file, for a chosen header that is not there.
    """
    given = {
        find_column(h, headers, file): (meaning, i)
        for meaning, many in chosen.items()
        for i, h in enumerate(many, 1)
    }
    out = []
    names = [split_unit(h)[0].lower() for h in headers]
    sets = {meaning[:-1]: names[i] for i, (meaning, _) in given.items() if re.search(AXIS, names[i])}
    cell = {"fx", "fy", "fz"} <= {meaning_of(split_unit(h)[0]) for h in headers}
    for index, header in enumerate(headers):
        name, unit = split_unit(header)
        if index in given:
            meaning, repeat = given[index]
            out.append(Column(index, name, unit, meaning, repeat if len(chosen[meaning]) > 1 else 0))
        else:
            time = unit in (*TIMES, "ms", "h") or (name == "t" and not unit)  # T is a temperature
            torque = unit_of(unit, "moment") or (cell and not unit_of(unit))
            plain = TORQUE.sub("m", name) if torque else name
            meaning, repeat = ("note", 0) if time else _meaning(plain)
            place = unit and meaning in APPROACH  # a point from which it came, no direction
            own = re.sub(AXIS, meaning[-1], sets.get(meaning[:-1], ""))  # next to the column that was chosen
            other = place or meaning in chosen or (own in names and own != name.lower())
            out.append(Column(index, name, unit, "note" if other else meaning, repeat))
    if "ll" not in chosen and any(c.meaning in READINGS and c.meaning != "ll" for c in out):
        # a length of something else
        out = [replace(c, meaning="note") if c.meaning == "ll" else c for c in out]
    meant = {c.meaning for c in out}
    if meant & set(AXES) and not meant & set("xyz") and not set(chosen) & set(SEEN):
        # where deflections are read, what was touched is where the tool stood
        out = [replace(c, meaning=c.meaning[1]) if c.meaning in SEEN else c for c in out]
    for axis in sorted({*WRENCH} - meant - {*chosen}):
        if len(named := named_loads(out, axis)) == 1:
            out[named[0].index] = replace(named[0], meaning=axis)
    first = {(c.meaning, c.repeat): c.index for c in reversed(out)}  # a second one is a note
    return [
        c if first[c.meaning, c.repeat] == c.index else Column(c.index, c.name, c.unit, "note") for c in out
    ]


def named_loads(columns: Sequence[Column], axis: str) -> list[Column]:
    """Notes that have a load of this axis, such as fx, among their words: ``Channel 1 Fx``, ``/ft/wrench/force/x``."""
    sort, topic = ("force", "force") if axis[0] == "f" else ("moment", "torque")
    word = re.compile(rf"(?i)(?<![a-z])({axis[0]}_?|{topic}[./]){axis[1]}(?![a-z])")
    notes = (c for c in columns if c.meaning == "note" and word.search(c.name))
    return [c for c in notes if not c.unit or unit_of(c.unit, sort)]


def guessed(name: str) -> str:
    """Column of an experiment that a name without its unit stands for; ``note`` for none."""
    return _meaning(name)[0]


def _meaning(name: str) -> tuple[str, int]:
    if found := meaning_of(name):
        return found, 0
    match = REPEATED.match(re.sub(r"\s+", " ", name.strip()))
    repeated = meaning_of(match[1]) if match else ""
    if match and repeated in READINGS and repeated != "ll":
        return repeated, int(match[2])
    return "note", 0
