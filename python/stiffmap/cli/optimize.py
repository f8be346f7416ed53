"""``stiffmap optimize``."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich import box
from rich.console import Console
from rich.table import Table

from stiffmap.cli.inputs import folder, plain
from stiffmap.cli.output import JsonOption, print_json

if TYPE_CHECKING:
    from stiffmap.design import ParetoSet


def optimize(
    design: Annotated[str, typer.Argument(help="Design file, or a shipped one by name: redesign.")],
    output: Annotated[
        Path, typer.Option("-o", "--output", help="Folder for results; resumed from there.")
    ] = Path("design"),
    generations: Annotated[int | None, typer.Option(help="Generations; default: the file's.")] = None,
    processes: Annotated[int | None, typer.Option(help="Processes; default: all cores.")] = None,
    as_json: JsonOption = False,
) -> None:
    """Machines that are best under several measures at once: a Pareto set, and chosen designs as machine files.

    Seeded. Killed at any moment, the same command goes on where it was. The folder gets the set
    (NetCDF), pictures, and a machine file for the best of each objective and for a compromise, which
    are measured again in full.

    Exit codes: 0 done, 1 a chosen design misses a requirement when measured in full, 2 bad input or
    no design meets all constraints.

    Examples:

      [cyan]stiffmap optimize redesign -o results/redesign[/cyan]

      [cyan]stiffmap optimize my_design.yaml --generations 5 --json[/cyan]
    """
    from stiffmap.cli.inputs import finish
    from stiffmap.design import load_design
    from stiffmap.design import optimize as search
    from stiffmap.design.report import measured

    console = Console(stderr=True, highlight=False)
    begun = time.monotonic()

    def tell(generation: int, count: int, volume: float, good: int) -> None:
        console.print(f"generation {generation}: {count} designs, {good} feasible, hypervolume {volume:.4f}")

    problem = load_design(design)
    place = folder(output)
    found = search(problem, folder=place, generations=generations, processes=processes, progress=tell)
    tables = measured(found, place)
    files = write(found, place)
    console.print(f"{found.evaluated} designs in {time.monotonic() - begun:.0f} s")
    if as_json:
        print_json(
            plain(
                {
                    "design": problem.model.name,
                    "evaluated": found.evaluated,
                    "front": len(found.x),
                    "chosen": {k: t.as_plain() for k, t in tables.items()},
                    "files": files,
                }
            )
        )
    else:
        out = Console(highlight=False)
        out.print(as_table(found, tables))
        out.print(
            f"wrote {', '.join(files)} and the machine files {', '.join(f'{k}.yaml' for k in tables if k != 'start')}",
            soft_wrap=True,
        )
    finish(not all(t.passed for k, t in tables.items() if k != "start"))


def write(found: ParetoSet, place: Path) -> list[str]:
    """The set and its pictures."""
    from stiffmap.design.pictures import front_figure, parallel_figure, progress_figure
    from stiffmap.maps.files import write_dataset
    from stiffmap.plot import save

    data = write_dataset(found.dataset, place / "pareto.nc")
    figures = {"fronts": front_figure, "parallel": parallel_figure, "progress": progress_figure}
    return [str(data), *(str(save(make(found), place / f"{name}.png")) for name, make in figures.items())]


def as_table(found: ParetoSet, tables: dict[str, Any]) -> Table:
    """Measures of the machine it started from and of the chosen designs, side by side."""
    out = Table(box=box.SIMPLE, title=f"{found.design.model.name}: measured in full")
    out.add_column("measure", no_wrap=True)
    for name in tables:
        out.add_column(name, justify="right", no_wrap=True)
    for i, row in enumerate(next(iter(tables.values())).rows):
        m = row.measure
        cells = []
        for t in tables.values():
            r = t.rows[i]
            mark = {"pass": "[green]", "fail": "[red]"}.get(r.verdict, "")
            text = f"{m.factor * r.found.worst:.4g}"
            cells.append(f"{mark}{text}[/]" if mark else text)
        out.add_row(f"{m.name} {m.shown}".strip(), *cells)
    return out
