from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from stiffmap.common.outputs import make_folder
from stiffmap.ui.cli import options
from stiffmap.ui.cli.options import PLANE, how_many, option, written
from stiffmap.ui.cli.output import Answer, write_files
from stiffmap.ui.paper import Results, Statement, all_statements, compute
from stiffmap.ui.paper.results import all_figures
from stiffmap.ui.paper.statement import as_markdown, as_rich, as_table, count, count_text

NO_CURVES = "The paper prints no numbers of the curves in Figures 5 to 7; the numbers above are those of its text and Table 1."


def command(
    output: Path | None = written("Folder for figures and tables."),
    points: int = how_many("Positions along x and y of the error maps.", 101, most=PLANE),
    figures: bool = option("Draw Figures 5 to 7 (with -o).", True),
    threads: options.Threads = None,
    as_json: options.Json = False,
) -> Answer:
    """Reproduce the paper's application: Figures 5a–h, 6, 7 and every quantitative statement of §5.2 and §5.3.

    Each statement has the paper's words and number, our number and a verdict: agrees, differs because …, or cannot be
    checked because …; agreement with a number that our model took from the paper is marked as such. With -o: the figures (PNG) and the table (CSV, Markdown).

    Exit codes: 0 done (whatever the verdicts), 2 bad input.

    Examples:
      [cyan]stiffmap paper -o results[/cyan]
      [cyan]stiffmap paper --json[/cyan]
      [cyan]stiffmap paper --points 31 --no-figures -o results[/cyan]
    """
    target = make_folder(output) if output else None
    results = compute(points, threads=threads, progress=False if as_json else None)
    statements = all_statements(results)
    files = write_files(target, _files(results, statements, figures))
    told = [as_rich(statements), count_text(statements), NO_CURVES]
    return Answer({"statements": statements, "count": count(statements)}, told, files)


def _files(results: Results, statements: list[Statement], figures: bool) -> Iterator[tuple[str, Any]]:
    yield from all_figures(results).items() if figures else ()
    yield "statements.csv", as_table(statements)
    yield "statements.md", as_markdown(statements)
