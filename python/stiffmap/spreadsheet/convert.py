"""A sheet to an experiment folder: experiment.yaml, data.csv, notes.csv."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from stiffmap.broadcasting import Floats
from stiffmap.errors import StiffmapError
from stiffmap.outputs import make_folder, only_job, write_rows, write_text
from stiffmap.spreadsheet.guess import FORCES, LENGTHS, READINGS, SEEN, Column, guess, known_unit
from stiffmap.spreadsheet.sheet import Sheet
from stiffmap.yaml_text import text_of

WORDS = ("id", "setup", "branch")
POSE = ("x", "y", "z")
FORCE = ("fx", "fy", "fz")
POSE2 = ("x2", "y2", "z2")
COUNTED = ("order", "repeat")


@dataclass(frozen=True)
class Imported:
    """What was understood of a sheet."""

    columns: list[Column]
    units: dict[str, str]
    header: list[str]
    rows: Rows
    repeats: int
    constants: dict[str, float]
    notes: list[Column]
    head: dict[str, Any] = field(default_factory=dict)
    """Further keys of experiment.yaml."""


def understand(
    sheet: Sheet,
    chosen: Mapping[str, Sequence[str]],
    units: Mapping[str, str],
    constants: Mapping[str, float],
    commands: Mapping[str, tuple[str, str]] | None = None,
    head: Mapping[str, Any] | None = None,
) -> Imported:
    """Columns, units and rows of data.csv; raises StiffmapError that asks for what cannot be guessed.

    ``units`` (meaning -> unit) for columns without brackets; ``constants`` (meaning -> number) for what the
    sheet has no column of, in mm and N. ``commands`` (column -> drive, unit) for columns of commanded joints, which stand for
    poses; ``head`` holds further keys of experiment.yaml.
    """
    drives = dict(commands or {})
    columns = guess(sheet.header, chosen)
    used = [c for c in columns if c.meaning != "note"]
    for c in used:
        if c.meaning not in WORDS and not sheet.is_numeric(c.index):
            sheet.numbers(c.index)  # raises, naming the line
    known = {c.meaning for c in used} | set(constants)
    if drives:  # the pose follows from them
        columns = [replace(c, meaning="note") if c.meaning in POSE else c for c in columns]
        used = [c for c in columns if c.meaning != "note"]
        known |= set(POSE)
    _ask(sheet, known)
    named = {c.meaning: _unit(c, units) for c in used if c.meaning not in (*WORDS, *COUNTED, *drives)}
    repeats = max([c.repeat for c in used], default=0) or 1
    header, rows = _rows(sheet, used, constants, repeats)
    return Imported(columns, named, header, rows, repeats, dict(constants),
                    [c for c in columns if c.meaning == "note"],
                    {"command": {k: {"actuator": a, "unit": u} for k, (a, u) in drives.items()}} | dict(head or {})
                    if drives else dict(head or {}))  # fmt: skip


def _ask(sheet: Sheet, known: set[str]) -> None:
    there = ", ".join(f"'{h}'" for h in sheet.header)
    lost = [a for a in POSE if a not in known]
    if lost:
        raise StiffmapError(
            f"{sheet.file}: which column is the position {lost[0]}? Say --map {lost[0]}='HEADER', or "
            f"--set {lost[0]}=NUMBER (mm) where it is the same in every row; columns: {there}"
        )
    if not known & set(READINGS):
        raise StiffmapError(
            f"{sheet.file}: which column is a reading? Say --map dx='HEADER' (dy, dz, rx, ry, rz), several "
            f"headers with | between them for repeats; columns: {there}"
        )


def _unit(c: Column, units: Mapping[str, str]) -> str:
    lengths = (*POSE, *POSE2, *SEEN, "dx", "dy", "dz", "dd")
    text = units.get(c.meaning, c.unit) or (units.get("length", "") if c.meaning in lengths else "")
    if not text:
        kind = (
            "um, mm"
            if c.meaning[-1] in "xyz" and c.meaning[0] not in "fmr"
            else "N"
            if c.meaning[0] == "f"
            else "deg"
        )
        raise StiffmapError(
            f"column '{c.name}' ({c.meaning}) has no unit: write it in the header, as in '{c.name} [mm]', or say "
            f"--unit {c.meaning}={kind.split(',')[0]}"
        )
    found = known_unit(text)
    wanted = LENGTHS if c.meaning in lengths else FORCES if c.meaning in FORCE else None
    if not found or (wanted is not None and found not in wanted.values()):
        raise StiffmapError(f"column '{c.name}' ({c.meaning}): the unit '{text}' is not one of this quantity")
    return found


def _rows(
    sheet: Sheet, used: list[Column], constants: Mapping[str, float], repeats: int
) -> tuple[list[str], Rows]:
    """Cells of data.csv: repeats side by side become rows one below the other."""
    common = [c for c in used if c.repeat == 0]
    meanings = list(dict.fromkeys(c.meaning for c in used if c.repeat))
    header = [*(c.meaning for c in common), *constants, *meanings, *(["repeat"] if repeats > 1 else [])]
    return header, Rows(sheet, common, constants, meanings, repeats, used)


class Rows:
    """Rows of data.csv, made block by block whenever they are asked for: text, and numbers as floats."""

    def __init__(
        self,
        sheet: Sheet,
        common: list[Column],
        constants: Mapping[str, float],
        meanings: list[str],
        repeats: int,
        used: list[Column],
    ) -> None:
        self._sheet, self._repeats = sheet, repeats
        numbers = {c.index: sheet.numbers(c.index) for c in used if c.meaning not in WORDS}
        at = {(c.meaning, c.repeat): c.index for c in used}
        wanted: list[list[int | float | None]] = []
        for k in range(1, repeats + 1):
            side = [at.get((m, k)) for m in meanings]
            wanted.append([*(c.index for c in common), *map(float, constants.values()), *side])
        self._numbers, self._wanted = numbers, wanted
        self._words = [c.index for c in used if c.meaning in WORDS]
        header = [*(c.meaning for c in common), *constants, *meanings]
        self._id = header.index("id") if repeats > 1 and "id" in header else None
        self._readings = [header.index(m) for m in READINGS if m in header]

    def __iter__(self) -> Iterator[Sequence[Any]]:
        words = {i: self._sheet.columns[i].parts() for i in self._words}
        start = 0
        for size in map(len, self._sheet.columns[0].parts()):
            here = slice(start, start + size)
            cells = {i: next(parts) for i, parts in words.items()}
            cells |= {i: _written(values[here]) for i, values in self._numbers.items()}
            each = [self._block(k, cells, size) for k in range(self._repeats)]
            for rows in zip(*each, strict=True):
                yield from (row for row in rows if any(row[i] != "" for i in self._readings))
            start += size

    def _block(self, k: int, cells: dict[int, list[Any]], size: int) -> Iterator[Sequence[Any]]:
        """Rows of one of the repeats that stand side by side."""
        columns = [
            [""] * size if w is None else [w] * size if isinstance(w, float) else cells[w]
            for w in self._wanted[k]
        ]
        if self._repeats > 1:
            if self._id is not None:
                columns[self._id] = [f"{name}.{k + 1}" for name in columns[self._id]]
            columns.append([k + 1] * size)
        return zip(*columns, strict=True)

    def __len__(self) -> int:
        return sum(1 for _ in self)


def _written(values: Floats) -> list[Any]:
    """Numbers, and nothing where there are none."""
    out: list[Any] = values.tolist()
    return ["" if v != v else v for v in out] if np.isnan(values).any() else out


def write_folder(
    found: Imported,
    sheet: Sheet,
    folder: Path,
    machine: str,
    quantity: str,
    noise: Mapping[str, float],
    title: str,
) -> None:
    """Write the folder; raises FileError where it cannot be written."""
    head: dict[str, Any] = {
        "title": title,
        "machine": machine,
        "quantity": quantity,
        "units": head_units(found),
    }
    if noise:
        head["noise"] = dict(noise)
    head |= found.head
    with only_job(make_folder(folder)):
        head["rows"] = write_rows(folder / "data.csv", found.header, found.rows)
        if found.notes:
            kept = ([row[c.index] for c in found.notes] for row in sheet.rows)
            write_rows(folder / "notes.csv", [sheet.header[c.index] for c in found.notes], kept)
        write_text(folder / "experiment.yaml", text_of(head))


def head_units(found: Imported) -> dict[str, str]:
    """Units for experiment.yaml: mm and N in common, every column that differs by its name."""
    common = {"length": "mm", "force": "N"}
    out = dict(common)
    for meaning, unit in found.units.items():
        base = meaning.removeprefix("u_")
        if meaning == "temperature":
            out["temperature"] = unit
        elif meaning.startswith("u_"):
            if found.units.get(base) != unit:
                raise StiffmapError(
                    f"columns {base} and {meaning} need the same unit; found {found.units.get(base)} and {unit}"
                )
        elif unit not in common.values():
            out[meaning] = unit
    return out
