"""Cells that hold several numbers, ``[0.1, 0.2, 0.3]`` or ``(50; 0; 20)``, as a cell for each of them."""

from __future__ import annotations

import re
from collections.abc import Iterator
from itertools import islice

from stiffmap.common.tables.header import is_unit, split_unit, with_unit
from stiffmap.common.tables.lines import Lines

NUMBER = re.compile(r"[+−-]?(?:\d+\.?\d*|\.\d+|\d+,\d+)(?:[eE][+-]?\d+)?")
BEFORE = re.compile(r"\s*(?:(?:np\.)?array\(|p)?(?=[\[({])")
"""Before the brackets: of a list of numpy, of a pose of UR."""
OPENS = ("[", "(", "{")
LEAST = 3
"""Numbers of a vector; two in brackets may be one with a decimal comma."""
SAMPLE = 100
"""Lines in which one of them must stand."""
PARTS = {
    3: (*"xyz",),
    6: ("x", "y", "z", "rx", "ry", "rz"),
    9: tuple(f"r{i}{j}" for i in "123" for j in "123"),
}
JOINTS = re.compile(r"(?i)(.*[ _])?(joints?|q|axes|angles)([ _](positions?|angles?|values?|states?))?")
OF_LOG = re.compile(r"(actual|target)_q")
POSE = re.compile(r"(?i).*(pose|tcp|cartesian|ee|x\W?y\W?z).*")
"""Of six numbers: a position and a rotation vector, no joints."""


def one_number_a_cell(lines: Lines) -> Lines:
    """The lines where no cell holds several numbers; else names become those of their parts, x y z of three."""
    sizes: dict[int, int] = {}
    for _, cells in islice(lines(), SAMPLE):
        for i, cell in enumerate(cells):
            if any(mark in cell for mark in OPENS):
                sizes[i] = max(sizes.get(i, 0), len(_numbers(cell)))
    found = {i: n for i, n in sizes.items() if n}

    def parted() -> Iterator[tuple[int, list[str]]]:
        for line, cells in lines():
            each = ([c] if i not in found else _parts(c, found[i]) for i, c in enumerate(cells))
            yield line, [part for parts in each for part in parts]

    return parted if found else lines


def _numbers(cell: str) -> list[str]:
    """Of a vector, or of a matrix row by row; nothing of other cells."""
    text = BEFORE.sub("", cell, count=1).strip()
    if not text.startswith(OPENS) or text[-1:] not in ("]", ")", "}"):
        return []
    inside = re.sub(r"[\[\](){}]", " ", text).strip(" ,;")
    parts = re.split(r"\s*;\s*" if ";" in inside and "," in inside else r"[\s,;]+", inside)
    return parts if len(parts) >= LEAST and all(map(NUMBER.fullmatch, parts)) else []


def _parts(cell: str, size: int) -> list[str]:
    if numbers := _numbers(cell):
        return numbers
    if not cell.strip() or is_unit(cell.strip("[]() ")):
        return [cell] * size
    if cell.lstrip().startswith(OPENS):  # a vector of another length
        return [cell, *[""] * (size - 1)]
    name, unit = split_unit(cell)
    if size > 3 and JOINTS.fullmatch(name):
        own = OF_LOG.fullmatch(name)
        return [f"{name}_{k}" if own else with_unit(f"joint {k + 1}", unit) for k in range(size)]
    named = size in PARTS and (size != 6 or POSE.fullmatch(name))
    parts = PARTS[size] if named else [str(k) for k in range(1, size + 1)]
    whole = size == 9 or re.fullmatch(r"(?i)\W*x\W?y\W?z\W*.*", name) is not None
    return [with_unit(part if named and whole else f"{name} {part}", unit) for part in parts]
