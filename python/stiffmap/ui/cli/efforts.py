from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import xarray as xr
from rich.table import Table

from stiffmap.ui.cli import options
from stiffmap.ui.cli.inputs import MM, gravity, in_si, machine_with
from stiffmap.ui.cli.options import argument, option
from stiffmap.ui.cli.output import Answer, table, write_files
from stiffmap.workspace.performance import drive_efforts, load_motion


def command(
    machine: options.Machine,
    trajectory: options.TablePath = argument(
        "Motion of the tool: CSV or YAML, numbers with units; or a shipped one: trim."
    ),
    duration: float | None = option(
        "s, from rest to rest along the path; default: the file's, else as fast as the drives can."
    ),
    feed: float | None = option("mm/min along the path all the way, in place of a duration."),
    friction: bool = option("Coulomb and viscous friction of the drives.", True),
    effect: options.Effects = None,
    gravity_: options.Gravity = None,
    output: options.Folder = None,
    threads: options.Threads = None,
) -> Answer:
    """Efforts, speeds and powers of the drives along a motion of the tool: inverse dynamics of the closed machine.

    A CSV table has columns such as x [mm], y [mm], z [mm]; with t [s] a motion over time, with feed [mm/min] a path at this
    speed, without either a path; fx [N], fy [N], fz [N] act on the tool and may vary. A YAML file describes a line, a
    circle or points.

    With -o: the data (NetCDF) and a picture.

    Exit codes: 0 done, 1 a drive exceeds its declared effort, speed or range, 2 bad input (a motion out of
    reach or through a singularity says where and when).

    Examples:
      [cyan]stiffmap efforts orthoglide-revised trim -o results[/cyan]
      [cyan]stiffmap efforts orthoglide-revised cut.yaml --gravity 0,0,-9.81[/cyan]
      [cyan]stiffmap efforts ur10 path.csv --feed 3000 --gravity 0,0,-9.81[/cyan]
      [cyan]stiffmap efforts ur10 path.csv --duration 2 --gravity 0,0,-9.81 --json[/cyan]
    """
    m = machine_with(machine, effect)
    g = gravity(gravity_)
    run = load_motion(trajectory).trajectory(m, duration=duration, gravity=g, feed=in_si(feed, unit=MM / 60))
    found = drive_efforts(m, run, gravity=g, friction=friction, threads=threads)
    files = write_files(output, _files(found))
    names = ("peak_effort", "rms_effort", "effort_margin", "peak_speed", "speed_margin", "peak_power",
             "range_margin")  # fmt: skip
    data = {"machine": m.name, "time": found.time.values[-1], "drives": list(map(str, found.drive.values))}
    data |= {n: found[n].values for n in names}
    return Answer(data, [as_table(found)], files, finding=bool(exceeded(found).any()))


def exceeded(found: xr.Dataset) -> np.ndarray:
    """(drives,) whether a declared limit is exceeded."""
    margins = [found[n].values for n in ("effort_margin", "speed_margin", "range_margin")]
    return np.asarray(np.less(margins, -1e-9).any(axis=0))  # NaN, where none is declared, is not less


def _files(found: xr.Dataset) -> Iterator[tuple[str, Any]]:
    from stiffmap.ui.plot.forces import efforts_figure

    yield "efforts.nc", found
    yield "efforts.png", efforts_figure(found)


def as_table(found: xr.Dataset) -> Table:
    """A row per drive."""
    span = float(found.time[-1] - found.time[0])
    turns = found.attrs["revolute"]
    out = table(
        f"{found.attrs['machine']}: {span:.4g} s; peaks; share of the declared limit",
        ("drive", "unit", "effort", "share", "rms", "speed", "share", "power, W", "limit"),
        left=("drive", "unit", "limit"), no_wrap=True, padding=(0, 1, 0, 0),
    )  # fmt: skip
    over = exceeded(found)
    for i, drive in enumerate(found.drive.values):
        at = found.isel(drive=i)
        out.add_row(
            str(drive), "N·m, rad/s" if turns[i] else "N, m/s",
            f"{float(at.peak_effort):.4g}", _share(at.peak_effort, at.effort_margin), f"{float(at.rms_effort):.4g}",
            f"{float(at.peak_speed):.4g}", _share(at.peak_speed, at.speed_margin),
            f"{float(at.peak_power):.4g}", "[red]over[/red]" if over[i] else "",
        )  # fmt: skip
    return out


def _share(peak: xr.DataArray, margin: xr.DataArray) -> str:
    limit = float(peak + margin)
    return f"{100 * float(peak) / limit:.0f} %" if limit > 0 else "–"
