from __future__ import annotations

from pathlib import Path

from stiffmap.machining.process import identify_process, load_process
from stiffmap.ui.cli import options
from stiffmap.ui.cli.options import argument, option, written
from stiffmap.ui.cli.output import Answer


def command(
    table: options.TablePath = argument(
        "CSV file or workbook: feed_per_tooth_mm, Fx_N, Fy_N, Fz_N, teeth, axial_mm; side, radial_mm, diameter_mm, "
        "helix_deg, spindle_rpm; time_s. Also feed (mm/min), Fx (kN) …"
    ),
    base: str | None = option(
        "Process file or shipped name: tool, cut and speed that no column has.", None, "--process"
    ),
    output: Path | None = written("Process file, for mill, lobes, map and so on."),
) -> Answer:
    """Coefficients of the cutting force from a dynamometer's table.

    A row is a cut with its mean forces or, with a column of time, a sample. Every number has its 95 % interval. The straight
    law, Kienzle's and, from signals, run-out are judged by their errors at feeds that were left out.

    Examples:
      [cyan]stiffmap process forces.csv[/cyan]
      [cyan]stiffmap process forces.csv --process slot -o process.yaml[/cyan]
    """
    given = None if base is None else load_process(base)
    law = identify_process(table, given)
    files = [] if output is None else [law.save(output, given)]
    return Answer(law.to_dict(), law.words(), files)
