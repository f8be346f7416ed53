from __future__ import annotations

from stiffmap.common.outputs import make_folder
from stiffmap.experiment import residual
from stiffmap.identification.validity import beyond
from stiffmap.solve.machine import load_machine
from stiffmap.ui.cli import options
from stiffmap.ui.cli.options import option
from stiffmap.ui.cli.output import Answer, write_files


def command(
    machine: options.Declared,
    data: options.Experiment,
    rows: int = option("Number of worst rows to print.", 5),
    effect: options.Effects = None,
    output: options.Folder = None,
    threads: options.Threads = None,
) -> Answer:
    """Prediction for every reading: rms, per axis, worst rows, noise, lack of fit, model-free checks.

    With -o: residual.csv (mm, rad), residual.json (SI) and pictures. Exit codes: 0 the readings are as
    predicted, 1 they are not (p-value below 1e-3), 2 bad input.

    Examples:
      [cyan]stiffmap residual orthoglide-revised experiments/servo[/cyan]
      [cyan]stiffmap residual orthoglide-revised experiments/servo --rows 20 -o result[/cyan]
      [cyan]stiffmap residual orthoglide-revised experiments/servo --effect 'compliance actuator z scale=2.1'[/cyan]
    """
    declared = load_machine(machine)
    result = residual(declared, data, effect or (), threads=threads)
    if output is not None:
        from stiffmap.ui.plot.experiment import figures

        result.write_table(make_folder(output) / "residual.csv")
        pictures = ((f"{name}.png", figure) for name, figure in figures(result).items())
        write_files(output, [("residual.json", result.as_plain(rows)), *pictures])
    far = beyond(declared, result.experiment)
    found, told = result.as_plain(rows), result.lines(rows)
    if far is not None:
        found["rows_beyond_calibration"] = int(far.sum())
        told.append(f"  beyond what the machine was calibrated by: {int(far.sum())} of {len(far)} rows")
    return Answer(found, told, finding=result.lack_of_fit < 1e-3)
