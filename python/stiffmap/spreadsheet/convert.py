"""A sheet to an experiment folder: experiment.yaml, data.csv, notes.csv."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from stiffmap.errors import StiffmapError
from stiffmap.outputs import make_folder, only_job, write_rows, write_text
from stiffmap.spreadsheet.guess import FORCES, LENGTHS, READINGS, Column, guess, known_unit
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
    rows: list[list[str]]
    repeats: int
    constants: dict[str, float]
    notes: list[Column]


def understand(
    sheet: Sheet,
    chosen: Mapping[str, Sequence[str]],
    units: Mapping[str, str],
    constants: Mapping[str, float],
) -> Imported:
    """Columns, units and rows of data.csv; raises StiffmapError that asks for what cannot be guessed.

    ``units`` (meaning -> unit) for columns without brackets; ``constants`` (meaning -> number) for what the
    sheet has no column of, in mm and N.
    """
    columns = guess(sheet.header, chosen)
    used = [c for c in columns if c.meaning != "note"]
    for c in used:
        if c.meaning not in WORDS and not sheet.is_numeric(c.index):
            sheet.numbers(c.index)  # raises, naming the line
    known = {c.meaning for c in used} | set(constants)
    _ask(sheet, known)
    named = {c.meaning: _unit(c, units) for c in used if c.meaning not in (*WORDS, *COUNTED)}
    repeats = max([c.repeat for c in used], default=0) or 1
    header, rows = _rows(sheet, used, constants, repeats)
    return Imported(columns, named, header, rows, repeats, dict(constants),
                    [c for c in columns if c.meaning == "note"])  # fmt: skip


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
    text = units.get(c.meaning, c.unit)
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
    wanted = (
        LENGTHS
        if c.meaning in (*POSE, *POSE2, "dx", "dy", "dz", "dd")
        else FORCES
        if c.meaning in FORCE
        else None
    )
    if not found or (wanted is not None and found not in wanted.values()):
        raise StiffmapError(f"column '{c.name}' ({c.meaning}): the unit '{text}' is not one of this quantity")
    return found


def _rows(
    sheet: Sheet, used: list[Column], constants: Mapping[str, float], repeats: int
) -> tuple[list[str], list[list[str]]]:
    """Cells of data.csv: repeats side by side become rows one below the other."""
    common = [c for c in used if c.repeat == 0]
    meanings = list(dict.fromkeys(c.meaning for c in used if c.repeat))
    header = [*(c.meaning for c in common), *constants, *meanings, *(["repeat"] if repeats > 1 else [])]
    values = {c.index: sheet.numbers(c.index) for c in used if c.meaning not in WORDS}
    out = []
    for r, cells in enumerate(sheet.rows):
        for k in range(1, repeats + 1):
            row = [_cell(c, cells[c.index], values, r) for c in common]
            if repeats > 1 and "id" in header:
                row[header.index("id")] += f".{k}"
            row += [repr(v) for v in constants.values()]
            side = {c.meaning: c for c in used if c.repeat == k}
            row += [_cell(side[m], "", values, r) if m in side else "" for m in meanings]
            read = [row[header.index(m)] for m in READINGS if m in header]
            if any(read):
                out.append([*row, *([str(k)] if repeats > 1 else [])])
    return header, out


def _cell(c: Column, text: str, values: Mapping[int, Sequence[float]], row: int) -> str:
    if c.meaning in WORDS:
        return text
    v = values[c.index][row]
    return "" if math.isnan(v) else repr(v)


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
    head["rows"] = len(found.rows)
    with only_job(make_folder(folder)):
        write_rows(folder / "data.csv", found.header, found.rows)
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
