"""The table of statements for people and for programs."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from rich import box
from rich.table import Table

from stiffmap.paper.statement import Statement, Verdict

COLOUR = {Verdict.AGREES: "green", Verdict.DIFFERS: "yellow", Verdict.NOT_CHECKED: "dim"}
HEAD = ("§", "the paper's words", "our number", "verdict", "because")


def as_rich(statements: Sequence[Statement]) -> Table:
    """For the terminal."""
    table = Table(*HEAD, box=box.SIMPLE_HEAD, show_lines=True)
    for s in statements:
        table.add_row(s.section, s.words, s.ours, f"[{COLOUR[s.verdict]}]{s.verdict}[/]", s.because)
    return table


def as_markdown(statements: Sequence[Statement]) -> str:
    """For documents."""
    rows = [HEAD, ("---",) * len(HEAD), *(cells(s) for s in statements)]
    return "\n".join("| " + " | ".join(c.replace("|", "\\|") for c in row) + " |" for row in rows) + "\n"


def as_csv(statements: Sequence[Statement]) -> str:
    """For spreadsheets."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(["section", *HEAD[1:]])
    writer.writerows(cells(s) for s in statements)
    return out.getvalue()


def as_plain(statements: Sequence[Statement]) -> list[dict[str, Any]]:
    """For JSON."""
    return [asdict(s) for s in statements]


def cells(s: Statement) -> tuple[str, ...]:
    """One row."""
    return (s.section, s.words, s.ours, str(s.verdict), s.because)


def count(statements: Sequence[Statement]) -> dict[str, int]:
    """Number of statements per verdict."""
    return {str(v): sum(s.verdict == v for s in statements) for v in Verdict}
