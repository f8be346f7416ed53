from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from rich.table import Table

from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import StiffmapError
from stiffmap.common.number_text import length_text
from stiffmap.common.outputs import write_rows
from stiffmap.common.tables.pose_table import PoseTable, read_pose_table
from stiffmap.common.tables.table_file import refuse_options, table_file
from stiffmap.experiment.spreadsheet.joints import commands_in
from stiffmap.solve.labels import COMPONENTS, WRENCH
from stiffmap.solve.machine import Machine
from stiffmap.solve.mobility import free_motions
from stiffmap.solve.solution import Solution
from stiffmap.solve.status import Flag, Status
from stiffmap.solve.unreachable import why_unreachable
from stiffmap.ui.cli import options
from stiffmap.ui.cli.inputs import MM, force_given, machine_at, numbers, position_words
from stiffmap.ui.cli.options import option, written
from stiffmap.ui.cli.output import MEANINGS, Answer, table as table_of

SCALE = [1e3] * 3 + [1.0] * 3
"""m to mm, rad stays: a compliance then is in mm/N, rad/N, mm/(N mm), rad/(N mm)."""
SHOWN = 20  # rows of a file that are printed


def command(
    machine: options.Machine,
    at: options.TableText | None = option(
        "Commanded TCP in mm, e.g. 0,0,300, or a CSV file of poses. [default: home]"
    ),
    output: Path | None = written("With a file of poses: CSV of the answers."),
    force: options.Force = "0,0,0",
    moment: str = option("Moment about the point in N mm, base axes.", "0,0,0"),
    turned: options.Rotation = None,
    point: str = option("Named point where the wrench acts.", "tcp"),
    effect: options.Effects = None,
    gravity_: options.Gravity = None,
    method: options.Method = "fast",
) -> Answer:
    """Deflection and compliance at one pose under one wrench.

    A force that is given by its size alone acts in the direction in space that pushes the tool furthest.

    A file of poses has columns such as x [mm], y [mm], z [mm], rx [deg] … from home (or a robot's A, B, C; W, P, R; qw …
    against its base), or commanded joints (q1 [deg] …), fx [N] …, mx [N*m] …, one pose a row; --force acts where it has no load.

    Exit codes: 0 converged, 1 any other status, 2 bad input.

    Examples:
      [cyan]stiffmap solve orthoglide-revised --at -200,-200,-200 --force 300,0,0[/cyan]
      [cyan]stiffmap solve orthoglide-revised --at -200 -200 -200 --force 300[/cyan]
      [cyan]stiffmap solve tripteron --at 300,400,500 --force 0,0,100 --json[/cyan]
      [cyan]stiffmap solve orthoglide-revised --force 0,0,-50 --moment 0,2000,0 --gravity 0,0,-9.81[/cyan]
      [cyan]stiffmap solve orthoglide-revised --at poses.csv --force 0,0,-100 -o answers.csv[/cyan]
    """
    named = Path(at or "")
    file = named if named.suffix.lower() in (".csv", ".txt", ".tsv") or named.is_file() else None
    if file is None and at is not None:
        refuse_options(at, "a position")
    m, place, how = machine_at(machine, effect, None if file or at is None else str(at), turned, gravity_)
    how |= {"point": point, "method": method}
    if file is not None:
        assert at is not None
        acting = force_given(force)[1]
        if acting is None:  # its worst direction would differ from pose to pose
            raise StiffmapError("--force: with a file of poses, expected a vector, such as 0,0,-100")
        load = np.r_[acting, MM * numbers(moment, "moment", 3)]
        return solve_table(m, at, load, how, output)
    if output is not None:
        raise StiffmapError("--output: only with a file of poses (--at poses.csv)")
    size, vector = force_given(force)
    acting = _furthest(m, place, size, how) if vector is None else vector
    load = np.r_[acting, MM * numbers(moment, "moment", 3)]
    s = m.solve(place, load, **how)
    why = None if int(s.status) == Status.CONVERGED else MEANINGS[Status(int(s.status)).name]
    if int(s.status) == Status.UNREACHABLE:
        why = why_unreachable(m, place, how["rotation"])
    told: list[Any] = [position_words(place, m), *_lines(m, s)]
    if vector is None:
        furthest = ", ".join(f"{v:.1f}" for v in acting)
        told.insert(0, f"{size:g} N in the direction that pushes furthest: force ({furthest}) N")
    told += [f"reason: {why}"] if why else []
    if int(s.status) == Status.SINGULAR and (ways := free_motions(m, s.free_twists)):
        told.append(f"free: the platform can {'; '.join(ways)}")
    found = {"machine": m.name, "point": point, "position": place, "wrench": load} | s.as_plain()
    return Answer(found | {"reason": why}, told, finding=int(s.status) != Status.CONVERGED)


def _furthest(m: Machine, place: Floats, size: float, how: dict[str, Any]) -> Floats:
    """Force (3,) N of that size; along x where no direction has an answer."""
    from stiffmap.workspace.performance import worst_deflection  # what maps need takes most of a second

    unit = worst_deflection(m, place, force=size, plane=None, **how).direction
    return size * (unit if np.isfinite(unit).all() else np.eye(3)[0])


def _lines(m: Machine, s: Solution) -> Iterator[str | Table]:
    """For the terminal: mm, deg, N."""
    flags = ", ".join(str(f.name) for f in Flag(int(s.flags)))
    yield f"status {Status(int(s.status)).name.lower()}" + (f"; flags {flags}" if flags else "")
    d = s.displacement
    if np.isfinite(d).all():
        shift = ", ".join(f"{v:z.6f}" for v in 1e3 * d[:3])
        yield f"displacement of {s.point}: ({shift}) mm, norm {1e3 * np.linalg.norm(d[:3]):.6f} mm"
        yield f"rotation: ({', '.join(f'{v:.6f}' for v in np.rad2deg(d[3:]))}) deg"
    for name, effort in zip(s.actuators, s.actuator_effort, strict=True):
        if np.isfinite(effort):
            yield f"drive {name}: {effort:z.4f} {'N' if m.compiled.names.is_prismatic(name) else 'N·m'}"
    if np.isfinite(s.compliance).any():
        scaled = s.compliance * np.outer(SCALE, SCALE) / 1e3
        rows = ([name, *(f"{v:11.3e}" for v in row)] for name, row in zip(COMPONENTS, scaled, strict=True))
        title = "loaded compliance: mm and rad per N and N mm"
        yield table_of(title, ("", *WRENCH), rows, padding=0, pad_edge=False, collapse_padding=True)


def solve_table(
    m: Machine, file: str | PathLike[str], load: Floats, how: dict[str, Any], output: Path | None
) -> Answer:
    """Solve the poses of a file; the answers are written."""
    commanded = {"x", "y", "z"} <= set(m.description.task)
    table = read_pose_table(
        file, at_home=None if commanded else m.description.home.p,
        joints=partial(commands_in, m, table_file(file).units),
    )  # fmt: skip
    turned = table.rotation(m.description.home.r)
    if how["rotation"] is not None and not (turned is None is table.actuators):
        raise StiffmapError(f"--rotation: {file} has orientations of its own")
    wrench = table.wrench if table.loaded else np.broadcast_to(load, (len(table), 6))
    if table.actuators is None:
        s = m.solve(
            table.position, wrench, **{**how, "rotation": how["rotation"] if turned is None else turned}
        )
    else:
        s = m.solve_joints(table.actuators, wrench, **{**how, "rotation": None})
    position = table.position if s.unloaded is None else s.unloaded.position
    words = [Status(int(v)).name for v in s.status]
    files: list[Path] = []
    if output is not None:
        units = (f"{n} [{'mm' if n[0] == 'd' else 'rad'}]" for n in COMPONENTS)
        head = ["x [mm]", "y [mm]", "z [mm]", *units, "status"]
        in_mm = np.hstack([position / MM, s.displacement * np.r_[np.full(3, 1 / MM), np.ones(3)]])
        write_rows(output, head, ([*map(repr, row.tolist()), w] for row, w in zip(in_mm, words, strict=True)))
        files = [output]
    rows = [
        {"position": p, "wrench": w, "status": state, "displacement": d}
        for p, w, state, d in zip(position, wrench, words, s.displacement, strict=True)
    ]
    data = {"machine": m.name, "point": s.point, "poses": rows}
    return Answer(data, _rows(table, position, s, words), files, finding=not s.ok.all())


def _rows(table: PoseTable, position: Floats, s: Solution, words: list[str]) -> Iterator[str | Table]:
    heads = ("x", "y", "z", "dx, µm", "dy, µm", "dz, µm", "|d|, µm", "")
    out = table_of(f"displacement of {s.point}", heads)
    sizes = np.linalg.norm(s.displacement[:, :3], axis=1)
    for i in range(min(len(table), SHOWN)):
        moved = [f"{1e6 * v:.2f}" for v in (*s.displacement[i, :3], sizes[i])]
        where = [f"{v / MM:g}" for v in position[i]]
        word = "" if words[i] == "CONVERGED" else words[i].lower()
        out.add_row(*where, *(["-"] * 4 if not np.isfinite(sizes[i]) else moved), word)
    yield out
    if table.turns:
        yield f"orientation {table.turns}"
    if len(table) > SHOWN:
        yield f"{len(table) - SHOWN} more rows (-o answers.csv writes all)"
    if np.isfinite(sizes).any():
        worst = int(np.nanargmax(sizes))
        yield f"largest: {length_text(sizes[worst])} in row {worst + 1} (line {table.lines[worst]})"
