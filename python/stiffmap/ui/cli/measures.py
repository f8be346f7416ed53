from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from rich import get_console
from rich.table import Table
from rich.text import Text

from stiffmap.common.outputs import make_folder
from stiffmap.ui.cli import options
from stiffmap.ui.cli.inputs import MM, gravity, in_si, machine_with, numbers, words
from stiffmap.ui.cli.options import BOX, how_many, option
from stiffmap.ui.cli.output import Answer, as_text, table as table_of, write_files
from stiffmap.workspace.maps.loading import machine_digest
from stiffmap.workspace.performance import MeasuresTable, measures
from stiffmap.workspace.performance.table import MeasureRow

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def command(
    machine: options.Machine,
    requirements: str | None = option("Requirements file, or a shipped one by name: trimming."),
    box: str | None = option("Box of TCP positions in mm: xmin,xmax,ymin,ymax,zmin,zmax."),
    force: float | None = option("Force on the tool for deflections, N."),
    plane: str | None = option("Plane of speeds, forces, deflections: xy, xz, yz."),
    only: str | None = option("Names of measures, separated by commas."),
    nodes: int = how_many("Nodes per edge for kinematic measures.", 51, most=BOX),
    coarse: int = how_many("Nodes per edge for deflection, frequency, acceleration.", 7, most=BOX),
    length: float | None = option("Characteristic length in mm, where units mix; default: the machine's."),
    toolpath: Path | None = option(
        "Motion file (CSV or YAML), or a shipped one (trim), for measures along the task's own path."
    ),
    clearance: float | None = option(
        "mm between members of different legs that workspace and largest box keep."
    ),
    deflection: float | None = option(
        "mm of deflection under the force that workspace and largest box keep to."
    ),
    effect: options.Effects = None,
    gravity_: options.Gravity = None,
    output: options.Folder = None,
    threads: options.Threads = None,
    scheduler: options.Scheduler = None,
) -> Answer:
    """All performance measures of a machine over a box: worst and best pose, requirement, margin.

    With -o: the table (JSON), pictures, and both as a page (report.html).

    Exit codes: 0 done, 1 a requirement does not hold, 2 bad input.

    Examples:
      [cyan]stiffmap measures orthoglide-revised --requirements trimming -o results[/cyan]
      [cyan]stiffmap measures ur10 --nodes 11 --force 50[/cyan]
      [cyan]stiffmap measures linear-delta --only largest_box,frequency --json[/cyan]
      [cyan]stiffmap measures orthoglide-revised --only workspace --clearance 60 --deflection 0.5[/cyan]
    """
    m = machine_with(machine, effect)
    limits = None if box is None else MM * numbers(box, "box", 6).reshape(3, 2).T
    table = measures(
        m, box=limits, force=force, plane=plane, requirements=requirements,
        only=words(only), nodes=nodes, coarse=coarse,
        length=in_si(length), gravity=gravity(gravity_), threads=threads, scheduler=scheduler,
        toolpath=toolpath, clearance=in_si(clearance),
        deflection=in_si(deflection),
    )  # fmt: skip
    files = [] if output is None else write(table, make_folder(output))
    return Answer(table.as_plain(), _told(table), files, finding=not table.passed)


def _told(table: MeasuresTable) -> Iterator[Table | Text | str]:
    yield as_table(table, narrow=get_console().width < WIDE)
    yield from (Text(note, "dim") for note in (*table.notes, *remarks(table)))
    if table.requirements.bounds:
        yield verdict_of(table)


WIDE = 100  # columns of a terminal from which on there is room between those of the table


def as_table(table: MeasuresTable, narrow: bool = False) -> Table:
    """A row per measure; narrow: whole within 80 columns."""
    c = table.case
    spans = ", ".join(
        f"{a} {1e3 * lo:.4g}…{1e3 * hi:.4g}" for a, lo, hi in zip("xyz", c.low, c.high, strict=True)
    )
    return table_of(
        f"{table.machine.name} over {spans} mm; plane {c.plane}, {c.force:.4g} N",
        ("measure", "worst", "unit", "at (mm)", "best", "required", "margin", ""),
        map(cells, table.rows),
        left=("measure", "unit", ""), no_wrap=True, padding=(0, 0 if narrow else 1), pad_edge=not narrow,
    )  # fmt: skip


def remarks(table: MeasuresTable) -> list[str]:
    """What the numbers need said next to them."""
    return [f"{r.measure.name}: {r.reason or r.found.note}" for r in table.rows if r.reason or r.found.note]


def cells(r: MeasureRow) -> tuple[str, ...]:
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
        "" if r.bound is None else r.bound.text(f),
        "" if np.isnan(r.margin) else f"{f * r.margin:+.4g}",
        verdict,
    )


def write(table: MeasuresTable, output: Path) -> list[Path]:
    """Table, maps and pictures."""
    from stiffmap.ui.plot.measures import measure_figures, moving_modes
    from stiffmap.ui.report.sheet import animation

    figures: dict[str, Figure | bytes] = {**measure_figures(table)}
    contents = {"measures.json": table.as_plain(), **{f"{name}.png": f for name, f in figures.items()}}
    if "modes" in figures:
        contents["modes.gif"] = figures["modes"] = animation(moving_modes(table))
    files = write_files(output, contents.items())
    return [*files, write_report(table, output / "report.html", figures)]


def write_report(table: MeasuresTable, path: Path, figures: dict[str, Figure | bytes]) -> Path:
    """The table as one page with its pictures."""
    from stiffmap.ui.plot.measures import caption
    from stiffmap.ui.report.sheet import ReportSheet, write_sheet

    text, title = as_table(table), f"Measures of {table.machine.name}"
    lines = [f"{text.title}.", *table.notes, *remarks(table)]
    sheet = ReportSheet(title, verdict_of(table), lines, *as_text(text), numbers=(2, 4, 5, 6, 7))
    digests = {f"machine {table.machine.name}, as loaded": machine_digest(table.machine)}
    return write_sheet(path, sheet, {caption(n): f for n, f in figures.items()}, digests)


def verdict_of(table: MeasuresTable) -> str:
    """Whether the machine meets what is required, in a sentence."""
    if not table.requirements.bounds:
        return f"{len(table.rows)} measures; nothing is required of them."
    missed = [r.measure.title for r in table.rows if r.verdict not in ("", "pass")]
    name = f"{table.machine.name} against {table.requirements.name}"
    return f"{name}: does not meet {', '.join(missed)}." if missed else f"{name}: meets all of it."
