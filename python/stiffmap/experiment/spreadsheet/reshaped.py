"""Sheets that hold one experiment in another shape than a row for each reading: a row for each coordinate, columns for each load."""

from __future__ import annotations

import re
from dataclasses import replace
from itertools import chain, repeat

import numpy as np

from stiffmap.common.tables.cells import Cells
from stiffmap.common.tables.header import split_unit, with_unit
from stiffmap.common.tables.table import Table
from stiffmap.common.tables.titles import Said, as_number, said_in, texts_of, with_said
from stiffmap.common.units import unit_of
from stiffmap.experiment.experiment import WRENCH
from stiffmap.experiment.files.fields import POSE
from stiffmap.experiment.spreadsheet.answers import Meant
from stiffmap.experiment.spreadsheet.guess import guessed
from stiffmap.experiment.spreadsheet.joints import JOINT
from stiffmap.experiment.spreadsheet.together import DIRECTION, HUNG, LOAD, STATES

OF_LOAD = re.compile(
    r"(?i)(?:^|[\s@(\[,;:_/|]+)(?:(?:at|bei|with|mit|under|unter|à|avec|con|load|last|force|kraft|charge)[\s_]+)*"
    r"(?P<name>[fm][ _]?[xyz]?(?=[\s=:+−-]))?\s*[=:]?\s*(?P<size>[+−-]?\d+(?:[.,]\d+)?)[ _]?(?P<unit>N·?m|k?N|daN|kgf?|g|lbf?)"
    r"(?=$|[\s)\]@,;:_/|])"
    r"(?:\s*(?:in|along|entlang)?\s*(?P<way>[+−-]?[xyz])(?=$|[\s)\]]))?[)\]]?"
)
"""A load in the name of a column: ``dz @ 50 N``, ``Fz = -100 N dx [mm]``, ``10 kg``, ``100 N along -Z``."""
BRANCH = re.compile(r"(?i)[\s_(,;]*\b(?P<un>un|ent)?(loading|lasten|lastung|belasten|belastung)\b\)?")
"""In the name of a column, whether the load went up or down."""
MOST_WORDS = 5
"""Of a title that says that nothing was loaded."""
READING = "reading"
"""Name of a column that is named by its load alone."""


def one_point_a_row(m: Meant) -> None:
    """Rows that are one coordinate of a point each, as in reports of features, as one row a point: columns whose cells differ within a
    point get its axes behind their names. StiffmapError where the rows of a point are not together."""
    placed = bool({*"xyz"} & {*map(guessed, m.sheet.names), *m.constants})
    ways = [i for i, n in enumerate(m.sheet.names) if DIRECTION.fullmatch(n)]
    pulled = any(LOAD.fullmatch(n) and not HUNG.search(n) for n in m.sheet.names)
    for at, column in enumerate(m.sheet.columns):
        cells = [c.lower() for c in column]
        axes = sorted({*cells})
        if axes not in (["x", "y"], ["x", "y", "z"]):
            continue
        points = [cells[k : k + len(axes)] for k in range(0, len(cells), len(axes))]
        good = np.repeat([sorted(p) == axes for p in points], len(axes))[: len(cells)]
        if placed and pulled and not {*ways} - {at}:
            continue  # the axis is that of the load
        if placed and not (good.all() and _differ_in_one(m.sheet, at, len(axes))):
            continue
        if any(h.isdigit() for headers in m.chosen.values() for h in headers):
            good[:] = False  # whose columns are those of the rows
        what = f"column '{m.sheet.header[at]}': each row is one coordinate of a point; expected its rows {', '.join(axes)} together, and columns by name"
        m.sheet.check(good, lambda _: what)  # noqa: B023
        m.sheet = _points(m.sheet, at, points)
        m.said.append(f"rows of one coordinate each are taken together: {len(points)} points")
        return


def _differ_in_one(sheet: Table, at: int, size: int) -> bool:
    """Whether so many rows each differ, but for a column of axes, in one column of numbers alone: not in a load or a pose."""
    others = [c for i, c in enumerate(sheet.columns) if i != at]
    several = (any(len({*r}) > 1 for r in zip(*[iter(c)] * size, strict=True)) for c in others)
    return sum(several) == 1


def _points(sheet: Table, at: int, points: list[list[str]]) -> Table:
    """A row for each of the points, whose axes, in the order of their rows, are the cells of a column."""
    size = len(points[0])
    first = range(0, len(sheet), size)
    columns: dict[str, Cells] = {}
    for i, cells in enumerate(map(list, sheet.columns)):
        own = [[c for c in cells[k : k + size] if c] for k in first]
        name, unit = sheet.names[i], sheet.unit(i)
        if i != at and all(len({*c}) <= 1 for c in own):
            columns[sheet.header[i]] = Cells.of(c[0] if c else "" for c in own)
        elif i != at:
            for axis in sorted(points[0]):
                rows = (k + p.index(axis) for k, p in zip(first, points, strict=True))
                columns[with_unit(f"{name} {axis}", unit)] = Cells.of(cells[k] for k in rows)
    lines = [sheet.lines[k] for k in first]
    return replace(sheet, header=tuple(columns), columns=tuple(columns.values()), lines=lines)


def titled(m: Meant) -> None:
    """Poses and loads that stand in a title above the rows that they are of, ``Pose 3: X = 50 mm, Y = 0 mm``, as columns; of what the
    table has no column for, and no number that is the same in all rows."""
    has = {guessed(n) for n in m.sheet.names} - {"note"} | {*m.constants, *m.chosen}
    found = said_in(m.sheet, _of_row, DIRECTION.fullmatch)
    loads: Said = {}
    idle: list[int] = []
    for line, text in texts_of(m.sheet):
        if load := OF_LOAD.search(text):
            name, unit, size = _load(load)
            loads.setdefault((name, unit), {})[line] = size
        elif len(text.split()) <= MOST_WORDS and STATES["before"].search(text):
            idle.append(line)
    for key, of in loads.items():
        of |= dict.fromkeys(idle, 0.0)
        if len(of) > 1:
            found[key] = dict(sorted((found.get(key, {}) | of).items()))

    def sure(name: str, several: bool) -> bool:
        return (several or guessed(name) in (*POSE, *WRENCH)) and guessed(name) not in has

    m.sheet, words = with_said(m.sheet, found, sure, lambda n: guessed(n) in POSE or JOINT.fullmatch(n))
    m.said += words


def _of_row(name: str) -> bool:
    """Whether a title says with this name where the rows below it were read, or under which load."""
    return guessed(name) in (*POSE, *WRENCH) or any(p.fullmatch(name) for p in (JOINT, LOAD, DIRECTION))


def one_load_a_row(m: Meant) -> None:
    """Columns whose names differ by a load alone, as ``dz @ 50 N`` and ``dz @ 100 N``, as a row for each load, which has a column then.

    Not where a person says of one of them, or by a number, what a column is."""
    branches = [BRANCH.search(h) for h in m.sheet.header]
    matches = [OF_LOAD.search(BRANCH.sub("", h)) for h in m.sheet.header]
    found = {i: match for i, match in enumerate(matches) if match and m.sheet.is_numeric(i)}
    loads = {i: (*_load(match), _branch(branches[i])) for i, match in found.items()}
    names = {i: _without(match) for i, match in found.items()}
    said = {h.strip().lstrip("+-−") for headers in m.chosen.values() for h in headers}
    own = {m.sheet.header[i] for i in found}
    units = {*map(split_unit, names.values())}
    every = dict.fromkeys(loads.values())
    new = {*names.values(), *(with_unit(name, unit) for name, unit, _, _ in every)}
    others = {h for i, h in enumerate(m.sheet.header) if i not in found}
    if (
        len(every) < 2
        or len({*zip(loads.values(), names.values(), strict=True)}) < len(found)
        or len({(unit, len(name) == 2) for name, unit, _, _ in every}) > 1
        or others & {*new, "branch"}
        or any(unit and not (unit_of(unit, "length") or unit_of(unit, "angle")) for _, unit in units)
        or any(h.isdigit() or h in own for h in said)
    ):
        return
    sheet, many = m.sheet, len(m.sheet)
    left = [i for i in range(len(sheet.header)) if i not in found]
    header = tuple(_unloaded(sheet.header[i]) for i in left)
    tall = replace(sheet, header=header, columns=tuple(sheet.columns[i] for i in left)).repeated(len(every))
    for name, unit in dict.fromkeys(load[:2] for load in every):
        sizes = [load[2] if load[0] == name else 0.0 for load in every]
        tall = tall.with_column(with_unit(name, unit), np.tile(sizes, many))
    if any(branches[i] for i in found):
        tall = tall.with_cells("branch", [load[3] for load in every] * many)
    at = {(name, loads[i]): i for i, name in names.items()}
    for name in dict.fromkeys(names.values()):
        there = (at.get((name, load)) for load in every)
        cells = (repeat("", many) if i is None else sheet.columns[i] for i in there)
        tall = tall.with_cells(name, chain.from_iterable(zip(*cells, strict=True)))
    m.sheet = tall
    texts = ", ".join(f"{name} {size:g} {unit} {branch}".strip() for name, unit, size, branch in every)
    m.said.append(f"columns of several loads are rows, one below the other: {texts}")


def _load(match: re.Match[str]) -> tuple[str, str, float]:
    """Column of a load, its unit and its size in that."""
    name, unit, way = re.sub(r"[ _]", "", match["name"] or ""), match["unit"], match["way"] or ""
    found = unit_of(unit, "force")
    size = as_number(match["size"])
    if len(name) == 2:
        return name.capitalize(), unit, size
    if way:
        return f"F{way[-1].lower()}", unit, -size if way[0] in "-−" else size
    return "Mass" if found and found.mass else "Load", unit, size


def _branch(match: re.Match[str] | None) -> str:
    return ("unloading" if match["un"] else "loading") if match else ""


def _without(load: re.Match[str]) -> str:
    """The name of a column without its load."""
    left = f"{load.string[: load.start()]} {load.string[load.end() :]}".strip(" @,;:_/|=-")
    name, unit = split_unit(f"{READING} {left}" if left[:1] in ("", "[", "(") else left)
    return with_unit(name, unit)


def _unloaded(header: str) -> str:
    """A column that is named by its state alone, as ``unloaded``, is the reading in that state."""
    alone = any(words.fullmatch(split_unit(header)[0].strip()) for words in STATES.values())
    return f"{READING} {header}" if alone else header
