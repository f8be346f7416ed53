"""Tables in files of their own that stand side by side: commands of a controller, and what an instrument read."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from stiffmap.common.errors import FileError
from stiffmap.common.short import first_of
from stiffmap.common.tables.cells import Cells
from stiffmap.common.tables.header import meaning_of, refuse_twice, split_unit
from stiffmap.common.tables.table import Table


def side_by_side(tables: Sequence[Table]) -> Table:
    """One table of the columns of several: rows of points of one name next to each other where the points of all have names, else row by
    row. Lines are those of the last file. Places in all but the first file are measured ones, and so is what has a name that was there
    before. Raises FileError for rows without others to stand next to."""
    out, *more = (_with_points(t) for t in tables)
    for other in more:
        out = _joined(out, other)
    return out


def _joined(a: Table, b: Table) -> Table:
    rows = _alike(a, b)
    count = len(a.header)
    numbered = [f"column {count + i}" if h == f"column {i}" else h for i, h in enumerate(b.header, 1)]
    b = replace(b, header=tuple(numbered))
    own = ("x", "y", "z", *(n.lower() for n in a.names))
    header = [
        f"measured {h}" if n.lower() in own or meaning_of(n) in own[:3] else h
        for h, n in zip(b.header, b.names, strict=True)
    ]
    refuse_twice([*a.names, *(split_unit(h)[0] for h in header)], b.file, b.top)
    sides = [(t, [r[k] for r in rows]) for k, t in enumerate((a, b))]
    left = list[str]()
    for t, at in sides:
        if lost := [str(t.lines[i]) for i in sorted({*range(len(t))} - {*at})]:
            left.append(
                f"row{'s' * (len(lost) > 1)} {first_of(lost, 3)} of {t.file}, which no other table has"
            )
    columns = tuple(_taken(c, at) for t, at in sides for c in t.columns)
    return replace(
        b, file=f"{a.file} and {b.file}", header=(*a.header, *header), columns=columns,
        lines=[b.lines[j] for _, j in rows], record=(*a.record, *b.record), above=(*a.above, *b.above),
        aside=(*a.left_out, *b.left_out, *left), titles=(),
    )  # fmt: skip


def _alike(a: Table, b: Table) -> list[tuple[int, int]]:
    """Rows of two tables that stand next to each other."""
    pairs = ((one, two) for one in _names(a) for two in _names(b))
    one, two = max(pairs, key=lambda pair: len(pair[0].keys() & pair[1].keys()), default=({}, {}))
    both = one.keys() & two.keys()
    if both and (len(both) in (len(one), len(two)) or len(a) != len(b)):
        return sorted(((one[n], two[n]) for n in both), key=lambda rows: rows[1])
    if both:
        other = next(n for n in two if n not in both)
        raise FileError(f"expected the points of {a.file} by their names; found '{other}'", file=b.file)
    if len(a) != len(b):
        what = f"expected {len(a)} rows as in {a.file}, or a column of points' names in both"
        raise FileError(f"{what}; found {len(b)}", file=b.file)
    return [(i, i) for i in range(len(a))]


def _names(table: Table) -> list[dict[str, int]]:
    """Row of each name of a point, for each column that may name them."""
    columns = zip(range(len(table.names)), table.names, table.columns, strict=True)
    words = (c for i, n, c in columns if meaning_of(n) == "id" or not table.is_numeric(i))
    return [names for c in words if len(names := {name: i for i, name in enumerate(c)}) == len(table)]


def _taken(cells: Cells, rows: Sequence[int]) -> Cells:
    every = [*cells]
    return Cells.of(every[i] for i in rows)


def _with_points(table: Table) -> Table:
    if not table.decimal_comma:
        return table
    every = range(len(table.columns))
    columns = tuple(table.with_points(i) if table.is_numeric(i) else table.columns[i] for i in every)
    return replace(table, columns=columns, decimal_comma=False)
