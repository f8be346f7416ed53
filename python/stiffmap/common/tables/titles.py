"""What titles above rows and between them say of the rows below, as columns: ``Pose 3: X = 50 mm, Y = 0 mm``."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator

import numpy as np
from numpy.typing import NDArray

from stiffmap.common.tables.header import is_unit, split_unit, with_unit
from stiffmap.common.tables.lines import Spelling, is_finite
from stiffmap.common.tables.table import Table

Said = dict[tuple[str, str], dict[int, float | str]]
"""Name and unit -> line of a title -> what it says."""
STATED = re.compile(
    r"(?<![\w.])(?P<name>[^\W\d][\w ./-]*?)\s*(?:[\[(](?P<in>[^\])]+)[\])])?\s*[=:]\s*"
    r"(?:(?P<size>[+−-]?\d+(?:[.,]\d+)?)(?:\s*(?P<unit>[^\W\d][^\s,;)=:]*|°)(?=[\s,;)]|$)(?!\s*[=:]))?|(?P<way>[+−-]?[xyz])(?=\s*(?:[,;)]|$)))",
    re.IGNORECASE,
)
"""A number or an axis in a title: ``X = 50 mm``, ``Fz: -100 N``, ``Load direction: +x``."""
COUNTED = re.compile(r"(?<![\w.,-])(\d+)[ -]([^\W\d]+)(?!\s*[\w=:])")
"""A number before its name: ``2 teeth``, ``4-flute``."""


def texts_of(sheet: Table) -> Iterator[tuple[int, str]]:
    """Line and text of each title, without names of columns; where cells are names, numbers and units, as one text as well."""
    for line, cells in sheet.titles:
        parts: list[str] = []
        for cell in filter(None, (c.strip() for c in cells)):
            last = parts[-1] if parts else ""
            number = is_finite(cell, Spelling(sheet.decimal_comma))
            if not (number or is_unit(cell)) and any(cell in h for h in sheet.header):
                continue
            if parts and (number or last[-1:] in "=:") and not last[-1:].isdigit():
                parts[-1] = f"{last.rstrip(' =:')}: {cell}"
            elif last[-1:].isdigit() and is_unit(cell):
                parts[-1] = f"{last} {cell}"
            else:
                parts.append(cell)
        yield line, " ; ".join(parts)


def said_in(
    sheet: Table,
    of_rows: Callable[[str], bool],
    of_ways: Callable[[str], object] = lambda name: False,
    counted: Callable[[str], bool] = lambda name: False,
) -> Said:
    """What titles say by names that are of rows, some of which an axis follows and not a number; a number may stand before those
    that are `counted`."""
    found: Said = {}
    for line, text in texts_of(sheet):
        for match in STATED.finditer(text):
            name = match["name"] if of_rows(match["name"]) else match["name"].split()[-1]
            value = match["way" if of_ways(name) else "size"]
            if value and of_rows(name):
                key = name, match["unit"] or match["in"] or ""
                found.setdefault(key, {})[line] = value if match["way"] else as_number(value)
        for count, name in COUNTED.findall(text):
            if counted(name):
                found.setdefault((name, ""), {}).setdefault(line, float(count))
    return found


def as_number(text: str) -> float:
    """With either decimal sign, whatever that of the table is."""
    return float(text.replace("−", "-").replace(",", "."))


def with_said(
    sheet: Table, said: Said, sure: Callable[[str, bool], bool], of_poses: Callable[[str], object]
) -> tuple[Table, list[str]]:
    """The table with a column for each name that titles say, and a sentence for each; `sure`: whether a name is one of rows, by
    whether several titles say it. FileError where a title lacks what those of other rows say: its rows would have the pose of those
    above them."""
    new: dict[str, NDArray[np.bool_]] = {}
    used: set[int] = set()
    words = []
    for (name, unit), of in said.items():
        at = np.searchsorted([*of], sheet.lines) - 1
        if at.min() < 0 or name in sheet.names or not sure(name, len(of) > 1):
            continue
        header, where = with_unit(name, unit), "titles between" if len(of) > 1 else "title above"
        cells = [[*of.values()][k] for k in at]
        text = any(isinstance(c, str) for c in cells)
        sheet = sheet.with_cells(header, map(str, cells)) if text else sheet.with_column(header, cells)
        words.append(f"'{header}' stands in the {where} the rows")
        new[header], used = np.diff(at, prepend=-1) > 0, used | {*of}
    if new:
        _refuse_untitled(sheet, new, [h for h in new if of_poses(split_unit(h)[0])])
    return sheet.without_titles(used), words


def _refuse_untitled(sheet: Table, new: dict[str, NDArray[np.bool_]], poses: Iterable[str]) -> None:
    begins = np.diff(np.searchsorted(sheet.headers_again, sheet.lines), prepend=0) > 0
    titled_anew = np.any([*new.values()], axis=0)
    placed_anew = np.any([new[h] for h in poses], axis=0)
    for header, own in new.items():
        good = (titled_anew | ~begins) & (own | ~placed_anew if header in poses else True)
        sheet.check(good, lambda _: f"no title above this row says '{header}', as those of other rows do")  # noqa: B023
