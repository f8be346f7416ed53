"""Tables of the terminal, and the same as plain text for pages."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

from rich import box
from rich.table import Table
from rich.text import Text


def table(
    title: str | None,
    heads: Sequence[str],
    rows: Iterable[Sequence[str]] = (),
    left: Sequence[str] = (),
    no_wrap: bool = False,
    **how: Any,
) -> Table:
    """Columns under their heads: numbers to the right, the words of the columns `left` to the left."""
    out = Table(box=box.SIMPLE_HEAD, title=title, **how)
    for head in heads:
        out.add_column(head, justify="left" if head in left else "right", no_wrap=no_wrap)
    for row in rows:
        out.add_row(*row)
    return out


def as_text(table: Table) -> tuple[list[str], list[tuple[str, ...]]]:
    """Headers and rows of a table without the terminal's colours."""
    columns = [[Text.from_markup(str(cell)).plain for cell in c.cells] for c in table.columns]
    return [str(c.header) for c in table.columns], list(zip(*columns, strict=True))
