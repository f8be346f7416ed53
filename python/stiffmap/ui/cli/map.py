"""``stiffmap map``."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import typer
from rich.text import Text

from stiffmap.common.errors import StiffmapError
from stiffmap.common.outputs import make_folder
from stiffmap.common.outputs.option import written
from stiffmap.solve.machine import Machine
from stiffmap.ui.cli import options
from stiffmap.ui.cli.inputs import MM, finish, force_given, gravity, machine_with
from stiffmap.ui.cli.map_big import print_estimate, print_statistics
from stiffmap.ui.cli.map_files import Wanted, write_map_files
from stiffmap.ui.cli.map_summary import (
    as_table,
    beyond,
    failures,
    in_words,
    summary,
    uncertainty_data,
    uncertainty_told,
    worst_pose,
)
from stiffmap.ui.cli.options import option
from stiffmap.ui.cli.output import failed_in_words, show
from stiffmap.workspace.maps.inputs import magnitude, plane_axes


def command(
    context: typer.Context,
    machine: options.Machine,
    output: Path = written("Folder for the map and its pictures.", Path("stiffmap-map")),
    z: list[float] | None = option(
        "z-plane in mm; repeatable. [default: lowest, 0, highest of the workspace]"
    ),
    y: list[float] | None = option("Planes across y instead, in mm; repeatable."),
    x: list[float] | None = option("Planes across x instead, in mm; repeatable."),
    points: int = option("Positions along each axis of a plane, over the whole workspace.", 101),
    force: options.Force = "300",
    toolpath: str | None = option(
        "Along a path of the tool instead of over planes: CSV or YAML, as for `efforts`; or a shipped one: trim."
    ),
    plane: options.Plane = "xy",
    tolerance: options.Tolerance = 0.25,
    directions: int = option(
        "Force directions solved before the extremes are searched; 16 or more for machines with play.", 4
    ),
    effect: options.Effects = None,
    gravity_: options.Gravity = None,
    compliance: bool = option("Keep the 6x6 compliance of every pose.", False),
    uncertainty: bool = option(
        "Standard deviation of the map, from links and `u` of the file.", False, "--uncertainty"
    ),
    zarr: bool = option("Write Zarr instead of NetCDF.", False, "--zarr"),
    resume: bool = option("Take up an interrupted run.", False, "--resume"),
    pictures: bool = option("Draw the maps, and write them as a report (HTML).", True),
    formats: str = option(
        "Formats of the pictures: png, svg, pdf, or several as png,pdf.", "png", "--format"
    ),
    tables: str | None = option("Write the map as a table too: csv, xlsx, or csv,xlsx.", None, "--table"),
    own_scales: bool = option(
        "A colour scale for each plane instead of a common one.", False, "--own-scales"
    ),
    estimate: bool = option(
        "Only say how long it will take, and the memory and disk it needs.", False, "--estimate"
    ),
    statistics: bool = option(
        "Maxima, percentiles and shares only; no map is stored.", False, "--statistics"
    ),
    scheduler: options.Scheduler = None,
    method: options.Method = "fast",
    threads: options.Threads = None,
    as_json: options.Json = False,
) -> None:
    """Error maps of z-planes: how far a force in the plane pushes the tool off its commanded position.

    The default is the paper's Figure 7: 300 N, z = -200, 0 and 300 mm over the whole xy workspace,
    deflection in the plane. The paper does not say where its force points: mapped are the worst
    direction at every position, the best one, Fx and Fy. A force that is given as a vector is mapped
    next to the worst and the best direction of its size.

    Coordinates that a machine's task does not command are left at home: a planar machine has one plane.

    Exit codes: 0 done, 1 some poses failed (they hold NaN and their status), 2 bad input.

    Examples:

      [cyan]stiffmap map orthoglide-revised -o results[/cyan]

      [cyan]stiffmap map orthoglide-revised --force 200,0,-100 --points 41 -o results[/cyan]

      [cyan]stiffmap map my_machine.yaml --uncertainty --points 21[/cyan]

      [cyan]stiffmap map tripteron --force 100 --points 41 --z 300 --z 500[/cyan]

      [cyan]stiffmap map orthoglide-revised --y 0 --plane xz --points 41 --format svg[/cyan]

      [cyan]stiffmap map orthoglide-revised --gravity 0,0,-9.81 --tolerance 0.1 --json[/cyan]

      [cyan]stiffmap map orthoglide-revised --points 21 --table csv,xlsx -o results[/cyan]

      [cyan]stiffmap map orthoglide-revised --points 2001 --estimate[/cyan]

      [cyan]stiffmap map orthoglide-revised --points 51 --statistics[/cyan]

      [cyan]stiffmap map orthoglide-revised --toolpath trim -o results[/cyan]
    """
    kinds = named_formats(formats, "--format", ("png", "svg", "pdf")) if pictures else []
    sheets = named_formats(tables, "--table", ("csv", "xlsx")) if tables else []
    m = machine_with(machine, effect)
    if toolpath is not None:
        from stiffmap.ui.cli.map_toolpath import map_toolpath

        how = {"gravity": gravity(gravity_), "method": method, "threads": threads}
        map_toolpath(m, toolpath, force, how, output, kinds, as_json)
        return
    call: dict[str, Any] = {
        **planes({"x": x, "y": y, "z": z}),
        "points": points,
        "wrench": cases(plane, force),
        "plane": plane,
        "directions": directions,
        "tolerance": MM * tolerance,
        "gravity": gravity(gravity_),
        "compliance": compliance,
        "uncertainty": uncertainty,
        "method": method,
        "threads": threads,
    }
    given = assumptions(context, force, tolerance)
    if estimate:
        print_estimate(m, call, as_json)
    elif statistics:
        print_statistics(m, call, plane, given, scheduler, as_json)
    else:
        target = make_folder(output) / ("map.zarr" if zarr else "map.nc")
        how = {
            "scheduler": scheduler,
            "progress": False if as_json else None,
            "out": target,
            "resume": resume,
        }
        wanted = Wanted(output, plane, tolerance, given, kinds, sheets, own_scales, uncertainty)
        _map(m, call, how, wanted, as_json)


def _map(machine: Machine, call: dict[str, Any], how: dict[str, Any], wanted: Wanted, as_json: bool) -> None:
    """Compute, write, print; ends the command."""
    import stiffmap

    ds = stiffmap.error_map(machine, **call, **how)
    rows, failed = summary(ds, wanted.plane, MM * wanted.tolerance), failures(ds)
    worst = worst_pose(machine, ds, call["gravity"])
    table = as_table(ds, rows, wanted.plane, wanted.tolerance)
    files = [how["out"], *write_map_files(machine, ds, wanted, table, worst, failed, call["gravity"])]
    band = uncertainty_data(ds, wanted.plane) if wanted.uncertainty else None
    far = beyond(ds)
    data: dict[str, Any] = {"machine": machine.name, "rows": rows, "failed": failed, "files": files}
    told: list[Any] = [wanted.given, table]
    if band is not None:
        told += uncertainty_told(ds, band, wanted.plane)
    if worst is not None:
        told.append(in_words(worst))
    if far is not None:
        words = f"{100 * far['share']:.3g} % of it beyond what the machine was calibrated by ({far['calibrated_by']})"
        told.append(Text(words, "yellow" if far["share"] else ""))
    data |= {"worst_pose": worst} | ({} if far is None else {"beyond_calibration": far})
    data |= {} if band is None else {"uncertainty": band}
    show(as_json, data, [*told, *failed_in_words(failed)], files)
    finish(bool(failed))


def assumptions(context: typer.Context, force: str, tolerance: float) -> str:
    """The force and the tolerance, and where they come from: the command line, or the default."""
    values = {"force": f"({force}) N" if "," in force else f"{force} N", "tolerance": f"{tolerance:g} mm"}
    taken = [n for n in values if getattr(context.get_parameter_source(n), "name", "") == "DEFAULT"]
    own = [f"{n} {v}" for n, v in values.items() if n not in taken]
    text = f"{_sentence(own)} as given. " if own else ""
    if not taken:
        return text.rstrip()
    are, they = ("are those", "they are") if len(taken) > 1 else ("is that", "it is")
    return (
        f"{text}{_sentence([f'{n} {values[n]}' for n in taken])} {are} of the Orthoglide's application in the paper; {they} used "
        f"because the machine file has none. Give your own by {' and '.join(f'--{n}' for n in taken)}."
    )


def _sentence(parts: Sequence[str]) -> str:
    """``Force 300 N and tolerance 0.25 mm``."""
    text = " and ".join(parts)
    return text[:1].upper() + text[1:]


def planes(across: dict[str, list[float] | None]) -> dict[str, Any]:
    """Planes (m) across one axis; none where none are given."""
    given = {a: MM * np.array(v) for a, v in across.items() if v}
    if len(given) > 1:
        raise StiffmapError(f"--{' and --'.join(given)}: expected planes across one axis")
    return given


def named_formats(text: str, option: str, known: Sequence[str]) -> list[str]:
    """Endings of files, separated by commas."""
    kinds = [k.strip().lower() for k in text.split(",")]
    if not set(kinds) <= set(known):
        several = ",".join(known[:2])
        raise StiffmapError(f"{option}: expected {', '.join(known)}, or several as {several}; got '{text}'")
    return kinds


def cases(plane: str, text: str) -> dict[str, list[float]]:
    """The force that is given as a vector; of a size, forces along the axes of the plane."""
    size, vector = force_given(text)
    magnitude(size, "--force", "N")
    if vector is not None:
        return {"F": [*vector, 0.0, 0.0, 0.0]}
    return {f"F{'xyz'[i]}": [size if k == i else 0.0 for k in range(6)] for i in plane_axes(plane)}
