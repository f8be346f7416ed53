"""``stiffmap compensate``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from stiffmap.common.errors import StiffmapError
from stiffmap.common.outputs import write_text, writing
from stiffmap.common.outputs.option import written
from stiffmap.experiment.comparison.prediction_error import left_by
from stiffmap.experiment.experiment import Experiment, Mask
from stiffmap.experiment.files.load import load_experiment
from stiffmap.experiment.files.plan_file import load_plan
from stiffmap.experiment.poses.orientation import against_base
from stiffmap.experiment.prediction.predict import Predictor
from stiffmap.identification.validity import beyond
from stiffmap.machining.compensation import (
    axis_errors,
    axis_errors_of_map,
    compensate,
    compensation_table,
    corrected_geometry,
    corrected_urdf,
    dh_list,
    write_table,
)
from stiffmap.model.description import MachineDescription
from stiffmap.solve.machine import Machine
from stiffmap.solve.validity import Validity
from stiffmap.ui.cli.inputs import (
    CorrectedArgument,
    EffectsOption,
    GravityOption,
    finish,
    in_si,
    machine_with,
    numbers,
)
from stiffmap.ui.cli.inputs import gravity as gravity_of
from stiffmap.ui.cli.output import JsonOption, show
from stiffmap.workspace.maps.files import read_dataset

MM = 1e3
WORSE = "worse: these commands would enlarge the error of these readings; the file does not hold where they were taken"
BETTER = "better"
BEYOND = "rows beyond what the machine was calibrated by"
NAMED = 12
"""Rows that a line names."""


def command(
    machine: CorrectedArgument,
    poses: Annotated[
        Path | None, typer.Argument(help="CSV of wanted poses: x,y,z in mm, loads, approach_x …")
    ] = None,
    output: Annotated[Path | None, written(help="CSV of commands, table of --axis, or URDF.")] = None,
    effect: EffectsOption = None,
    force: Annotated[
        str, typer.Option(help="Force at the tool in every pose, N, where the CSV has none.")
    ] = "0,0,0",
    gravity: GravityOption = None,
    urdf: Annotated[
        Path | None,
        typer.Option(help="The arm's own URDF: its joints get the corrected origins, all else is kept."),
    ] = None,
    dh: Annotated[
        Path | None,
        written("--dh", help="Write the geometry of a serial arm as Denavit-Hartenberg rows (CSV)."),
    ] = None,
    axis: Annotated[
        str | None, typer.Option(help="Instead of poses: a controller's table of this axis, x, y or z.")
    ] = None,
    form: Annotated[
        str, typer.Option("--format", help="Of the table: csv, linuxcnc, siemens or heidenhain.")
    ] = "csv",
    points: Annotated[int, typer.Option(help="Positions of the table, over the workspace.")] = 21,
    through: Annotated[
        str | None, typer.Option(help="A point of the table's line, mm. [default: home]")
    ] = None,
    case: Annotated[
        str | None, typer.Option(help="Of a map with several loads: the one that the table is for, e.g. Fx.")
    ] = None,
    zero: Annotated[
        float | None, typer.Option(help="Position (mm) of the reference point: the table is zero there.")
    ] = None,
    check: Annotated[
        Path | None,
        typer.Option(help="Readings that no fit saw: the error before, and what compensation would leave."),
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Commands at which a deflected machine with errors stands where it is wanted.

    The machine is the corrected one: what its controller believes, with the effects that a diagnosis found. Weight,
    load, play and friction on the side of the approach are in the commands; --urdf and --dh hold what geometry can.
    Exit codes: 1 where --check finds that compensation would make the error larger, 2 bad input.

    Examples:

      [cyan]stiffmap compensate corrected.yaml poses.csv -o commands.csv[/cyan]

      [cyan]stiffmap compensate orthoglide-revised poses.csv --effect 'length bar x error=0.1mm' --force 0,0,-300 -o c.csv[/cyan]

      [cyan]stiffmap compensate travelling-column --axis z --gravity 0,0,-9.81 --format linuxcnc -o z.comp[/cyan]

      [cyan]stiffmap compensate results/map.nc --case Fx --axis x --format siemens -o x.mpf[/cyan]

      [cyan]stiffmap compensate calibrated_arm.yaml --urdf arm.urdf -o corrected.urdf[/cyan]

      [cyan]stiffmap compensate ur10 --effect 'zero_offset elbow error=1mrad' --dh arm.csv[/cyan]

      [cyan]stiffmap compensate result/machine.yaml --check held_out[/cyan]
    """
    if axis is None and poses is None and urdf is None and dh is None and check is None:
        raise StiffmapError("compensate: give a CSV of wanted poses, --axis, --urdf, --dh or --check")
    if axis is None and urdf is not None and (output is None or poses is not None):
        raise StiffmapError(
            "--urdf: give -o FILE, the URDF to write, and no poses, whose commands go there too"
        )
    if axis is not None:
        out = _table(machine, effect, axis, form, points, through, case, zero, output, force, gravity)
    else:
        m = machine_with(machine, effect)
        out = {} if urdf is None and dh is None else _geometry(m, urdf, dh, output)
        out |= {} if poses is None else _commands(m, poses, output, force, gravity)
        out |= {} if check is None else _checked(m, check)
    show(as_json, out, (f"{key}: {value}" for key, value in out.items()))
    finish(out.get("verdict") == WORSE)


def _checked(m: Machine, folder: Path) -> dict[str, object]:
    """Sizes of readings as they are, and less what the corrected machine says of them; those beyond what it was calibrated
    by apart."""
    e = Predictor(m, load_experiment(folder)).experiment
    out, worse = _sizes(m, e, None)
    far = beyond(m, e)
    if far is not None:
        out |= _promise(m)
        out[BEYOND] = f"{int(far.sum())} of {len(far)}"
        if far.any() and not far.all():
            there, harm = _sizes(m, e, far)
            out |= {f"there, {k}": v for k, v in there.items() if k != "readings"}
            worse |= harm
    out["verdict"] = WORSE if worse else BETTER
    return out


def _sizes(m: Machine, e: Experiment, rows: Mask | None) -> tuple[dict[str, object], bool]:
    before, after = left_by(m, e, rows)
    out: dict[str, object] = {"readings": before.n}
    for name, s in (("as measured", before), ("left by compensation", after)):
        size, unit = s.size
        out[f"rms {name}, m{unit}"] = round(MM * size, 6)
        if unit == "m":
            out[f"largest {name}, mm"] = round(MM * s.max, 6)
    return out, after.size[0] > before.size[0]


def _promise(m: Machine) -> dict[str, object]:
    """What the machine file says of itself."""
    v = Validity.of_machine(m)
    if v is None or v.error is None:
        return {}
    return {f"promised by the file, m{v.unit}": f"{MM * v.error:.4g} ± {MM * v.error_u:.1g} rms ({v})"}


def _table(
    machine: str,
    effect: list[str] | None,
    axis: str,
    form: str,
    points: int,
    through: str | None,
    case: str | None,
    zero: float | None,
    output: Path | None,
    force: str,
    gravity: str | None,
) -> dict[str, object]:
    """Table of an axis, from a machine or from a map that has been written."""
    point = in_si(through, "through", 3)
    if machine.endswith((".nc", ".zarr")):
        errors = axis_errors_of_map(read_dataset(machine), axis, through=point, case=case)
    else:
        m = machine_with(machine, effect)
        low, high = (
            (np.asarray(end)["xyz".index(axis)] for end in m.workspace) if axis in "xyz" else (0.0, 1.0)
        )
        errors = axis_errors(
            m,
            axis,
            np.linspace(low, high, max(points, 2)),
            through=point,
            wrench=[*numbers(force, "force", 3), 0.0, 0.0, 0.0],
            gravity=gravity_of(gravity),
        )
    errors = errors if zero is None else errors.zeroed(zero / MM)
    text = compensation_table(errors, form)
    if output is not None:
        write_table(errors, output, form)
    forward, backward = errors.positioning
    return {
        "positions": len(errors.position),
        f"{errors.names['xyz'.index(axis)]}, um": f"{1e6 * min(forward.min(), backward.min()):.3f} "
        f"to {1e6 * max(forward.max(), backward.max()):.3f}",
        "largest reversal value, um": round(1e6 * float(np.abs(errors.reversal).max()), 3),
        "linear interpolation leaves, um": round(1e6 * errors.interpolation, 3),
        "file" if output is not None else "table": str(output) if output is not None else "\n" + text,
    }


def _commands(
    m: Machine, poses: Path, output: Path | None, force: str, gravity: str | None
) -> dict[str, object]:
    plan = against_base(load_plan(poses, m, "position"), m.description.home.r)
    wrench = plan.wrench if plan.wrench.any() else np.append(numbers(force, "force", 3), np.zeros(3))
    found = compensate(
        m, plan.position, plan.rotation, wrench=wrench, approach=plan.approach, gravity=gravity_of(gravity)
    )
    if output is not None:
        found.write(output)
    lost = [plan.ids[i] for i in np.flatnonzero(~found.ok)]
    told: dict[str, object] = {}
    if found.beyond is not None:
        far = [plan.ids[i] for i in np.flatnonzero(found.beyond)]
        more = f" and {len(far) - NAMED} more" if len(far) > NAMED else ""
        told[BEYOND] = f"{', '.join(far[:NAMED])}{more}" or "none"
    return told | {
        "rows": len(plan),
        "corrected components": " ".join(found.components),
        "rms error at declared commands, mm": round(MM * found.rms(found.before), 6),
        "rms error at compensated commands, mm": round(MM * found.rms(found.after), 9),
        "rows without an answer": ", ".join(lost) or "none",
    }


def _geometry(m: Machine, urdf: Path | None, dh: Path | None, output: Path | None) -> dict[str, object]:
    corrected, left = corrected_geometry(m.description)
    if urdf is not None and output is not None:
        text, left = corrected_urdf(m.description, urdf)
        with writing(output) as fresh:
            fresh.write_bytes(text)
    if dh is not None:
        write_text(dh, _dh_text(corrected))
    return {"not in the geometry": "; ".join(left) or "nothing"}


def _dh_text(description: MachineDescription) -> str:
    (p, r), rows, (q, s) = dh_list(description)
    lines = ["joint,theta_deg,d_mm,a_mm,alpha_deg,beta_deg"]
    for row in rows:
        beta = "" if row.beta is None else f"{np.degrees(row.beta):.9g}"
        lines.append(
            f"{row.joint},{np.degrees(row.theta):.9g},{MM * row.d:.9g},{MM * row.a:.9g},{np.degrees(row.alpha):.9g},{beta}"
        )
    for name, shift, turn in (("base", p, r), ("tool", q, s)):
        cells = ",".join(f"{v:.9g}" for v in (*(MM * shift), *turn.ravel()))
        lines.append(f"# {name}: x y z in mm, rotation by rows,{cells}")
    return "\n".join(lines) + "\n"
