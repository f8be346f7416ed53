from __future__ import annotations

import sys
from collections.abc import Sequence
from functools import partial
from pathlib import Path

import typer

from stiffmap.common.outputs import write_text
from stiffmap.identification.diagnosis import Diagnosis, diagnose
from stiffmap.identification.diagnosis.report.sentences import next_step
from stiffmap.identification.numbers import Tolerances
from stiffmap.ui.cli import options
from stiffmap.ui.cli.inputs import refuse_unused, words_of_all
from stiffmap.ui.cli.options import flag, option, written
from stiffmap.ui.cli.output import Answer, write_files


def command(
    context: typer.Context,
    machine: options.Declared,
    data: options.Experiment,
    output: Path | None = written("Folder for report and files."),
    seed: int = option("Seed of the folds, and of the poses drawn of many.", 0),
    threads: options.Threads = None,
    exclude: list[str] | None = option("Kinds of effects or groups of numbers known not to be; repeatable."),
    budget: options.Budget = None,
    tolerance: options.Spread = 1.0,
    date: str | None = option("Date that the report bears, as you write it."),
    quiet: bool = flag("Say nothing of what is being tried.", "--quiet"),
    as_json: options.Json = False,
) -> Answer:
    """Which physical effect a machine lacks, where it sits, how large it is, and how sure that is.

    With -o: diagnosis.json (SI), report.html (all inside), machine.yaml (corrected), pictures.
    Ctrl-C ends the search: what was found by then is the answer.
    Exit codes: 0 verdict none, 1 verdict with findings, 2 bad input.

    Examples:
      [cyan]stiffmap diagnose orthoglide-revised experiments/servo -o result[/cyan]
      [cyan]stiffmap diagnose my.yaml dial_gauges --date 2025-03-14 -o result[/cyan]
      [cyan]stiffmap diagnose ur10 tracker --exclude sensor_gain --budget 60[/cyan]
    """
    refuse_unused(context, {"without output": "date"})
    silent = quiet or as_json or not sys.stderr.isatty()
    result = diagnose(
        machine, data, seed=seed, threads=threads, exclude=words_of_all(exclude), time_limit=budget,
        tolerances=Tolerances().scaled(tolerance),
        progress=None if silent else partial(print, "trying:", file=sys.stderr),
    )  # fmt: skip
    if output is not None:
        write(result, output, date, [p for p in (Path(machine), Path(data)) if p.exists()])
    wrote = None if output is None else f"wrote {output}: start with report.html"
    lines = [str(result), f"next: {next_step(result)}", wrote]
    return Answer(result.as_plain(), lines, finding=result.verdict != "none")


def write(result: Diagnosis, folder: Path, date: str | None = None, inputs: Sequence[Path] = ()) -> None:
    """All files of a diagnosis; raises `FileError` where the folder cannot be written."""
    from stiffmap.ui.report.diagnosis.page import html
    from stiffmap.ui.report.diagnosis.pictures import figures

    made = figures(result)
    pictures = ((f"{name}.png", figure) for name, figure in made.items())
    write_files(folder, [("diagnosis.json", result.as_plain()), ("machine.yaml", result.machine), *pictures])
    write_text(folder / "report.html", html(result, made, date=date, inputs=inputs))
