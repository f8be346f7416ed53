"""The statements for people and for programs."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence

from rich.console import Group, RenderableType
from rich.markup import escape
from rich.padding import Padding
from rich.text import Text

from stiffmap.ui.paper.statement import Statement, StatementVerdict

COLOUR = {
    StatementVerdict.AGREES: "green",
    StatementVerdict.DIFFERS: "yellow",
    StatementVerdict.NOT_CHECKED: "dim",
}
HEAD = ("§", "the paper's words", "the paper's number", "our number", "verdict", "our own input", "because")
INDENT = 5


def as_rich(statements: Sequence[Statement]) -> RenderableType:
    """For a terminal of any width: a paragraph for each statement."""
    out: list[RenderableType] = []
    for s in statements:
        lines = [f"§{s.section} [bold]“{escape(s.words)}”[/]"]
        lines.append(
            f"paper: {escape(s.printed)}; ours: {escape(s.ours)}: [{COLOUR[s.verdict]}]{verdict_text(s)}[/]"
        )
        lines += [f"[dim]{escape(s.because)}[/]"] if s.because else []
        out += [Padding(Text.from_markup(t), (0, 0, 0, INDENT if i else 0)) for i, t in enumerate(lines)]
        out.append(Text(""))
    return Group(*out)


def verdict_text(s: Statement) -> str:
    """The verdict, and whether agreement is more than our own input."""
    return f"{s.verdict}, but it is an input of our model" if s.own_input else str(s.verdict)


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


def cells(s: Statement) -> tuple[str, ...]:
    """One row."""
    return (
        s.section,
        s.words,
        s.printed,
        s.ours,
        str(s.verdict),
        "yes" if s.own_input else "no",
        s.because,
    )


def count(statements: Sequence[Statement]) -> dict[str, int]:
    """Number of statements per verdict."""
    return {str(v): sum(s.verdict == v for s in statements) for v in StatementVerdict}


def count_text(statements: Sequence[Statement]) -> str:
    """The numbers per verdict, and how many agreeing ones are inputs of our model."""
    own = sum(s.own_input and s.verdict is StatementVerdict.AGREES for s in statements)
    n = count(statements)
    return (
        f"{n['agrees']} agree ({own} of them are inputs of our model, {n['agrees'] - own} are results), "
        f"{n['differs']} differ, {n['cannot be checked']} cannot be checked"
    )
