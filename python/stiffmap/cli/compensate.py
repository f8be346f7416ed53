"""``stiffmap compensate``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from stiffmap.cli.inputs import EffectsOption, machine_with, numbers
from stiffmap.cli.inputs import gravity as gravity_of
from stiffmap.cli.output import JsonOption, print_json
from stiffmap.compensation import compensate as compute
from stiffmap.compensation import corrected_geometry, dh_list, urdf_text
from stiffmap.description import MachineDescription
from stiffmap.errors import FileError, StiffmapError
from stiffmap.experiment.files.orientation import against_base
from stiffmap.experiment.files.plan_file import load_plan
from stiffmap.machine import Machine

MM = 1e3


def compensate(
    machine: Annotated[
        str, typer.Argument(help="Corrected machine: file with its effects, or a shipped name.")
    ],
    poses: Annotated[
        Path | None, typer.Argument(help="CSV of wanted poses: x,y,z in mm, loads, approach_x …")
    ] = None,
    output: Annotated[Path | None, typer.Option("-o", "--output", help="CSV of commands.")] = None,
    effect: EffectsOption = None,
    force: Annotated[
        str, typer.Option(help="Force at the tool in every pose, N, where the CSV has none.")
    ] = "0,0,0",
    gravity: Annotated[str | None, typer.Option(help="m/s², base axes, as 0,0,-9.81.")] = None,
    urdf: Annotated[
        Path | None, typer.Option(help="Write the corrected geometry of a serial arm as URDF.")
    ] = None,
    dh: Annotated[
        Path | None, typer.Option(help="Write it as a list of Denavit-Hartenberg rows (CSV).")
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Commands at which a deflected machine with errors stands where it is wanted.

    The machine is the corrected one: what its controller believes, with the effects that a diagnosis found. Weight,
    load, play and friction on the side of the approach are in the commands; --urdf and --dh hold what geometry can.

    Examples:

      [cyan]stiffmap compensate corrected.yaml poses.csv -o commands.csv[/cyan]

      [cyan]stiffmap compensate orthoglide-revised poses.csv --effect 'length bar x error=0.1mm' --force 0,0,-300 -o c.csv[/cyan]

      [cyan]stiffmap compensate ur10 --effect 'zero_offset elbow error=1mrad' --urdf arm.urdf --dh arm.csv[/cyan]
    """
    if poses is None and urdf is None and dh is None:
        raise StiffmapError("compensate: give a CSV of wanted poses, --urdf or --dh")
    m = machine_with(machine, effect)
    out: dict[str, object] = {}
    if urdf is not None or dh is not None:
        out |= _geometry(m, urdf, dh)
    if poses is not None:
        out |= _commands(m, poses, output, force, gravity)
    if as_json:
        print_json(out)
        return
    for key, value in out.items():
        print(f"{key}: {value}")


def _commands(
    m: Machine, poses: Path, output: Path | None, force: str, gravity: str | None
) -> dict[str, object]:
    plan = against_base(load_plan(poses, m, "position"), m.description.home.r)
    wrench = plan.wrench if plan.wrench.any() else np.append(numbers(force, "force", 3), np.zeros(3))
    found = compute(
        m, plan.position, plan.rotation, wrench=wrench, approach=plan.approach, gravity=gravity_of(gravity)
    )
    if output is not None:
        found.write(output)
    lost = [plan.ids[i] for i in np.flatnonzero(~found.ok)]
    return {
        "rows": len(plan),
        "corrected components": " ".join(found.components),
        "rms error at declared commands, mm": round(MM * found.rms(found.before), 6),
        "rms error at compensated commands, mm": round(MM * found.rms(found.after), 9),
        "rows without an answer": ", ".join(lost) or "none",
    }


def _geometry(m: Machine, urdf: Path | None, dh: Path | None) -> dict[str, object]:
    corrected, left = corrected_geometry(m.description)
    try:
        if urdf is not None:
            urdf.write_text(urdf_text(corrected), encoding="utf-8")
        if dh is not None:
            dh.write_text(_dh_text(corrected), encoding="utf-8")
    except OSError as error:
        raise FileError(f"cannot be written: {error.strerror}", file=str(urdf or dh)) from error
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
