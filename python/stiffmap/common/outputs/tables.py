"""Tables as CSV, which no spreadsheet mistakes for programs."""

from __future__ import annotations

import csv
import itertools
import os
import re
from collections.abc import Iterable, Iterator, Sequence

from stiffmap.common.outputs.writing import writing

RUN = re.compile(r"'*[=+\-@\t\r]")
"""What a spreadsheet may take for a formula, and the same behind the quotes of `guarded`."""
NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?")


def guarded(cell: object) -> object:
    """Text that a spreadsheet would run as a formula, with a ``'`` before it; numbers and other text as they are."""
    if isinstance(cell, str) and RUN.match(cell) and not NUMBER.fullmatch(cell):
        return f"'{cell}"
    return cell


def unguarded(cell: str) -> str:
    """The text of a cell that `guarded` wrote."""
    return cell[1:] if cell.startswith("'") and RUN.match(cell) else cell


def number_cells(values: Iterable[float]) -> list[str]:
    """Numbers (n,) as cells of nine digits, empty where they are NaN."""
    return ["" if v != v else f"{v:.9g}" for v in values]


def _counted(rows: Iterable[Sequence[object]], count: Iterator[int]) -> Iterator[Sequence[object]]:
    return (row for row, _ in zip(rows, count, strict=False))


def write_rows(
    path: str | os.PathLike[str],
    header: Sequence[str],
    rows: Iterable[Sequence[object]],
    encoding: str = "utf-8",
) -> int:
    """Write a CSV file: a header and rows; returns their number. Raises FileError where it cannot be written."""
    count = itertools.count()
    with writing(path) as fresh, fresh.open("w", newline="", encoding=encoding) as stream:
        out = csv.writer(stream)
        out.writerow([guarded(c) for c in header])
        out.writerows([guarded(c) if type(c) is str else c for c in row] for row in _counted(rows, count))
    return next(count)
