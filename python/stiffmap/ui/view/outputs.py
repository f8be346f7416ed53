"""What leaves a view: pictures, the scene as one file of HTML that opens without a server and without a network, the link, and
the lines that make the same."""

from __future__ import annotations

import shlex
import tempfile
from collections.abc import Callable
from html import escape
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d import Axes3D
from mpl_toolkits.mplot3d.art3d import Line3DCollection

from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import StiffmapError
from stiffmap.common.number_text import length_text, place_text, vector_text
from stiffmap.common.outputs import write_text
from stiffmap.ui.plot import save
from stiffmap.ui.plot.loaded import draw_budget
from stiffmap.ui.plot.scene import draw_box, draw_force, draw_skeleton, finish
from stiffmap.ui.plot.style import COLOURS, MM, ORANGE, TOLERANCE, headline, leg_colours, paper
from stiffmap.ui.view import panels
from stiffmap.ui.view.data import Data
from stiffmap.ui.view.model import ViewModel
from stiffmap.ui.view.moment import Moment, box_of
from stiffmap.ui.view.numbers import write
from stiffmap.ui.view.plane import QUANTITIES, PlaneMap, plane_image
from stiffmap.ui.view.scene import Scene, look_at_machine
from stiffmap.ui.view.serving import HERE, need_viser, silent
from stiffmap.ui.view.state import ViewState, as_plain, permalink

if TYPE_CHECKING:
    from viser import GuiApi, GuiButtonHandle, GuiEvent, ViserServer

SHOWN = 51  # poses along each edge of the plane in a picture
SAID = Path(__file__).parent / "pages/said.html"
"""Opens what is said, which stands next to the scene, or below it on narrow screens."""


class Outputs:
    """Buttons that hand files to the browser, and texts to copy."""

    def __init__(self, gui: GuiApi, model: ViewModel, data: Data | None, now: Callable[[], Moment]) -> None:
        self._model, self._data, self._now = model, data, now
        gui.add_button("Picture (PNG)").on_click(lambda e: self._hand(e, "png"))
        gui.add_button("Picture (SVG)").on_click(lambda e: self._hand(e, "svg"))
        gui.add_button("Scene as one page (HTML)").on_click(lambda e: self._hand(e, "html"))
        self._link = gui.add_text("Link", "", hint="add it to this view's address")
        self._command = gui.add_text("Command", "", multiline=True)
        self._python = gui.add_text("Python", "", multiline=True)

    def show(self, moment: Moment) -> None:
        """The texts of a state."""
        name = self.source
        write(self._link, "value", f"/?state={permalink(name, moment.state)}")
        write(self._command, "value", command_line(name, moment))
        write(self._python, "value", python_lines(name, moment))

    @property
    def source(self) -> str:
        """Shipped name, or the machine's file."""
        return self._model.declared.name if self._model.file is None else str(self._model.file)

    def _hand(self, event: GuiEvent[GuiButtonHandle], kind: str) -> None:
        if event.client is None:
            return
        moment = self._now()
        content = page_of(moment, self._data).encode() if kind == "html" else _picture(moment, kind)
        event.client.send_file_download(f"{moment.machine.name}.{kind}", content, save_immediately=True)


def _picture(moment: Moment, kind: str) -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        return save(view_figure(moment), Path(folder) / f"view.{kind}").read_bytes()


def command_line(machine: str, moment: Moment) -> str:
    """For a shell; files and units as there: mm, deg, µm as mm."""
    s = moment.state
    default = ViewState(s.position)
    options = {
        "at": _numbers(1e3 * np.array(s.position)),
        "force": _numbers(s.force),
        "rotation": s.rotation and _numbers(np.rad2deg(s.rotation)),
        "moment": any(s.moment) and _numbers(s.moment),
        "gravity": s.gravity and _numbers(s.gravity),
        "plane": _numbers(s.normal) if s.plane == "free" else s.plane,
        "quantity": s.quantity != default.quantity and s.quantity,
        "tolerance": s.tolerance != default.tolerance and f"{1e3 * s.tolerance:.9g}",
        "frequency": s.frequency and f"{s.frequency:.9g}",
        "magnify": s.magnification is not None and f"{s.magnification:.9g}",
    }
    words = [f"--{name}={text}" for name, text in options.items() if text]
    words += [f"--set={a}={v!r}" for a, v in s.changes]
    words += [f"--start={_numbers(s.start)}"] if s.start is not None else []
    return shlex.join(["stiffmap", "view", machine, *words])


def python_lines(machine: str, moment: Moment) -> str:
    """A program that opens the view and, in the machine as its file says it, solves the pose."""
    s = moment.state
    given = ", ".join(f"{k}={v!r}" for k, v in as_plain(s).items() if k != "position")
    p = tuple(float(v) for v in s.position)
    lines = ["import stiffmap as sm", "", f"machine = sm.load_machine({machine!r})"]
    lines.append(f"machine.view({p!r}{', ' if given else ''}{given})")
    if not s.changes and s.rotation is None and s.start is None:
        gravity = "" if s.gravity is None else f", gravity={list(s.gravity)!r}"
        lines.append(
            f"print(machine.solve({list(p)!r}, {[float(v) for v in s.wrench]!r}{gravity}).displacement)"
        )
    return "\n".join(lines)


def _numbers(values: object) -> str:
    return ",".join(f"{v:.12g}" for v in np.asarray(values, dtype=float))


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
    text = text.replace("<title>", f"<title>{title} - ", 1)
    head, _, tail = text.rpartition("</body>")
    return f"{head}{SAID.read_text(encoding='utf-8')}{said}</div></body>{tail}"


def draw(server: ViserServer, moment: Moment, data: Data | None = None) -> str:
    """The whole scene of a moment; its panels as HTML."""
    scene = Scene(server.scene, moment)
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
        shares = panels.shares_panel(moment.shares())
    except StiffmapError:
        shares = ""
    return (
        f"{panels.status_line(moment, solution, '', '')}"
        f"<details open><summary>legend</summary>{panels.legend(moment, rest, factor)}</details>"
        f"{panels.colour_bar(found, found.range, moment.state.tolerance)}"
        f"<details open><summary>where it comes from</summary>{shares}{panels.compliance_panel(solution)}"
        f"{panels.efforts_panel(moment, solution)}</details>{data.html if data is not None else ''}"
    )


def view_figure(moment: Moment) -> Figure:
    """Machine, deflected ghost, plane with isolines, and where the deflection comes from."""
    solution, rest, found = moment.solve(), moment.rest(), moment.plane(SHOWN)
    q, limits, s = QUANTITIES[moment.state.quantity], found.range, moment.state
    with paper(9.6, 5.2, most=0) as figure:
        ax = figure.add_subplot(1, 2, 1, projection="3d")
        draw_box(ax, *box_of(moment.machine))
        _plane(ax, found, limits)
        _lines(ax, found.isolines(limits), "white", 0.5)
        _lines(ax, found.tolerance_lines(s.tolerance), TOLERANCE, 1.5)
        draw_skeleton(ax, rest, leg_colours(moment.machine.legs))
        _lines(ax, moment.ghost(rest, solution), ORANGE, 1.0)
        draw_force(ax, rest.tcp, np.array(s.force), rest.extent)
        finish(ax, (22, -50))
        if s.quantity != "status":
            unit, factor = q.shown(max(map(abs, limits)))
            bar = ScalarMappable(Normalize(factor * limits[0], factor * limits[1]), COLOURS)
            figure.colorbar(bar, ax=ax, label=f"{q.title}, {unit}", shrink=0.6, location="bottom", pad=0.08)
        right = figure.add_subplot(1, 2, 2)
        try:
            draw_budget(right, moment.shares())
        except StiffmapError as problem:
            right.text(0.5, 0.5, str(problem), ha="center", wrap=True)
            right.axis("off")
        moved = length_text(float(np.linalg.norm(solution.displacement[:3])))
        headline(figure, f"{moment.machine.name} at {place_text(s.position, '.4g')} under {vector_text(s.force, 4)} N: the tool moves {moved} "
                         f"(orange: × {moment.magnification(rest, solution):g})")  # fmt: skip
    return figure


def _lines(ax: Axes3D, pieces: Floats, colour: str, width: float) -> None:
    if len(pieces):
        ax.add_collection3d(Line3DCollection(MM * pieces, colors=colour, linewidths=width))


def _plane(ax: Axes3D, found: PlaneMap, limits: tuple[float, float]) -> None:
    p = MM * found.frame.poses(found.count)
    step = plane_image(found, limits)
    colours = step[:: len(step) // found.count, :: len(step) // found.count] / 255.0
    ax.plot_surface(
        p[..., 0], p[..., 1], p[..., 2], facecolors=colours, rcount=found.count, ccount=found.count, shade=False,
        antialiased=False, linewidth=0,
    )  # fmt: skip
