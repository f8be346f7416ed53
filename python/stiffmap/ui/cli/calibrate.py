from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

from stiffmap.identification.calibration import Calibration, calibrate
from stiffmap.identification.inference.travel import Profile
from stiffmap.identification.numbers import Tolerances
from stiffmap.ui.cli import options
from stiffmap.ui.cli.inputs import words_of_all
from stiffmap.ui.cli.options import option, written
from stiffmap.ui.cli.output import Answer, write_files


def command(
    machine: options.Declared,
    data: options.Experiment,
    output: Path | None = written("Folder for calibration.json and table.txt."),
    tolerance: options.Spread = 1.0,
    exclude: list[str] | None = option("Group that is known to be right; separated by commas, or repeated."),
    budget: options.Budget = None,
    rows: int = option("Unknowns to list.", 20),
    seed: int = option("Seed of the folds.", 0),
    threads: options.Threads = None,
) -> Answer:
    """All uncertain numbers of a machine from readings at once, and which of them the readings can determine.

    Exit codes: 0 as declared or within tolerance, 1 beyond tolerance or unattributed, 2 bad input.

    Examples:
      [cyan]stiffmap calibrate ur10 experiments/tracker -o result[/cyan]
      [cyan]stiffmap calibrate linear-delta experiments/heights --exclude gains --tolerance 2[/cyan]
    """
    result = calibrate(
        machine, data, tolerances=Tolerances().scaled(tolerance), exclude=words_of_all(exclude), time_limit=budget,
        seed=seed, threads=threads,
    )  # fmt: skip
    if output is not None:
        write(result, output)
    table = result.table(rows)
    more = len(result.rows) - (len(table) - 1)
    if more:
        table.append(f"… {more} more, which the readings determine less well (--rows {len(result.rows)})")
    beyond = result.verdict not in ("as declared", "adjusted within tolerance")
    return Answer(result.as_plain(), [*result.lines(), "", *table], finding=beyond)


def write(result: Calibration, folder: Path) -> None:
    """All files of a calibration; raises `FileError` where the folder cannot be written."""
    text = "\n".join([*result.lines(), "", *result.table()]) + "\n"
    contents = {"calibration.json": result.as_plain(), "table.txt": text, "machine.yaml": result.machine}
    travel = {"travel.csv": profiles(result.profiles)} if result.profiles else {}
    write_files(folder, (contents | travel).items())


def profiles(found: Sequence[Profile]) -> tuple[list[str], list[list[str]]]:
    """Header and rows of the errors along the drives' travel, in mm and degrees."""
    out = []
    for p in found:
        factor, unit = (1e3, "mm") if p.unit == "m" else (180.0 / math.pi, "deg")
        for values in zip(p.at, p.error, p.sigma, strict=True):
            out.append([p.drive, *(f"{factor * v:.6g}" for v in values), unit])
    return ["drive", "coordinate", "error", "sigma", "unit"], out
