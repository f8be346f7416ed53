"""Places that an instrument saw, or in which the point stood: whether they are in a frame of their own, and which were not seen."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from stiffmap.common.broadcasting import Floats, Mask
from stiffmap.common.errors import StiffmapError
from stiffmap.common.short import first_of
from stiffmap.common.tables.cells import Cells
from stiffmap.common.tables.table import Table
from stiffmap.experiment.channels import AXES
from stiffmap.experiment.files.fields import POSE, SEEN
from stiffmap.experiment.poses.handeye import own_frame
from stiffmap.experiment.spreadsheet.answers import Meant, Question
from stiffmap.experiment.spreadsheet.guess import AXIS, MEASURED_AXIS, READINGS, Column
from stiffmap.experiment.spreadsheet.turned import turns_behind
from stiffmap.solve.kinematics import forward_kinematics
from stiffmap.solve.machine import Machine

NAMED = 5
"""Lines that a sentence names."""
LINE = 0.02
"""Second extent of the commands over the first, below which they are a line."""
LEVER = 5.0
"""mm from the tool's point, from which it is said where a target sits."""
SOCKET = r"(ball[ _-]?)?(socket|seat|nest|cup|datum|pfanne|kugelpfanne|sphere|ball|kugel)[ _.-]?(id|name|no\.?|nr\.?|number|nummer)?"
PLACE = r"position|pos\.?|place|location|station|ort|stelle|platz"
BALL = "the one ball"
NINES = [*(round(10.0**k - 0.1**j, 4) for k in range(3, 9) for j in range(5)), 9.9e37, 9.91e37]
"""999, 9999.99, overload and no number of SCPI, and the like, which stand for no reading."""
BEYOND = 5.0
"""How many times the others such a number is, where it is the only one of its row."""
SELDOM = 0.5
"""Share of rows that have places of their own, at most, where a ball stood in sockets."""
ALIKE = 1e-3
"""Share of a distance by which rounded numbers differ."""
SMALL = 0.1
"""Differences below this share of the largest in at least this share of the rows: without them all are places."""
STILL = 0.01
"""Share of its range within which a command is the same one."""


def seen_next_to_commands(m: Meant) -> None:
    """Columns px, py, pz next to x, y, z: their frame, and the place of the target on the tool, are unknown where they lie elsewhere."""
    of = {c.meaning: c.index for c in m.guessed if c.repeat == 0}
    if m.columns or not set(SEEN) <= set(of) or (commanded := commands(m)) is None:
        return
    m.placed = True
    turns = turns_behind(m, of.get("z"))
    if own_frame(m.metres([of[s] for s in SEEN], SEEN), commanded, turns) is not None:
        names = ", ".join(f"'{m.sheet.header[of[s]]}'" for s in SEEN)
        m.head |= {"frame": "unknown", "tool": "unknown"}
        m.said.append(
            f"{names} lie elsewhere than the commands: they are places in the instrument's own frame, which is unknown, as is the place "
            "of the target on the tool"
        )


def in_base_axes(m: Meant, machine: Callable[[], Machine]) -> None:
    """Differences dx, dy, dz of places in the instrument's own frame along base axes, which the columns of the places without load show,
    next to the commands; as they are where those are in one frame. `machine`: whose joints the sheet commands."""
    if not set(AXES[:3]) <= set(m.unloaded):
        return
    pose = forward_kinematics(machine(), m.coordinates()) if m.columns else None
    commanded = commands(m) if pose is None else pose.position
    if commanded is None:
        return
    seen = m.metres([m.unloaded[a] for a in AXES[:3]], AXES[:3])
    last = next((c.index for c in m.guessed if c.meaning == "z"), None)
    frame = own_frame(seen, commanded, turns_behind(m, last) if pose is None else pose.rotation)
    if frame is None:
        return
    good = commanded[np.isfinite(commanded).all(axis=1)]
    extents = np.linalg.svd(good - good.mean(axis=0), compute_uv=False)
    if extents[1] < LINE * extents[0]:
        raise StiffmapError(
            f"{m.sheet.file}: the commands lie on a line, next to which the unloaded places do not show the axes of the instrument's "
            "own frame; give differences along base axes (dx, dy, dz), or further poses"
        )
    at = [m.index(m.chosen[a][0]) for a in AXES[:3]]
    turned = (m.metres(at, AXES[:3]) @ frame.base_r[0]).T
    units = [m.written_unit(i, a) for i, a in zip(at, AXES[:3], strict=True)]  # as --noise has them
    for a, i, unit, values in zip(AXES[:3], at, units, turned, strict=True):
        size = m.unit(i, a).size
        m.add(f"{m.sheet.names[i]}, along the base's {a[1]}", unit, values / size, a)
    m.said.append(
        "the places without load lie elsewhere than the commands: they are in the instrument's own frame, and differences are turned "
        "from its axes into those of the base"
    )
    lever = 1e3 * frame.tool_p[0]
    if np.linalg.norm(lever) > LEVER:
        x, y, z = (f"{v:.0f}" for v in lever)
        m.said.append(
            f"the target sits at ({x}, {y}, {z}) mm on the tool: where it turns under load, read it there ('point' in the machine's file)"
        )


def commands(m: Meant) -> Floats | None:
    """(n, 3) m, commanded positions of a sheet; None where it has not all three."""
    of = {c.meaning: c.index for c in m.guessed if c.repeat == 0}
    if not set(POSE) <= {*of, *m.constants}:
        return None
    same = {a: np.full(len(m.sheet), 1e-3 * m.constants[a]) for a in POSE if a not in of}
    return np.column_stack([same[a] if a in same else m.metres([of[a]], [a])[:, 0] for a in POSE])


def without_marks(m: Meant) -> None:
    """Cells emptied that are no readings but nines, in all axes of a row, or far beyond those in other rows where one axis is read."""
    read = [c.index for c in m.guessed if c.meaning in READINGS and m.sheet.is_numeric(c.index)]
    asked = {c.index for c in m.guessed if c.meaning in POSE}
    for at in [*(s for s in _sets(m.sheet) if not asked & {*s}), *([i] for i in read)]:
        values = np.column_stack([m.sheet.numbers(i) for i in at])
        marks = np.isin(np.round(np.abs(values), 4), NINES).all(1) & (values == values[:, :1]).all(1)
        if len(at) == 1:
            marks &= np.abs(values[:, 0]) > BEYOND * np.nanmax(np.abs(values[~marks]), initial=0.0)
        _emptied(m, at, marks, f"{values[marks][0, 0]:.10g}" if marks.any() else "")


def without_lost(m: Meant, columns: Mapping[str, str], measured: Mapping[str, str]) -> None:
    """Places emptied in rows where a target was not seen: one number stands for all axes, or those of the row before stand again though
    another pose is commanded; so are differences made of them. Patterns of headers: what is commanded and what is `measured`."""
    of = {c.meaning: c.index for c in m.guessed if c.repeat == 0}
    given = {a: m.sheet.find(columns[a]) if a in columns else None for a in POSE}
    command = [i for a in POSE if (i := given[a] if given[a] is not None else of.get(a)) is not None]
    command = [i for i in command if m.sheet.is_numeric(i)]
    asked = np.column_stack([m.sheet.numbers(i) for i in command]) if command else np.zeros((len(m.sheet), 0))
    moves = m.coordinates() if m.columns else asked
    moved = (np.abs(np.diff(moves, axis=0)) > STILL * np.ptp(moves, axis=0)).any(axis=1)
    named = [m.sheet.find(pattern, command) for pattern in measured.values()]
    made = [of[a] for a in AXES[:3] if a in of and of[a] not in named]
    whole = len(made) == len(command) == len(POSE)
    sizes = np.abs(np.column_stack([m.sheet.numbers(i) for i in made])) if whole else asked[:, :0]

    def as_made(apart: Floats) -> Mask:
        """Rows whose differences are such distances, in mm or µm."""
        off = [np.abs(sizes - k * apart).max(axis=1) <= ALIKE * k * apart.max(axis=1) for k in (1.0, 1e3)]
        return np.asarray((off[0] | off[1]) & (apart != 0.0).any(axis=1))

    for at in [named, [of.get(a) for a in SEEN]]:
        places = [i for i in at if i is not None and m.sheet.is_numeric(i)]
        if len(places) < len(POSE) or not (m.columns or len(command) == len(POSE)):
            continue
        seen = np.column_stack([m.sheet.numbers(i) for i in places])
        if m.columns and len(np.unique(seen, axis=0)) <= SELDOM * len(seen):
            continue
        one = (seen == seen[:, :1]).all(axis=1)
        if len(command) == len(POSE):
            one &= (asked != asked[:, :1]).any(axis=1) | ((seen == 0.0) & (asked != 0.0)).any(axis=1)
        again = np.append(False, (seen[1:] == seen[:-1]).all(axis=1) & moved) & ~one
        kinds = [(one & (seen[:, 0] == v), f"{v:.10g}") for v in np.unique(seen[one, 0])]
        for lost, what in [*kinds, (again, "those of the row before, though another pose is commanded")]:
            if not lost.all():
                if whole:
                    _emptied(m, made, lost & as_made(np.abs(seen - asked)), "made of it")
                _emptied(m, places, lost, what)
    if (
        whole
        and np.isfinite(sizes).all(axis=1).any()
        and np.nanquantile(sizes.max(axis=1), SMALL) < SMALL * np.nanmax(sizes)
    ):
        _emptied(m, made, as_made(np.abs(asked)), "as large as the commands, whose places were then 0")


def _sets(sheet: Table) -> list[list[int]]:
    """Columns of numbers whose names differ by their axis alone, but not places next to the commands."""
    sets: dict[str, list[int]] = {}
    for i, name in enumerate(sheet.names):
        plain = re.sub(AXIS, "*", name).lower()
        if plain != name.lower() and sheet.is_numeric(i) and not re.fullmatch(MEASURED_AXIS, plain):
            sets.setdefault(plain, []).append(i)
    return [at for at in sets.values() if len(at) > 1]


def _emptied(m: Meant, at: Sequence[int], lost: Mask, what: str) -> None:
    """Empty cells of some columns in the rows that are `lost`, and say so."""
    if not lost.any():
        return
    lines = [str(m.sheet.lines[int(i)]) for i in np.flatnonzero(lost)]
    which = f"line{'s' if len(lines) > 1 else ''} {first_of(lines, NAMED)}"
    names = ", ".join(repr(m.sheet.header[i]) for i in at)
    m.said.append(
        f"left out: {which}: {names} {'are' if len(at) > 1 else 'is'} {what}, as of a target that was not seen"
    )
    columns = list(m.sheet.columns)
    for i in at:
        columns[i] = Cells.of("" if gone else c for c, gone in zip(columns[i], lost, strict=True))
    m.sheet = replace(m.sheet, columns=tuple(columns))


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
