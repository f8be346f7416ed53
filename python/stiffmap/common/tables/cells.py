"""Cells of large tables: text packed to a tenth of what Python's strings need, numbers read a column at a time."""

from __future__ import annotations

import math
from array import array
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import chain, islice

import numpy as np

from stiffmap.common.broadcasting import Floats
from stiffmap.common.number_text import LARGEST, SMALLEST

BETWEEN = "\x1f"
"""Stands between cells; one inside a cell becomes a blank."""
BLOCK = 20_000


class Cells:
    """The cells of one column, without blanks around them."""

    def __init__(self, blocks: Sequence[str] = (), count: int = 0) -> None:
        self.blocks, self._count = list(blocks), count

    @staticmethod
    def of(cells: Iterable[str]) -> Cells:
        """A column of its cells."""
        (out,) = packed(((c,) for c in cells), 1)
        return out

    def __len__(self) -> int:
        return self._count

    def __iter__(self) -> Iterator[str]:
        return chain.from_iterable(self.parts())

    def parts(self) -> Iterator[list[str]]:
        """Cells, block by block."""
        return (block.split(BETWEEN) for block in self.blocks)

    def numbers(self, one: Callable[[str, int], float]) -> Floats:
        """All as numbers. `one` (cell, row) reads whatever is no plain number of at most ``LARGEST``, or raises."""
        out = np.empty(self._count)
        start = 0
        for block, cells in zip(self.blocks, self.parts(), strict=True):
            stop = start + len(cells)
            out[start:stop] = self._block(block, cells, one, start)
            start = stop
        return out

    @staticmethod
    def _block(block: str, cells: list[str], one: Callable[[str, int], float], start: int) -> Floats:
        if "_" in block or not block.isascii():
            return np.array([one(c, start + i) for i, c in enumerate(cells)])
        try:
            filled = "" not in cells
            out = np.array(
                list(map(float, cells)) if filled else [float(c) if c else math.nan for c in cells]
            )
        except ValueError:
            return np.array([one(c, start + i) for i, c in enumerate(cells)])
        out[np.abs(out) < SMALLEST] = 0.0
        for i in np.flatnonzero(~(np.abs(out) <= LARGEST)):
            out[i] = one(cells[i], start + int(i))
        return out


def packed(rows: Iterable[Sequence[str]], width: int) -> tuple[Cells, ...]:
    """Columns of rows of `width` cells each."""
    out = tuple(Cells() for _ in range(width))
    source = iter(rows)
    while block := list(islice(source, BLOCK)):
        for column, cells in zip(out, zip(*block, strict=True), strict=True):
            text = BETWEEN.join(map(str.strip, cells))
            if text.count(BETWEEN) != len(block) - 1:
                text = BETWEEN.join(c.replace(BETWEEN, " ").strip() for c in cells)
            column.blocks.append(text)
            column._count += len(block)
    return out


def filled(row: Sequence[str]) -> bool:
    """Whether anything stands in a row."""
    return bool(row) and (bool(row[0].strip()) or any(c.strip() for c in row))


def row_numbers() -> array[int]:
    """An empty list of line numbers that takes eight bytes each."""
    return array("q")


def numbered(rows: Iterable[tuple[int, Sequence[str]]], numbers: array[int]) -> Iterator[Sequence[str]]:
    """Cells of rows; `numbers` gathers those of their lines."""
    for n, cells in rows:
        numbers.append(n)
        yield cells
