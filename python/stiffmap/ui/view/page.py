"""The scene as one file of HTML that opens without a server and without a network."""

from __future__ import annotations

from html import escape
from os import PathLike
from pathlib import Path

from stiffmap.common.errors import StiffmapError
from stiffmap.common.number_text import vector_text
from stiffmap.common.outputs import write_text
from stiffmap.ui.view.data import Data
from stiffmap.ui.view.moment import Moment
from stiffmap.ui.view.panels import (
    colour_bar,
    compliance_panel,
    efforts_panel,
    shares_panel,
    status_line,
)
from stiffmap.ui.view.scene import Scene, look_at_machine
from stiffmap.ui.view.serving import HERE, need_viser, silent

BOX = (
    "position:fixed;z-index:1000;background:rgba(255,255,255,.92);color:#111;font:13px system-ui,sans-serif;"
    "border-radius:4px;padding:.3em .6em;left:.6em;width:min(24em,45vw)"
)


def write_page(moment: Moment, path: str | PathLike[str], data: Data | None = None) -> Path:
    """Write the page; raises FileError where it cannot be written, MissingPartError without viser."""
    return write_text(path, page_of(moment, data))


def page_of(moment: Moment, data: Data | None = None) -> str:
    """The page: the scene, the colour bar and the panels, all in it."""
    viser = need_viser()
    with silent():
        server = viser.ViserServer(host=HERE, port=0, verbose=False)  # it alone can write its scene down
        try:
            said = draw(server, moment, data)
            text: str = server.scene.as_html()
        finally:
            server.stop()
    title = escape(f"{moment.machine.name}: stiffness view")
    box = f'<div style="{BOX};top:.6em;max-height:90vh;overflow:auto">{said}</div>'
    text = text.replace("<title>", f"<title>{title} - ", 1)
    head, _, tail = text.rpartition("</body>")
    return f"{head}{box}</body>{tail}"


def draw(server: object, moment: Moment, data: Data | None = None) -> str:
    """The whole scene of a moment; its panels as HTML."""
    scene = Scene(server.scene, moment)  # type: ignore[attr-defined]
    scene.gizmo.visible = scene.force_handle.visible = False
    solution, rest, found = moment.solve(), moment.rest(), moment.plane()
    factor = moment.magnification(rest, solution)
    scene.machine(rest, moment.ghost(rest, solution))
    scene.force(moment)
    scene.plane(found, found.range, moment.state.tolerance, True)
    if data is not None:
        data(scene, moment)
        scene.lights()
    look_at_machine(server, rest)
    try:
        shares = shares_panel(moment.shares())
    except StiffmapError:
        shares = ""
    words = f"force {vector_text(moment.state.force)} N; deflected machine (orange) magnified × {factor:g}"
    return (
        f"{status_line(moment, solution, '', '')}<div>{escape(words)}</div>"
        f"{colour_bar(found, found.range, moment.state.tolerance)}"
        f"<details open><summary>where it comes from</summary>{shares}{compliance_panel(solution)}"
        f"{efforts_panel(moment, solution)}</details>{data.html if data is not None else ''}"
    )
