"""Cells of large tables: text packed to a tenth of what Python's strings need, numbers read a column at a time."""

from __future__ import annotations

import math
from array import array
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from itertools import chain, islice
from typing import TypeVar

import numpy as np

from stiffmap.common.broadcasting import Floats
from stiffmap.common.number_text import LARGEST, SMALLEST

BETWEEN = "\x1f"
"""Stands between cells; one inside a cell becomes a blank."""
BLOCK = 500
"""Rows at a time: few enough for the cache, and for the garbage collector to leave them alone (of 2000, half of the time is its)."""
T = TypeVar("T")


class Cells:
    """The cells of one column, without blanks around them."""

    def __init__(self, blocks: Sequence[str] = (), count: int = 0) -> None:
        self.blocks, self._count = list(blocks), count

    @staticmethod
    def of(cells: Iterable[str]) -> Cells:
        """A column of its cells."""
        return packed(enumerate((c,) for c in cells), 1)[0][0]

    def __len__(self) -> int:
        return self._count

    def __iter__(self) -> Iterator[str]:
        return chain.from_iterable(self.parts())

    @property
    def last(self) -> str:
        """The last cell, nothing else unpacked."""
        return self.blocks[-1].rpartition(BETWEEN)[2]

    def parts(self) -> Iterator[list[str]]:
        """Cells, block by block."""
        return (block.split(BETWEEN) for block in self.blocks)

    def numbers(self, one: Callable[[str, int], float]) -> Floats:
        """All as numbers. `one` (cell, row) reads whatever is no plain number of at most ``LARGEST``, or raises."""
        out = np.empty(self._count)
        start = 0
        for block, cells in zip(self.blocks, self.parts(), strict=True):
            values = out[start : start + len(cells)]
            values[:] = math.nan
            if block.isascii() and "_" not in block:
                with suppress(ValueError):
                    values[:] = [float(c or "nan") for c in cells]
            values[np.abs(values) < SMALLEST] = 0.0
            for i in np.flatnonzero(~(np.abs(values) <= LARGEST)):
                values[i] = one(cells[i], start + int(i))
            start += len(cells)
        return out


def blocks(rows: Iterable[T]) -> Iterator[list[T]]:
    """The rows, some at a time."""
    source = iter(rows)
    while block := list(islice(source, BLOCK)):
        yield block


def packed(rows: Iterable[tuple[int, Sequence[str]]], width: int) -> tuple[tuple[Cells, ...], array[int]]:
    """Columns of rows of `width` cells each, and the numbers of their lines, which take eight bytes each."""
    out, lines = tuple(Cells() for _ in range(width)), array("q")
    for block in blocks(rows):
        lines.extend(n for n, _ in block)
        for column, cells in zip(out, zip(*(c for _, c in block), strict=True), strict=True):
            text = BETWEEN.join(map(str.strip, cells))
            if text.count(BETWEEN) != len(block) - 1:
                text = BETWEEN.join(c.replace(BETWEEN, " ").strip() for c in cells)
            column.blocks.append(text)
            column._count += len(block)
    return out, lines


def filled(row: Sequence[str]) -> bool:
    """Whether anything stands in a row."""
    return bool(row) and (bool(row[0].strip()) or any(c.strip() for c in row))
