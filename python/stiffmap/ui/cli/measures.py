"""``stiffmap measures``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import numpy as np
import typer
from rich import box as borders
from rich.console import Console
from rich.table import Table

from stiffmap.common.outputs import make_folder, write_text, writing
from stiffmap.common.plain import plain
from stiffmap.ui.cli.inputs import (
    MM,
    EffectsOption,
    FolderOption,
    GravityOption,
    MachineArgument,
    ThreadsOption,
    finish,
    gravity,
    machine_with,
    numbers,
)
from stiffmap.ui.cli.output import JsonOption, print_json
from stiffmap.ui.cli.table_text import as_text

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from stiffmap.workspace.performance import MeasuresTable
    from stiffmap.workspace.performance.table import Row


def measures(
    machine: MachineArgument,
    requirements: Annotated[
        str | None, typer.Option(help="Requirements file, or a shipped one by name: trimming.")
    ] = None,
    box: Annotated[
        str | None, typer.Option(help="Box of TCP positions in mm: xmin,xmax,ymin,ymax,zmin,zmax.")
    ] = None,
    force: Annotated[float | None, typer.Option(help="Force on the tool for deflections, N.")] = None,
    plane: Annotated[
        str | None, typer.Option(help="Plane of speeds, forces, deflections: xy, xz, yz.")
    ] = None,
    only: Annotated[str | None, typer.Option(help="Names of measures, separated by commas.")] = None,
    nodes: Annotated[int, typer.Option(help="Nodes per edge for kinematic measures.")] = 51,
    coarse: Annotated[int, typer.Option(help="Nodes per edge for deflection, frequency, acceleration.")] = 7,
    length: Annotated[
        float | None,
        typer.Option(help="Characteristic length in mm, where units mix; default: the machine's."),
    ] = None,
    toolpath: Annotated[
        Path | None,
        typer.Option(
            help="Motion file (CSV or YAML), or a shipped one (trim), for measures along the task's own path."
        ),
    ] = None,
    clearance: Annotated[
        float | None,
        typer.Option(help="mm between members of different legs that workspace and largest box keep."),
    ] = None,
    deflection: Annotated[
        float | None,
        typer.Option(help="mm of deflection under the force that workspace and largest box keep to."),
    ] = None,
    effect: EffectsOption = None,
    gravity_: GravityOption = None,
    output: FolderOption = None,
    threads: ThreadsOption = None,
    as_json: JsonOption = False,
) -> None:
    """All performance measures of a machine over a box: worst and best pose, requirement, margin.

    With -o: the table (JSON), pictures, and both as a page (report.html).

    Exit codes: 0 done, 1 a requirement does not hold, 2 bad input.

    Examples:

      [cyan]stiffmap measures orthoglide-revised --requirements trimming -o results[/cyan]

      [cyan]stiffmap measures ur10 --nodes 11 --force 50[/cyan]

      [cyan]stiffmap measures linear-delta --only largest_box,frequency --json[/cyan]

      [cyan]stiffmap measures orthoglide-revised --only workspace --clearance 60 --deflection 0.5[/cyan]
    """
    from stiffmap.workspace.performance import measures as all_of

    m = machine_with(machine, effect)
    limits = None if box is None else MM * numbers(box, "box", 6).reshape(3, 2).T
    table = all_of(
        m, box=limits, force=force, plane=plane, requirements=requirements,
        only=None if only is None else [n.strip() for n in only.split(",")], nodes=nodes, coarse=coarse,
        length=None if length is None else MM * length, gravity=gravity(gravity_), threads=threads,
        toolpath=toolpath, clearance=None if clearance is None else MM * clearance,
        deflection=None if deflection is None else MM * deflection,
    )  # fmt: skip
    files = write(table, make_folder(output)) if output else []
    if as_json:
        print_json({**plain(table.as_plain()), "files": files})
    else:
        show(table, files)
    finish(not table.passed)


def show(table: MeasuresTable, files: list[str]) -> None:
    """The table as text."""
    console = Console(highlight=False)
    console.print(as_table(table, narrow=console.width < WIDE))
    for note in (*table.notes, *remarks(table)):
        console.print(f"[dim]{note}[/dim]", soft_wrap=True)
    if table.requirements.bounds:
        missed = [r.measure.name for r in table.rows if r.verdict not in ("", "pass")]
        verdict = f"does not meet: {', '.join(missed)}" if missed else "meets all of it"
        console.print(f"{table.machine.name} against {table.requirements.name}: {verdict}", soft_wrap=True)
    if files:
        console.print(f"wrote {', '.join(files)}", soft_wrap=True)


WIDE = 100
"""Columns of a terminal from which on there is room between those of the table."""


def as_table(table: MeasuresTable, narrow: bool = False) -> Table:
    """A row per measure; narrow: whole within 80 columns."""
    c = table.case
    spans = ", ".join(
        f"{a} {1e3 * lo:.4g}…{1e3 * hi:.4g}" for a, lo, hi in zip("xyz", c.low, c.high, strict=True)
    )
    out = Table(
        box=borders.SIMPLE,
        padding=(0, 0 if narrow else 1),
        pad_edge=not narrow,
        title=f"{table.machine.name} over {spans} mm; plane {c.plane}, {c.force:.4g} N",
    )
    for name in ("measure", "worst", "unit", "at (mm)", "best", "required", "margin", ""):
        left = name in ("measure", "unit", "")
        out.add_column(name, justify="left" if left else "right", no_wrap=True)
    for r in table.rows:
        out.add_row(*cells(r))
    return out


def remarks(table: MeasuresTable) -> list[str]:
    """What the numbers need said next to them."""
    return [f"{r.measure.name}: {r.reason or r.found.note}" for r in table.rows if r.reason or r.found.note]


def cells(r: Row) -> tuple[str, ...]:
    """What the table shows of a measure."""
    f, unit = r.measure.factor, r.measure.shown
    colours = {"pass": "green", "fail": "red", "unknown": "yellow"}
    verdict = f"[{colours[r.verdict]}]{r.verdict}[/]" if r.verdict in colours else ""
    return (
        r.measure.name,
        "–" if np.isnan(r.found.worst) else f"{f * r.found.worst:.5g}",
        unit,
        "" if r.found.worst_at is None else " ".join(f"{1e3 * v:.0f}" for v in r.found.worst_at),
        "" if np.isnan(r.found.best) else f"{f * r.found.best:.4g}",
        required(r),
        "" if np.isnan(r.margin) else f"{f * r.margin:+.4g}",
        verdict,
    )


def required(r: Row) -> str:
    """``≥ 500`` and the like."""
    if r.bound is None:
        return ""
    sides = [("≥", r.bound.at_least), ("≤", r.bound.at_most)]
    return " ".join(f"{sign} {r.measure.factor * v:.4g}" for sign, v in sides if v is not None)


def write(table: MeasuresTable, output: Path) -> list[str]:
    """Table, maps and pictures."""
    import json

    from stiffmap.ui.plot import save
    from stiffmap.ui.plot.measures import measure_figures, moving_modes
    from stiffmap.ui.report.pictures import animation

    data = output / "measures.json"
    write_text(data, json.dumps(plain(table.as_plain()), indent=2, ensure_ascii=False))
    figures = measure_figures(table)
    pictures = [save(f, output / f"{name}.png") for name, f in figures.items()]
    shown: dict[str, Figure | bytes] = {**figures}
    if "modes" in figures:
        swinging = animation(moving_modes(table))
        shown["modes"] = swinging
        moving = output / "modes.gif"
        with writing(moving) as fresh:
            fresh.write_bytes(swinging)
        pictures.append(moving)
    return [str(p) for p in (data, *pictures, write_report(table, output / "report.html", shown))]


def write_report(table: MeasuresTable, path: Path, figures: dict[str, Figure | bytes]) -> Path:
    """The table as one page with its pictures."""
    from stiffmap.ui.plot.measures import caption
    from stiffmap.ui.report.sheet import Sheet, write_sheet
    from stiffmap.workspace.maps.provenance import machine_digest

    text = as_table(table)
    head, rows = as_text(text)
    sheet = Sheet(
        title=f"Measures of {table.machine.name}",
        answer=verdict_of(table),
        lines=[f"{text.title}.", *table.notes, *remarks(table)],
        head=head,
        rows=rows,
        numbers=(2, 4, 5, 6, 7),
    )
    digests = {f"machine {table.machine.name}, as loaded": machine_digest(table.machine)}
    return write_sheet(path, sheet, {caption(n): f for n, f in figures.items()}, digests)


def verdict_of(table: MeasuresTable) -> str:
    """Whether the machine meets what is required, in a sentence."""
    if not table.requirements.bounds:
        return f"{len(table.rows)} measures; nothing is required of them."
    missed = [r.measure.title for r in table.rows if r.verdict not in ("", "pass")]
    name = f"{table.machine.name} against {table.requirements.name}"
    return f"{name}: does not meet {', '.join(missed)}." if missed else f"{name}: meets all of it."
