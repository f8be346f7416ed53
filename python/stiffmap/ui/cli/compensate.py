from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import typer

from stiffmap.common.errors import StiffmapError
from stiffmap.common.number_text import with_uncertainty
from stiffmap.common.short import first_of
from stiffmap.experiment.comparison.residual import Summary
from stiffmap.machining import compensation
from stiffmap.solve.machine import Machine
from stiffmap.ui.cli import options
from stiffmap.ui.cli.inputs import (
    flags_of,
    gravity as gravity_of,
    in_si,
    machine_with,
    numbers,
    options_given,
)
from stiffmap.ui.cli.options import argument, how_many, option, written
from stiffmap.ui.cli.output import Answer

MM = 1e3
WORSE = "worse: these commands would enlarge the error of these readings; the file does not hold where they were taken"
BETTER = "better"
LOST, NOTHING = "rows without an answer", "none"
BEYOND = "rows beyond what the machine was calibrated by"

LINE, LOADS = {"through", "zero", "format", "output"}, {"effect", "force", "gravity"}
USES = {"axis": {*LINE, *LOADS, "points"}, "axis of a map": {*LINE, "case"}, "poses": {*LOADS, "output"},
        "urdf": {"effect", "output"}, "dh": {"effect"}, "check": {"effect"}}  # fmt: skip
"""The options that each way of asking uses; any other is refused."""


def command(
    context: typer.Context,
    machine: options.Corrected,
    poses: options.TablePath | None = argument("CSV of wanted poses: x,y,z in mm, loads, approach_x …", None),
    output: Path | None = written("CSV of commands, table of --axis, or URDF."),
    effect: options.Effects = None,
    force: str = option("Force at the tool in every pose, N, where the CSV has none.", "0,0,0"),
    gravity: options.Gravity = None,
    urdf: Path | None = option("The arm's own URDF: its joints get the corrected origins, all else is kept."),
    dh: Path | None = written(
        "Write the geometry of a serial arm as Denavit-Hartenberg rows (CSV).", None, "--dh"
    ),
    axis: str | None = option("Instead of poses: a controller's table of this axis, x, y or z."),
    form: str = option("Of the table: csv, linuxcnc, siemens or heidenhain.", "csv", "--format"),
    points: int = how_many("Positions of the table, over the workspace.", 21),
    through: str | None = option("A point of the table's line, mm. [default: home]"),
    case: str | None = option("Of a map with several loads: the one that the table is for, e.g. Fx."),
    zero: float | None = option("Position (mm) of the reference point: the table is zero there."),
    check: Path | None = option(
        "Readings that no fit saw: the error before, and what compensation would leave."
    ),
) -> Answer:
    """Commands at which a deflected machine with errors stands where it is wanted.

    The machine is the corrected one: what its controller believes, with the effects that a diagnosis found. Weight,
    load, play and friction on the side of the approach are in the commands; --urdf and --dh hold what geometry can.
    Exit codes: 1 where a row has no answer, or --check finds that compensation would make the error larger, 2 bad input.

    Examples:
      [cyan]stiffmap compensate corrected.yaml poses.csv -o commands.csv[/cyan]
      [cyan]stiffmap compensate orthoglide-revised poses.csv --effect 'length bar x error=0.1mm' --force 0,0,-300 -o c.csv[/cyan]
      [cyan]stiffmap compensate travelling-column --axis z --gravity 0,0,-9.81 --format linuxcnc -o z.comp[/cyan]
      [cyan]stiffmap compensate results/map.nc --case Fx --axis x --format siemens -o x.mpf[/cyan]
      [cyan]stiffmap compensate calibrated_arm.yaml --urdf arm.urdf -o corrected.urdf[/cyan]
      [cyan]stiffmap compensate ur10 --effect 'zero_offset elbow error=1mrad' --dh arm.csv[/cyan]
      [cyan]stiffmap compensate result/machine.yaml --check held_out[/cyan]
    """
    if all(given is None for given in (axis, poses, urdf, dh, check)):
        raise StiffmapError("compensate: give a CSV of wanted poses, --axis, --urdf, --dh or --check")
    if axis is None and urdf is not None and (output is None or poses is not None):
        raise StiffmapError(
            "--urdf: give -o FILE, the URDF to write, and no poses, whose commands go there too"
        )
    of_map = axis is not None and machine.endswith((".nc", ".zarr"))
    mode = "" if axis is None else "axis of a map" if of_map else "axis"
    asked = [flags_of(context)[name].lstrip("-") for name in options_given(context)]
    given = [name for name in asked if name in {*USES, *set().union(*USES.values())} - {"axis"}]
    used = set().union(*(USES[m] for m in ([mode] if mode else given) if m in USES))
    if wrong := [n for n in given if n not in used and (mode or n not in USES)]:
        users = dict.fromkeys(f"--{m.split()[0]}" for m, names in USES.items() if wrong[0] in names)
        where = f"with --{mode}" if mode else f"without {' or '.join(users)}"
        raise StiffmapError(f"--{wrong[0]}: not {where}")
    load = [*numbers(force, "force", 3), 0.0, 0.0, 0.0]
    pull = gravity_of(gravity)
    if axis is not None:
        line: dict[str, Any] = {"through": in_si(through, "through", 3), "zero": in_si(zero)}
        if of_map:
            errors = compensation.axis_errors_of_map(machine, axis, case=case, **line)
        else:
            m = machine_with(machine, effect)
            errors = compensation.axis_errors(m, axis, points=points, wrench=load, gravity=pull, **line)
        out = _table(errors, form, output)
    else:
        m = machine_with(machine, effect)
        out = {} if urdf is None and dh is None else _geometry(m, urdf, dh, output)
        if poses is not None:
            out |= _commands(compensation.compensate(m, poses, wrench=load, gravity=pull), output)
        out |= {} if check is None else _checked(m, check)
    lines = (f"{key}: {value}" for key, value in out.items())
    lost = out.get(LOST, NOTHING) != NOTHING
    return Answer(out, lines, finding=lost or out.get("verdict") == WORSE)


def _checked(m: Machine, folder: Path) -> dict[str, object]:
    """Sizes of readings as they are and as compensation would leave them; those beyond what the machine was calibrated by apart."""
    found = compensation.check_compensation(m, folder)
    out = _sizes(found.whole)
    if (v := found.validity) is not None and v.error is not None:
        promised = with_uncertainty(MM * v.error, MM * v.error_u)
        out[f"promised by the file, m{v.unit}"] = f"{promised} rms ({v})"
    if found.beyond is not None:
        out[BEYOND] = f"{int(found.beyond.sum())} of {len(found.beyond)}"
    if found.there is not None:
        out |= {f"there, {k}": v for k, v in _sizes(found.there).items() if k != "readings"}
    return out | {"verdict": WORSE if found.worse else BETTER}


def _sizes(sizes: tuple[Summary, Summary]) -> dict[str, object]:
    out: dict[str, object] = {"readings": sizes[0].n}
    for name, s in zip(("as measured", "left by compensation"), sizes, strict=True):
        size, unit = s.size
        out[f"rms {name}, m{unit}"] = round(MM * size, 6)
        if unit == "m":
            out[f"largest {name}, mm"] = round(MM * s.max, 6)
    return out


def _table(errors: compensation.AxisErrors, form: str, output: Path | None) -> dict[str, object]:
    text = compensation.compensation_table(errors, form)
    if output is not None:
        compensation.write_table(errors, output, form)
    forward, backward = errors.positioning
    return {
        "positions": len(errors.position),
        f"{errors.names['xyz'.index(errors.axis)]}, um": f"{1e6 * min(forward.min(), backward.min()):.3f} "
        f"to {1e6 * max(forward.max(), backward.max()):.3f}",
        "largest reversal value, um": round(1e6 * float(np.abs(errors.reversal).max()), 3),
        "linear interpolation leaves, um": round(1e6 * errors.interpolation, 3),
        "file" if output is not None else "table": str(output) if output is not None else "\n" + text,
    }


def _commands(found: compensation.Commands, output: Path | None) -> dict[str, object]:
    if output is not None:
        found.write(output)
    lost = [found.ids[i] for i in np.flatnonzero(~found.ok)]
    told: dict[str, object] = {"orientation": found.turns} if found.turns else {}
    if found.beyond is not None:
        far = [found.ids[i] for i in np.flatnonzero(found.beyond)]
        told[BEYOND] = first_of(far) or NOTHING
    return told | {
        "rows": len(found.ids),
        "corrected components": " ".join(found.components),
        "rms error at declared commands, mm": round(MM * found.rms(found.before), 6),
        "rms error at compensated commands, mm": round(MM * found.rms(found.after), 9),
        LOST: first_of(lost) or NOTHING,
    }


def _geometry(m: Machine, urdf: Path | None, dh: Path | None, output: Path | None) -> dict[str, object]:
    left: list[str] = []
    if dh is not None:
        left = compensation.write_dh(m, dh)
    if urdf is not None and output is not None:
        left = compensation.write_urdf(m, urdf, output)
    files = [str(f) for f in (dh, output if urdf is not None else None) if f is not None]
    return {"file": ", ".join(files), "not in the geometry": "; ".join(left) or "nothing"}
