"""``stiffmap polar``."""

from __future__ import annotations

from typing import Annotated, Any

import numpy as np
import typer
import xarray as xr
from rich import box
from rich.console import Console
from rich.table import Table

from stiffmap.common.outputs import make_folder
from stiffmap.common.plain import plain
from stiffmap.ui.cli.inputs import (
    MM,
    EffectsOption,
    FolderOption,
    ForceOption,
    GravityOption,
    MachineArgument,
    MethodOption,
    PlaneOption,
    ToleranceOption,
    finish,
    force_given,
    gravity,
    machine_with,
    position,
)
from stiffmap.ui.cli.output import JsonOption, print_json
from stiffmap.ui.cli.statuses import failed, failed_in_words

AtOption = Annotated[
    list[str] | None, typer.Option(help="TCP position in mm, e.g. 0,0,300; repeatable. [default: home]")
]


def polar(
    machine: MachineArgument,
    at: AtOption = None,
    force: ForceOption = "300",
    plane: PlaneOption = "xy",
    directions: Annotated[int, typer.Option(help="Number of directions.")] = 72,
    tolerance: ToleranceOption = 0.25,
    effect: EffectsOption = None,
    gravity_: GravityOption = None,
    output: FolderOption = None,
    method: MethodOption = "fast",
    as_json: JsonOption = False,
) -> None:
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
    import stiffmap

    m = machine_with(machine, effect)
    places = [position(text, m) for text in at] if at else [position(None, m)]
    size, vector = force_given(force)
    how: dict[str, Any] = {"gravity": gravity(gravity_), "method": method}
    many = [stiffmap.polar(m, p, size, plane, directions=directions, **how) for p in places]
    files = write(many, make_folder(output), plane, MM * tolerance) if output else []
    if as_json:
        data = {"machine": m.name, "diagrams": [as_plain(d, plane) for d in many], "files": files}
        if vector is not None:
            given = [m.solve(p, [*vector, 0, 0, 0], **how).displacement for p in places]
            data["displacement_under_the_vector"] = plain(given)
        print_json(data)
    else:
        console = Console(highlight=False)
        console.print(as_table(many, plane))
        for p in places if vector is not None else []:
            console.print(_under(m, p, vector, how), soft_wrap=True)
        statuses = np.concatenate([d.status.values.ravel() for d in many])
        for line in failed_in_words(failed(statuses), "directions"):
            console.print(f"[yellow]{line}[/yellow]", soft_wrap=True)
        if files:
            console.print(f"wrote {', '.join(files)}", soft_wrap=True)
    finish(any(bool((d.status != 0).any()) for d in many))


def _under(m: Any, place: Any, vector: Any, how: dict[str, Any]) -> str:
    """The deflection under the force that was given as a vector, in words."""
    d = 1e3 * m.solve(place, [*vector, 0, 0, 0], **how).displacement[:3]
    words = [", ".join(f"{v:.4g}" for v in values) for values in (1e3 * place, vector, d)]
    return f"at ({words[0]}) mm, force ({words[1]}) N: ({words[2]}) mm, norm {np.linalg.norm(d):.4f} mm"


def write(many: list[xr.Dataset], output: Any, plane: str, tolerance: float) -> list[str]:
    """Pictures and data."""
    from stiffmap.ui.plot import ellipse_figure, polar_figure, save
    from stiffmap.workspace.maps.files import write_dataset

    data = [
        write_dataset(d, output / (f"polar-{i}.nc" if len(many) > 1 else "polar.nc"))
        for i, d in enumerate(many, 1)
    ]
    pictures = [
        save(polar_figure(many, variable=f"deflection_{plane}", tolerance=tolerance), output / "polar.png"),
        save(ellipse_figure(many, plane=plane, tolerance=tolerance), output / "ellipses.png"),
    ]
    return [str(f) for f in (*data, *pictures)]


def as_plain(d: xr.Dataset, plane: str) -> Any:
    """A diagram as JSON data (SI)."""
    names = ("position", "force", "angle", "deflection", f"deflection_{plane}", "displacement", "status")
    extremes = [f"{w}_{what}_{plane}" for w in ("worst", "best") for what in ("deflection", "direction")]
    return plain({n: d[n].values for n in (*names, *extremes)})


def as_table(many: list[xr.Dataset], plane: str) -> Table:
    """Extremes of each diagram, mm and deg."""
    first = many[0]
    table = Table(
        box=box.SIMPLE_HEAD,
        title=f"{first.attrs['machine']}: deflection in the {plane} plane, mm, under "
        f"{float(first.force):g} N",
    )
    for head in ("position, mm", "worst", "at, deg", "best", "at, deg", "worst/best", "failed"):
        table.add_column(head, justify="right")
    for d in many:
        worst, best = (1e3 * float(d[f"{w}_deflection_{plane}"]) for w in ("worst", "best"))
        angles = [np.rad2deg(float(d[f"{w}_direction_{plane}"])) for w in ("worst", "best")]
        place = ", ".join(f"{1e3 * v:g}" for v in d.position.values)
        table.add_row(
            place,
            f"{worst:.4f}",
            f"{angles[0]:.1f}",
            f"{best:.4f}",
            f"{angles[1]:.1f}",
            f"{worst / best:.2f}",
            str(int((d.status != 0).sum())),
        )
    return table
