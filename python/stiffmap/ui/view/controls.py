"""The panel next to the scene: every control changes the model, and shows what the model says."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from stiffmap.common.errors import StiffmapError
from stiffmap.solve.kinematics import assembly_modes
from stiffmap.ui.view.moment import Moment, moves, turns
from stiffmap.ui.view.numbers import ChangedNumbers, write
from stiffmap.ui.view.outputs import Outputs
from stiffmap.ui.view.panels import hint, legend
from stiffmap.ui.view.plane import QUANTITIES
from stiffmap.ui.view.state import PLANES

if TYPE_CHECKING:
    from viser import GuiApi, GuiCheckboxHandle, GuiDropdownHandle, GuiEvent, GuiInputHandle

    from stiffmap.ui.view.model import ViewModel

T = TypeVar("T")
H = TypeVar("H", "GuiCheckboxHandle", "GuiDropdownHandle[str]")
MOST_FORCE, MOST_GRAVITY = 5000.0, 20.0
HOME = "as at home"
NONE = "none"
DECIMALS = 15  # of numbers that are shown and typed: compliances are as small as 1e-10 m/N
PAUSE = 2.0
"""s after the last key, in which a number stays as it is typed: a refused one may be the begin of one that is taken, as 0 is of 0.25, and a
page under load sends its keys late."""
CROSSING = 5.0
"""s in which a page may be behind: what the program wrote then may have come after what somebody typed there meanwhile."""
TITLES = {q.title: name for name, q in QUANTITIES.items()}


class Controls:
    """Builds the panel; `show` puts the state's numbers into it."""

    def __init__(self, viewer: Any) -> None:
        self.viewer, gui = viewer, viewer.server.gui
        gui.configure_theme(
            control_layout="collapsible", control_width="large", show_logo=False, show_share_button=False
        )
        self._modes: dict[str, tuple[float, ...] | None] = {HOME: None}
        self._shown: list[tuple[Any, Callable[[Moment], object]]] = []
        """Controls of the state, and what each of them shows."""
        self._half: tuple[Any, float] = None, 0.0
        """The control whose page may show another number than holds, and until when it stays there."""
        self._written: dict[int, float] = {}
        """When the program last wrote into a control, by its id."""
        moment = viewer.model.moment
        self.status = gui.add_html("")
        self.bar = gui.add_html("")
        self.probe = gui.add_text("Probe", "click a point of the plane", disabled=True)
        tabs = gui.add_tab_group()
        with tabs.add_tab("Tool and load"):
            self._tool(gui, moment)
        with tabs.add_tab("Map"):
            self._map(gui, moment)
        with tabs.add_tab("Why"):
            self._why_tab(gui)
        with tabs.add_tab("Numbers"):
            self.numbers = ChangedNumbers(self, gui, moment)
        with tabs.add_tab("Out"):
            self.outputs = Outputs(gui, viewer.model, viewer.data, viewer.now)
        panel = gui.add_panel()
        with panel.add_tab("Legend"):
            self._legend = gui.add_html("")
        panel.float(x=12, y=-12, width=230)

    # -- building -----------------------------------------------------------------------------------------------

    def _tool(self, gui: GuiApi, moment: Moment) -> None:
        self.typed(
            gui.add_vector3("Tool, mm", (0, 0, 0), step=1.0, hint="commanded position in base axes"),
            lambda m, v: m.put(position=tuple(1e-3 * np.array(v))),
            lambda m: _round(1e3 * np.array(m.state.position)),
        )
        turn = gui.add_vector3(
            "Rotation, deg", (0, 0, 0), step=1.0, hint="rotation vector of the commanded orientation",
            visible=any(turns(moment.machine)),
        )  # fmt: skip
        self.typed(turn, lambda m, v: m.put(rotation=tuple(np.deg2rad(v))), _rotation)
        force = gui.add_vector3("Force, N", (0, 0, 0), step=10.0, hint="on the tool, base axes")
        self.typed(force, lambda m, v: m.put(force=tuple(v)), lambda m: _round(m.state.force))
        size = gui.add_slider("Size of the force, N", 0.0, MOST_FORCE, 10.0, 0.0)
        self.typed(size, _sized, lambda m: min(float(np.linalg.norm(m.state.force)), MOST_FORCE), keep=False)
        around = gui.add_slider("Force around z, deg", -180.0, 180.0, 1.0, 0.0)
        self.typed(around, _turned, _around, keep=False)
        moments = gui.add_vector3("Moment, N·m", (0, 0, 0), step=1.0)
        self.typed(moments, lambda m, v: m.put(moment=tuple(v)), lambda m: _round(m.state.moment))
        gravity = gui.add_slider("Gravity downwards, m/s²", 0.0, MOST_GRAVITY, 0.01, 0.0)
        self.typed(
            gravity, lambda m, v: m.put(gravity=(0.0, 0.0, -float(v)), keep=False), _downwards, keep=False
        )
        self._factor = gui.add_number(
            "Magnification", 1.0, min=0.0, hint="of the deflected machine; 0 hides it"
        )
        self.typed(self._factor, lambda m, v: m.put(magnification=float(v)))
        gui.add_button("Round magnification").on_click(self.does(lambda m: m.put(magnification=None)))
        self._mode = gui.add_dropdown(
            "Assembly mode", (HOME,), hint="ways in which the machine takes this pose"
        )
        self.typed(self._mode, lambda m, v: m.put(start=self._modes.get(v)), self._mode_of)
        gui.add_button("Search assembly modes").on_click(lambda _: self._search())
        undo, reset = self.does(lambda m: m.undo()), self.does(lambda m: m.reset())
        gui.add_button("Undo").on_click(undo)
        gui.add_button("Reset").on_click(reset)
        gui.add_command("Undo", hotkey="Z", modifier="cmd/ctrl").on_trigger(undo)
        gui.add_command("Reset the view").on_trigger(reset)

    def _map(self, gui: GuiApi, moment: Moment) -> None:
        self.map_on = self._drawn(gui.add_checkbox("Map", True))
        self.typed(
            gui.add_dropdown("Colour", tuple(TITLES), initial_value=QUANTITIES["deflection"].title),
            lambda m, v: m.put(quantity=TITLES[v]),
            lambda m: QUANTITIES[m.state.quantity].title,
        )
        plane = gui.add_dropdown("Plane across", PLANES, initial_value=moment.state.plane)
        self.typed(plane, lambda m, v: m.put(plane=v), lambda m: m.state.plane)
        normal = gui.add_vector3("Normal of a free plane", (0.0, 0.0, 1.0), step=0.05)
        self.typed(
            normal, lambda m, v: m.put(normal=tuple(v), plane="free"), lambda m: _round(m.state.normal)
        )
        tolerance = gui.add_number("Tolerance, µm", 250.0, min=0.001)
        self.typed(
            tolerance,
            lambda m, v: m.put(tolerance=1e-6 * float(v)),
            lambda m: round(1e6 * m.state.tolerance, 6),
        )
        frequency = gui.add_number("Frequency, Hz", 0.0, min=0.0, hint="of the dynamic stiffness")
        self.typed(frequency, lambda m, v: m.put(frequency=float(v)), lambda m: m.state.frequency)
        self.isolines = self._drawn(gui.add_checkbox("Isolines", True))
        self.hold = self._drawn(gui.add_checkbox("Hold the scale", False))
        self.cloud = self._drawn(gui.add_checkbox("Whole box as points", False))
        surfaces = (NONE, "polar diagram", "ellipsoid")
        self.surface = self._drawn(gui.add_dropdown("At the tool", surfaces, initial_value=NONE))
        self._surface_text = gui.add_html("")
        fixed = [a for a, free in zip("xyz", moves(moment.machine), strict=True) if not free]
        if fixed:
            gui.add_html(
                f'<div style="padding:.3em .6em">{", ".join(fixed)}: not commanded in this machine; the colours do not '
                "change along it</div>"
            )

    def _why_tab(self, gui: GuiApi) -> None:
        self.light = self._drawn(gui.add_dropdown("Light an element", (NONE,)))
        self._why = gui.add_html("")
        self.mode = gui.add_slider("Mode", 1, 6, 1, 1)
        self.mode.on_update(lambda _: self.viewer.worker.ask())
        gui.add_checkbox("Mode moves", False).on_update(lambda e: self.viewer.swing.play(e.target.value))

    # -- plumbing -----------------------------------------------------------------------------------------------

    def typed(
        self,
        handle: GuiInputHandle[T],
        deed: Callable[[ViewModel, T], object],
        shown: Callable[[Moment], object] | None = None,
        *,
        keep: bool = True,
    ) -> None:
        """A control whose value goes to the model; what the program itself writes into it does not. `shown`: what it then says."""

        def changed(event: GuiEvent[GuiInputHandle[T]]) -> None:
            if event.client_id is None:
                return
            if not keep:
                self.viewer.model.history.mark()
            taken = self.viewer.act(lambda m: deed(m, event.target.value))
            now = time.monotonic()
            sure = taken and now - self._written.get(id(handle), -np.inf) > CROSSING
            self._half = (None, 0.0) if sure else (handle, now + PAUSE)
            if not sure:
                then = threading.Timer(PAUSE, self.viewer.worker.ask)
                then.daemon = True
                then.start()

        if hasattr(handle, "precision"):  # else a field takes no more decimals than its step has
            handle.precision = DECIMALS
        handle.on_update(changed)
        if shown is not None:
            self._shown.append((handle, shown))

    def does(self, deed: Callable[[ViewModel], object]) -> Callable[[object], None]:
        """What a button or a command calls, to do this to the model."""

        def called(_: object) -> None:
            self._half = None, 0.0
            self.viewer.act(deed)

        return called

    def put(self, handle: Any, value: object) -> None:
        """What holds goes into a control, but not into one in which somebody may still be typing."""
        typed, until = self._half
        if handle is typed and time.monotonic() < until:
            return
        if handle.value != value:
            self._written[id(handle)] = time.monotonic()
        write(handle, "value", value)
        if handle is typed:  # viser sends no value twice
            self._half = None, 0.0
            handle._queue_update("value", handle.value)

    def _drawn(self, handle: H) -> H:
        """A control whose value is what is drawn, and no part of the state."""
        handle.on_update(lambda e: None if e.client_id is None else self.viewer.redraw())
        return handle

    def _search(self) -> None:
        try:
            moment = self.viewer.now()
            found = assembly_modes(moment.machine, moment.state.position, moment.state.turned)
        except StiffmapError as problem:
            self.viewer.error = str(problem)
            return
        self._modes = {HOME: None} | {f"mode {i + 1}": x for i, x in enumerate(found[1:], 1)}
        self._mode.options = tuple(self._modes)
        self.viewer.worker.ask()

    # -- what the model says ------------------------------------------------------------------------------------

    def why(self, html: str, surface: str) -> None:
        """The panels, and what the size of the surface at the tool means."""
        write(self._why, "content", html)
        write(self._surface_text, "content", f'<div style="padding:.3em .6em">{surface}</div>')

    def elements(self, names: Sequence[str]) -> None:
        """What may be lit, by rank."""
        options = (NONE, *names)
        if tuple(self.light.options) != options:
            chosen = self.light.value
            self.light.options = options
            write(self.light, "value", chosen if chosen in options else NONE)

    def show(self, moment: Moment) -> None:
        """The state's numbers in all controls."""
        for handle, shown in self._shown:
            self.put(handle, shown(moment))
        rest, solution = self.viewer.scene.rest, self.viewer._solution
        if solution is not None:
            factor = moment.magnification(rest, solution)
            self.put(self._factor, factor)
            write(self._legend, "content", legend(moment, rest, factor) + hint(moment))
        self.numbers.show(moment.state)
        self.outputs.show(moment)

    def _mode_of(self, moment: Moment) -> str:
        return next((n for n, x in self._modes.items() if x == moment.state.start), HOME)


def _round(values: ArrayLike) -> tuple[float, float, float]:
    x, y, z = (round(float(v), 6) + 0.0 for v in np.asarray(values))
    return x, y, z


def _rotation(moment: Moment) -> tuple[float, float, float]:
    return _round(np.rad2deg(Rotation.from_matrix(moment.rotation).as_rotvec()))


def _around(moment: Moment) -> float:
    x, y, _ = moment.state.force
    return round(float(np.rad2deg(np.arctan2(y, x))), 3)


def _downwards(moment: Moment) -> float:
    gravity = moment.machine.compiled.gravity(moment.state.gravity)
    return min(max(-float(gravity[2]), 0.0), MOST_GRAVITY)


def _sized(model: ViewModel, size: float) -> object:
    f = np.array(model.state.force)
    length = float(np.linalg.norm(f))
    unit = f / length if length else np.array([0.0, 0.0, -1.0])
    return model.put(force=tuple(float(v) for v in float(size) * unit), keep=False)


def _turned(model: ViewModel, angle: float) -> object:
    """The force turned about z; one along z lies down first."""
    x, y, z = model.state.force
    flat = float(np.hypot(x, y))
    if flat < 1e-9:
        flat, z = abs(z), 0.0
    a = np.deg2rad(float(angle))
    return model.put(force=(float(flat * np.cos(a)), float(flat * np.sin(a)), z), keep=False)
