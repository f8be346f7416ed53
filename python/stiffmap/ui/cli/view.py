from __future__ import annotations

import math
import webbrowser
from pathlib import Path
from typing import Any

import typer

from stiffmap.common.errors import StiffmapError
from stiffmap.common.number_text import number_in
from stiffmap.ui.cli import options
from stiffmap.ui.cli.inputs import MM, in_si, machine_with, numbers, refuse_unused
from stiffmap.ui.cli.options import option, written
from stiffmap.ui.cli.output import Answer, show

LOCAL = "127.0.0.1"
DEGREE = math.pi / 180
UNUSED = {"with link": "at rotation force moment gravity plane quantity tolerance frequency magnify changes start",
          "with html": "port host browser", "with picture": "port host browser"}  # fmt: skip
PICTURE_ALONE = {"with picture": "port host browser experiment diagnosis path"}


def command(
    context: typer.Context,
    machine: options.Machine,
    at: options.At = None,
    rotation: options.Rotation = None,
    force: str = option("Force on the tool in N.", "0,0,-300"),
    moment: str = option("Moment on the tool in N·m.", "0,0,0"),
    gravity: options.Gravity = None,
    effect: options.Effects = None,
    plane: str | None = option("Axis across which the plane lies (x, y, z), or the normal of a free one."),
    quantity: str = option(
        "What the colours show: deflection, worst, stiffness, margin, status, frequency, dynamic.",
        "deflection",
    ),
    tolerance: options.Tolerance = 0.25,
    frequency: float = option("Of the dynamic stiffness, Hz.", 0.0),
    magnify: float | None = option("Magnification of the deflected machine. [default: a round one]"),
    changes: list[str] | None = option(
        "A number of the machine, ADDRESS=VALUE in SI, e.g. x.foot/beam.EIx=4000; repeatable.", None, "--set"
    ),
    start: str | None = option(
        "All coordinates (m, rad) that name an assembly mode, as the view writes them."
    ),
    link: str | None = option("State of a link that the view gave; goes before the options."),
    experiment: Path | None = option("Folder of an experiment: its rows and residuals."),
    diagnosis: Path | None = option("Folder of a diagnosis: what it named is lit on its element."),
    path: str | None = option("Toolpath (G-code, CL, CSV, or an outline): wanted, cut, compensated."),
    meshes: Path | None = option("URDF that the machine was imported from, whose meshes are drawn."),
    html: Path | None = written("Write the scene as one page and end.", None, "--html"),
    picture: Path | None = written("Write a picture (PNG, SVG, PDF) and end.", None, "--picture"),
    port: int | None = option("Port. [default: a free one from 8080 on]"),
    host: str = option("Address to listen on; beyond this computer a token is asked for.", LOCAL),
    browser: bool = option("Open the browser.", True),
    as_json: options.Json = False,
) -> None:
    """Look at a machine and its map live in a browser: drag the tool, turn the force, change a number.

    Needs the extra [view] (pip install 'stiffmap[view]'). Serves on this computer only until it is interrupted
    (Ctrl-C). A machine file is read again whenever it is edited.

    With --html or --picture: writes the file and ends; the page opens without a network.

    Examples:
      [cyan]stiffmap view orthoglide-revised[/cyan]
      [cyan]stiffmap view orthoglide-revised --at 280,280,280 --force 300,0,0 --quantity worst[/cyan]
      [cyan]stiffmap view hexapod --plane x --html hexapod.html[/cyan]
      [cyan]stiffmap view orthoglide-revised --experiment experiments/servo --diagnosis result[/cyan]
      [cyan]stiffmap view calibrated_arm.yaml --meshes arm.urdf[/cyan]
      [cyan]stiffmap view orthoglide-revised --set x.foot/beam.EIx=4000 --no-browser --port 8090[/cyan]
    """
    refuse_unused(context, UNUSED | (PICTURE_ALONE if html is None else {}))
    from stiffmap.ui.view.serving import need_viser

    need_viser()
    model = _model(machine, effect, link, meshes, at=at, rotation=rotation, force=force, moment=moment, gravity=gravity,
                   plane=plane, quantity=quantity, tolerance=tolerance, frequency=frequency, magnify=magnify,
                   changes=changes, start=start)  # fmt: skip
    from stiffmap.ui.view.open import View, data_of

    data = data_of(model.declared, experiment, diagnosis, path)
    name = model.declared.name
    if html is not None or picture is not None:
        show(as_json, Answer({"machine": name}, [], _written(model, data, html, picture)))
        return
    opened = View(model, host, port, data)
    lines = [f"{name}: {opened.url}", "Ctrl-C ends it"]
    show(as_json, Answer({"machine": name, "url": opened.url}, lines))
    if browser:
        webbrowser.open(opened.url)
    opened.wait()


def _model(
    machine: str, effect: list[str] | None, link: str | None, meshes: Path | None, **given: Any
) -> Any:
    from stiffmap.ui.view.model import ViewModel
    from stiffmap.ui.view.state import from_permalink

    m = machine_with(machine, effect)
    file = Path(machine) if Path(machine).is_file() and not effect else None
    if link is not None:
        name, state = from_permalink(link.rpartition("state=")[2])
        if name not in (machine, m.name):
            raise StiffmapError(f"--link: is of the machine {name}, not of {machine}")
        return ViewModel(m, state, file=file, meshes=meshes)
    from stiffmap.ui.view import model_of

    return model_of(m, **_state(given), file=file, meshes=meshes)


def _state(g: dict[str, Any]) -> dict[str, Any]:
    """Fields of the state (SI) from the texts of the options."""
    out = {"quantity": g["quantity"], "frequency": g["frequency"], "magnification": g["magnify"]}
    out["tolerance"] = MM * g["tolerance"]
    for field, name, count, unit in (
        ("position", "at", 3, MM), ("rotation", "rotation", 3, DEGREE), ("gravity", "gravity", 3, 1.0), ("start", "start", None, 1.0),
        ("force", "force", 3, 1.0), ("moment", "moment", 3, 1.0),
    ):  # fmt: skip
        if g[name] is not None:
            out[field] = tuple(in_si(g[name], name, count, unit))
    if g["plane"] in ("x", "y", "z"):
        out["plane"] = g["plane"]
    elif g["plane"] is not None:
        out |= {"plane": "free", "normal": tuple(numbers(g["plane"], "plane", 3))}
    if g["changes"]:
        out["changes"] = dict(_change(text) for text in g["changes"])
    return out


def _change(text: str) -> tuple[str, float]:
    address, equals, value = text.rpartition("=")
    try:
        if equals and address:
            return address, number_in(value)
    except ValueError:
        pass
    raise StiffmapError(f"--set: expected ADDRESS=VALUE, such as x.foot/beam.EIx=4000; got '{text}'")


def _written(model: Any, data: Any, html: Path | None, picture: Path | None) -> list[Path]:
    from stiffmap.ui.plot import save
    from stiffmap.ui.view.outputs import view_figure, write_page

    files = [] if html is None else [write_page(model.moment, html, data)]
    return files if picture is None else [*files, save(view_figure(model.moment), picture)]
