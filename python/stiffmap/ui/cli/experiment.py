"""``stiffmap experiment``: from a spreadsheet to an experiment folder."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator, Sequence
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import typer
from rich.text import Text

from stiffmap.common.errors import StiffmapError
from stiffmap.common.tables.table_file import table_file
from stiffmap.experiment.noise.level import unknown
from stiffmap.experiment.spreadsheet.dh import ASSUMED
from stiffmap.experiment.spreadsheet.from_table import FromTable, experiment_from_table
from stiffmap.experiment.spreadsheet.guess import Column
from stiffmap.ui.cli import options
from stiffmap.ui.cli.inputs import numbers, options_given, pairs, refuse_unused
from stiffmap.ui.cli.options import argument, flag, option, written
from stiffmap.ui.cli.output import Answer, table as table_of


def command(
    context: typer.Context,
    action: str = argument("new: make a folder from a spreadsheet."),
    file: options.TablePath = argument(
        "Spreadsheet: .xlsx, .xls, .ods, .csv, .txt (any separator and decimal sign)."
    ),
    more: list[Path] | None = argument(
        "Further tables whose rows are of the same points, such as what a tracker read.", None
    ),
    output: Path = written("Folder of the experiment.", ...),
    machine: str | None = option("Declared machine: shipped name or machine file; or give --dh."),
    dh: Path | None = option(
        "Instead: table of Denavit and Hartenberg of a serial arm, of which machine.yaml is made.",
        None,
        "--dh",
    ),
    dh_convention: options.DhConvention = "standard",
    difference: str = option(
        "What differences in the file are: actual-minus-target or target-minus-actual.", "actual-minus-target"
    ),
    quantity: str | None = option(
        "deflection (loaded minus unloaded) or position (measured minus commanded). "
        "[default: the instrument's, else deflection]"
    ),
    instrument: str | None = option(
        "What wrote the file: tracker, dial-gauges, ball-bar, iso-9283, or a mapping file."
    ),
    constant: list[str] | None = option("What is the same in all rows, mm and N, e.g. z=0.", None, "--set"),
    noise: list[str] | None = option("One standard deviation of a reading in its unit, e.g. dx=2."),
    record: list[str] | None = option(
        "For the report: operator, instrument, certificate, date, temperature or notes, e.g. operator=Miller."
    ),
    dialogue: bool = flag("Ask what cannot be guessed, and remember the answers.", "--dialogue"),
    overwrite: options.Overwrite = False,
) -> Answer:
    """Make an experiment of a spreadsheet: columns, units and repeats are understood and described in words.

    Units stand in brackets in the header. The header may come after other lines; n/a, - and empty cells were not
    read; further columns go to notes.csv. Exit codes: 0 done, 2 bad input, or a question that --map answers.

    Examples:
      [cyan]stiffmap experiment new readings.xlsx --machine five-bar --noise dx=1 --noise dy=1 -o readings[/cyan]
      [cyan]stiffmap experiment new points.csv --instrument tracker --machine hexapod --noise dx=0.01 -o points[/cyan]
      [cyan]stiffmap experiment new joints.csv --dh arm_dh.csv --unit joints=deg --noise dx=0.03 -o arm_readings[/cyan]
      [cyan]stiffmap experiment new readings.xlsx --machine five-bar --dialogue --noise dx=1 --noise dy=1 -o asked[/cyan]
      [cyan]stiffmap experiment new clocks.csv --machine five-bar --map dx='Uhr 1|Uhr 2' --set z=0 -o clocks[/cyan]
    """
    if action != "new":
        raise StiffmapError(f"experiment: expected 'new', got '{action}'")
    refuse_unused(context, {"without dh": "dh_convention"})
    table = table_file(file)
    made = experiment_from_table(
        machine, [table.path, *(more or ())], output, columns=table.columns, units=table.units, constants=_numbers(constant, "set"), noise=_numbers(noise, "noise"), dh=dh, dh_convention=dh_convention,
        difference=difference, quantity=quantity, instrument=instrument, sheet=table.sheet, header=table.header,
        which=table.which, record=pairs(record, "record"),
        ask=_prompt if dialogue else None, overwrite=overwrite,
    )  # fmt: skip
    found, names = made.understood, made.sheet.header
    data = {"folder": output, "rows": len(made.experiment), "repeats": found.rows.repeats,
            "columns": {names[c.index]: c.meaning for c in found.columns}, "units": found.units,
            "warnings": made.warnings}  # fmt: skip
    warnings = [Text(f"WARNING: {line}", "bold red") for line in made.warnings]
    assumed = [ASSUMED] if dh is not None and "dh_convention" not in options_given(context) else []
    return Answer(data, [*warnings, *assumed, *made.remarks, *_told(made, context.obj)])


def _prompt(text: str) -> str:
    try:
        return input(f"{text} ")
    except EOFError:
        raise StiffmapError(
            "--dialogue: a question is left and nobody answers; say it by --map, --unit or --set"
        ) from None


def _used(column: Column, table: FromTable) -> bool:
    """Whether the name of another column says that it was made of this one."""
    name = re.escape(column.name)
    made = re.compile(rf"([+-]|.* (less|of) ){name}(?!\w).*|{name} (less .*|along [xyz]|in use).*")
    return any(made.fullmatch(c.name) for c in table.understood.columns if c.meaning != "note")


def _told(table: FromTable, words: Sequence[str]) -> Iterator[Any]:
    """What each column was taken for, the first rows, and what to do next; `words` are those of this command."""
    found, header, made = table.understood, table.sheet.header, table.experiment
    commands = table.commanded.columns if table.commanded else {}
    for c in found.columns:
        if c.meaning in commands:
            said = f"command of {', '.join(commands[c.meaning])}"
        elif c.meaning == "note":
            said = "other columns are made of it" if _used(c, table) else "kept in notes.csv"
        else:
            said = f"repeat {c.repeat} of {c.meaning}" if c.repeat else c.meaning
            said += f", {found.units.get(c.meaning, 'no unit')}"
            if c.meaning in found.factors:
                factor = f"{found.factors[c.meaning]:.9g} {found.units[c.meaning]}"
                said += f" ({c.unit or 'one'} of the sheet: {factor})"
        yield f"'{header[c.index]}': {said}"
    for name, value in found.constants.items():
        yield f"{name} = {value:g} in every row"
    # what was seen is no deviation before the frame is known
    if commands or made.seen is not None or made.absolute:
        head: Sequence[str] = found.rows.header
        rows: Any = (
            [f"{c:.7g}" if isinstance(c, float) else str(c) for c in row]
            for row in islice(iter(found.rows), 3)
        )
    else:
        from stiffmap.experiment.notebook import experiment_rows

        head, rows = experiment_rows(made)
    yield table_of("the first rows, as understood", head, rows, padding=(0, 1, 0, 0))
    poses = int(made.groups.max()) + 1
    read = [p if (p := c.replace("d", "p", 1)) in found.rows.header else c for c in made.axes]
    yield f"{table.folder}: {len(made)} rows of {made.quantity} at {poses} poses; reads {', '.join(read)}"
    declared = np.all(~made.read | (made.sigma > 0), axis=0)
    each = zip(made.channels, declared, made.axis_read, strict=True)
    silent = [c.name for c, known, read in each if read and not known]
    if silent:
        yield f"no noise of {', '.join(silent)} is declared: repeats must show it (five or more), or say --noise {silent[0]}=…"
    then = f"stiffmap residual {table.machine} {table.folder}"
    if lost := unknown(made):  # which no command would take
        again = ["stiffmap", *words, *(() if "--overwrite" in words else ["--overwrite"])]
        own = {c for c in lost if {c, c.replace("d", "p", 1)} & found.factors.keys()}
        units = {c: "the unit of the sheet" if c in own else found.units.get(c, "mm") for c in lost}
        then = " ".join([shlex.join(again), *(f"--noise {c}=<one sigma in {u}>" for c, u in units.items())])
    yield Text.assemble("next: ", (then, "cyan"))


def _numbers(given: Sequence[str] | None, name: str) -> dict[str, float]:
    return {k: float(numbers(v, f"{name} {k}", 1)[0]) for k, v in pairs(given, name).items()}
