from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import xarray as xr
from rich.table import Table

import stiffmap
from stiffmap.common.number_text import place_text
from stiffmap.ui.cli import options
from stiffmap.ui.cli.inputs import MM, force_given, gravity, machine_with, position
from stiffmap.ui.cli.options import how_many
from stiffmap.ui.cli.output import Answer, failed, failed_in_words, table, write_files
from stiffmap.workspace.maps.inputs import magnitude


def command(
    machine: options.Machine,
    at: options.Places = None,
    force: options.Force = "300",
    plane: options.Plane = "xy",
    directions: int = how_many("Number of directions.", 72),
    tolerance: options.Tolerance = 0.25,
    effect: options.Effects = None,
    gravity_: options.Gravity = None,
    output: options.Folder = None,
    method: options.Method = "fast",
) -> Answer:
    """Deflection against the direction of a force in a plane: weakest and strongest direction.

    Of a force that is given as a vector, the size turns in the plane, and the deflection under the vector
    itself is printed as well.

    With -o: polar diagrams and ellipses of deflections (PNG), and the data (NetCDF).

    Exit codes: 0 done, 1 some directions failed, 2 bad input.

    Examples:
      [cyan]stiffmap polar orthoglide-revised --at -200,-200,-200 -o results[/cyan]
      [cyan]stiffmap polar orthoglide-revised --at 0,0,0 --at 300,300,300 --force 500[/cyan]
      [cyan]stiffmap polar tripteron --at 300,400,500 --plane xz --json[/cyan]
    """
    tolerance = MM * magnitude(tolerance, "--tolerance", "mm")
    m = machine_with(machine, effect)
    places = [position(text, m) for text in at] if at else [position(None, m)]
    size, vector = force_given(force)
    how: dict[str, Any] = {"gravity": gravity(gravity_), "method": method}
    many = [stiffmap.polar(m, p, size, plane, directions=directions, **how) for p in places]
    files = write_files(output, _files(many, plane, tolerance))
    moved = [] if vector is None else [m.solve(p, [*vector, 0, 0, 0], **how).displacement for p in places]
    lost = failed(np.concatenate([d.status.values.ravel() for d in many]))
    told = [_under(p, vector, d) for p, d in zip(places, moved, strict=False)]
    data: dict[str, Any] = {"machine": m.name, "diagrams": [as_plain(d, plane) for d in many], "files": files}
    data |= {} if vector is None else {"displacement_under_the_vector": moved}
    lines = [as_table(many, plane), *told, *failed_in_words(lost, "directions")]
    return Answer(data, lines, files, finding=bool(lost))


def _under(place: Any, vector: Any, displacement: Any) -> str:
    """The deflection under the force that was given as a vector, in words."""
    force = ", ".join(f"{v:.4g}" for v in vector)
    at, moved = (place_text(v, ".4g") for v in (place, displacement[:3]))
    return f"at {at}, force ({force}) N: {moved}, norm {np.linalg.norm(1e3 * displacement[:3]):.4f} mm"


def _files(many: list[xr.Dataset], plane: str, tolerance: float) -> Iterator[tuple[str, Any]]:
    from stiffmap.ui.plot import ellipse_figure, polar_figure

    for i, d in enumerate(many, 1):
        yield f"polar-{i}.nc" if len(many) > 1 else "polar.nc", d
    yield "polar.png", polar_figure(many, variable=f"deflection_{plane}", tolerance=tolerance)
    yield "ellipses.png", ellipse_figure(many, plane=plane, tolerance=tolerance)


def as_plain(d: xr.Dataset, plane: str) -> Any:
    """A diagram as JSON data (SI)."""
    names = ("position", "force", "angle", "deflection", f"deflection_{plane}", "displacement", "status")
    extremes = [f"{w}_{what}_{plane}" for w in ("worst", "best") for what in ("deflection", "direction")]
    return {n: d[n].values for n in (*names, *extremes)}


def as_table(many: list[xr.Dataset], plane: str) -> Table:
    """Extremes of each diagram, mm and deg."""
    first = many[0]
    out = table(
        f"{first.attrs['machine']}: deflection in the {plane} plane, mm, under {float(first.force):g} N",
        ("position, mm", "worst", "at, deg", "best", "at, deg", "worst/best", "failed"),
    )
    for d in many:
        worst, best = (1e3 * float(d[f"{w}_deflection_{plane}"]) for w in ("worst", "best"))
        angles = [np.rad2deg(float(d[f"{w}_direction_{plane}"])) for w in ("worst", "best")]
        place = ", ".join(f"{1e3 * v:g}" for v in d.position.values)
        sizes = f"{worst:.4f}", f"{angles[0]:.1f}", f"{best:.4f}", f"{angles[1]:.1f}", f"{worst / best:.2f}"
        out.add_row(place, *sizes, str(int((d.status != 0).sum())))
    return out
