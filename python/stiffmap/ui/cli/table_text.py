"""Tables of the terminal as plain text, for pages."""

from __future__ import annotations

from rich.table import Table
from rich.text import Text


def as_text(table: Table) -> tuple[list[str], list[tuple[str, ...]]]:
    """Headers and rows of a table without the terminal's colours."""
    columns = [[Text.from_markup(str(cell)).plain for cell in c.cells] for c in table.columns]
    return [str(c.header) for c in table.columns], list(zip(*columns, strict=True))
