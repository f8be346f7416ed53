from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table
from rich.text import Text

from stiffmap.common.errors import StiffmapError
from stiffmap.common.outputs import make_folder
from stiffmap.ui.cli import options
from stiffmap.ui.cli.options import argument, how_many, option, written
from stiffmap.ui.cli.output import Answer, table, write_files
from stiffmap.workspace.design import ParetoSet, load_design, optimize
from stiffmap.workspace.design.chosen import NOTHING, ComparedDesigns, measured


def command(
    design: str = argument("Design file, or a shipped one by name: redesign."),
    output: Path = written("Folder for results; resumed from there.", Path("design")),
    generations: int | None = how_many("Generations; default: the file's."),
    processes: int | None = option("Processes; default: all cores."),
    scheduler: options.Scheduler = None,
) -> Answer:
    """Machines that are best under several measures at once: a Pareto set, and chosen designs as machine files.

    Seeded. Killed at any moment, the same command goes on where it was. The folder gets the set
    (NetCDF), pictures, and a machine file for the best of each objective and for a compromise, which
    are measured again in full.

    Exit codes: 0 done, 1 a chosen design misses a requirement when measured in full, 2 bad input or
    no design meets all constraints.

    Examples:
      [cyan]stiffmap optimize redesign -o results/redesign[/cyan]
      [cyan]stiffmap optimize my_design.yaml --generations 5 --json[/cyan]
      [cyan]stiffmap optimize redesign --scheduler tcp://HOST:8786 -o results/redesign[/cyan]
    """
    console = Console(stderr=True, highlight=False)
    begun = time.monotonic()

    def tell(generation: int, count: int, volume: float, good: int) -> None:
        console.print(f"generation {generation}: {count} designs, {good} feasible, hypervolume {volume:.4f}")

    problem = load_design(design)
    place = make_folder(output)
    found = optimize(
        problem,
        folder=place,
        generations=generations,
        processes=processes,
        progress=tell,
        scheduler=scheduler,
    )
    report = measured(found, place)
    files = write_files(place, _files(found, report))
    console.print(f"{found.evaluated} designs in {time.monotonic() - begun:.0f} s")
    data = {"design": problem.model.name, "evaluated": found.evaluated, "front": len(found.x)}
    data |= report.as_plain() | {"files": files}
    lines = (Text(line, "dim") for line in report.lines())
    machines = ", ".join(f"{k}.yaml" for k in report.chosen)
    wrote = f"wrote {', '.join(map(str, files))} and the machine files {machines}"
    missed = not all(c.table.passed for c in report.chosen.values())
    return Answer(data, [as_table(found, report), *lines, wrote], finding=missed)


def _files(found: ParetoSet, report: ComparedDesigns) -> Iterator[tuple[str, Any]]:
    from stiffmap.ui.plot.design import comparison_figure, front_figure, parallel_figure, progress_figure
    from stiffmap.ui.plot.measures import path_measures_figure

    yield "pareto.nc", found.dataset
    figures = {"fronts": front_figure, "parallel": parallel_figure, "progress": progress_figure}
    yield from ((f"{name}.png", make(found)) for name, make in figures.items())
    with suppress(StiffmapError):  # no measure with a map is asked for
        yield "beside.png", comparison_figure(report.tables)
    with suppress(StiffmapError):  # no toolpath
        yield "toolpath.png", path_measures_figure(report.tables)


def as_table(found: ParetoSet, report: ComparedDesigns) -> Table:
    """Measures of the reference machines and of the chosen designs, with the standard deviations that tolerances give."""
    tables = report.tables
    out = table(
        f"{found.design.model.name}: measured in full, ± by tolerances",
        ("measure", *tables), left=("measure",), padding=(0, 0, 0, 1), pad_edge=False,
    )  # fmt: skip
    out.columns[0].no_wrap = True
    for column in out.columns[1:]:
        column.overflow = "fold"
    for i, row in enumerate(next(iter(tables.values())).rows):
        m = row.measure
        cells = []
        for name, t in tables.items():
            r = t.rows[i]
            mark = {"pass": "[green]", "fail": "[red]"}.get(r.verdict, "")
            text = "–" if r.reason else f"{m.factor * r.found.worst:.4g}"
            chosen = report.chosen.get(name)
            robust = None if chosen is None else chosen.robust
            spread = 0.0 if robust is None else robust.first_order.get(m.name, 0.0)
            if spread > NOTHING * abs(r.found.worst):
                text += f" ± {m.factor * spread:.2g}"
            cells.append(f"{mark}{text}[/]" if mark else text)
        out.add_row(f"{m.name} {m.shown}".strip(), *cells)
    shares = [c.robust for c in report.chosen.values()]
    if any(r is not None for r in shares):
        met = ("" if r is None else f"{100 * r.meets:.0f}" for r in shares)
        out.add_row("meets all (drawn) %", *[""] * len(report.others), *met)
    return out
