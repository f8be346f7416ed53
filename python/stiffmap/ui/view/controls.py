"""The panel next to the scene: every control changes the model, and shows what the model says."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from stiffmap.common.errors import StiffmapError
from stiffmap.solve.reach import assembly_modes
from stiffmap.ui.view.moment import Moment
from stiffmap.ui.view.numbers import ChangedNumbers, write
from stiffmap.ui.view.outputs import Outputs
from stiffmap.ui.view.panels import hint, legend
from stiffmap.ui.view.place import first_plane, moves, orientation, rotation_of, turns
from stiffmap.ui.view.quantities import QUANTITIES
from stiffmap.ui.view.state import PLANES

MOST_FORCE, MOST_GRAVITY = 5000.0, 20.0
HOME = "as at home"
NONE = "none"
DECIMALS = 15  # of numbers that are shown and typed: compliances are as small as 1e-10 m/N
TITLES = {q.title: name for name, q in QUANTITIES.items()}


class Controls:
    """Builds the panel; `show` puts the state's numbers into it."""

    def __init__(self, viewer: Any) -> None:
        self.viewer, gui = viewer, viewer.server.gui
        gui.configure_theme(
            control_layout="collapsible", control_width="large", show_logo=False, show_share_button=False
        )
        self._modes: dict[str, tuple[float, ...] | None] = {HOME: None}
        moment = viewer.model.moment
        self._status = gui.add_html("")
        self._bar = gui.add_html("")
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
            self.outputs = Outputs(viewer, gui)
        panel = gui.add_panel()
        with panel.add_tab("Legend"):
            self._legend = gui.add_html("")
        panel.float(x=12, y=-12, width=230)
        self.map_on, self.hold, self.isolines, self.cloud = True, False, True, False
        self.surface, self.lit = NONE, ""

    # -- building -----------------------------------------------------------------------------------------------

    def _tool(self, gui: Any, moment: Moment) -> None:
        self._position = gui.add_vector3(
            "Tool, mm", (0, 0, 0), step=1.0, hint="commanded position in base axes"
        )
        self.typed(self._position, lambda m, v: m.put(position=tuple(1e-3 * np.array(v))))
        self._turn = gui.add_vector3(
            "Rotation, deg", (0, 0, 0), step=1.0, hint="rotation vector of the commanded orientation",
            visible=any(turns(moment.machine)),
        )  # fmt: skip
        self.typed(self._turn, lambda m, v: m.put(rotation=tuple(np.deg2rad(v))))
        self._force = gui.add_vector3("Force, N", (0, 0, 0), step=10.0, hint="on the tool, base axes")
        self.typed(self._force, lambda m, v: m.put(force=tuple(v)))
        self._size = gui.add_slider("Size of the force, N", 0.0, MOST_FORCE, 10.0, 0.0)
        self.typed(self._size, _sized, keep=False)
        self._around = gui.add_slider("Force around z, deg", -180.0, 180.0, 1.0, 0.0)
        self.typed(self._around, _turned, keep=False)
        self._moment = gui.add_vector3("Moment, N·m", (0, 0, 0), step=1.0)
        self.typed(self._moment, lambda m, v: m.put(moment=tuple(v)))
        self._gravity = gui.add_slider("Gravity downwards, m/s²", 0.0, MOST_GRAVITY, 0.01, 0.0)
        self.typed(self._gravity, lambda m, v: m.put(gravity=(0.0, 0.0, -float(v)), keep=False), keep=False)
        self._factor = gui.add_number(
            "Magnification", 1.0, min=0.0, hint="of the deflected machine; 0 hides it"
        )
        self.typed(self._factor, lambda m, v: m.put(magnification=float(v)))
        self.pressed(gui.add_button("Round magnification"), lambda m: m.put(magnification=None))
        self._mode = gui.add_dropdown(
            "Assembly mode", (HOME,), hint="ways in which the machine takes this pose"
        )
        self.typed(self._mode, lambda m, v: m.put(start=self._modes.get(v)))
        gui.add_button("Search assembly modes").on_click(lambda _: self._search())
        self.pressed(gui.add_button("Undo"), lambda m: m.undo())
        self.pressed(gui.add_button("Reset"), lambda m: m.reset())
        gui.add_command("Undo", hotkey="Z", modifier="cmd/ctrl").on_trigger(
            lambda _: self.viewer.act(lambda m: m.undo())
        )
        gui.add_command("Reset the view").on_trigger(lambda _: self.viewer.act(lambda m: m.reset()))

    def _map(self, gui: Any, moment: Moment) -> None:
        box = gui.add_checkbox("Map", True)
        box.on_update(lambda e: self._set("map_on", e))
        self._quantity = gui.add_dropdown(
            "Colour", tuple(TITLES), initial_value=QUANTITIES["deflection"].title
        )
        self.typed(self._quantity, lambda m, v: m.put(quantity=TITLES[v]))
        self._plane = gui.add_dropdown("Plane across", PLANES, initial_value=first_plane(moment.machine))
        self.typed(self._plane, lambda m, v: m.put(plane=v))
        self._normal = gui.add_vector3("Normal of a free plane", (0.0, 0.0, 1.0), step=0.05)
        self.typed(self._normal, lambda m, v: m.put(normal=tuple(v), plane="free"))
        self._tolerance = gui.add_number("Tolerance, µm", 250.0, min=0.001)
        self.typed(self._tolerance, lambda m, v: m.put(tolerance=1e-6 * float(v)))
        self._frequency = gui.add_number("Frequency, Hz", 0.0, min=0.0, hint="of the dynamic stiffness")
        self.typed(self._frequency, lambda m, v: m.put(frequency=float(v)))
        for label, name, on in (
            ("Isolines", "isolines", True),
            ("Hold the scale", "hold", False),
            ("Whole box as points", "cloud", False),
        ):
            gui.add_checkbox(label, on).on_update(lambda e, name=name: self._set(name, e))
        surface = gui.add_dropdown("At the tool", (NONE, "polar diagram", "ellipsoid"), initial_value=NONE)
        surface.on_update(lambda e: self._set("surface", e))
        self._surface_text = gui.add_html("")
        fixed = [a for a, free in zip("xyz", moves(moment.machine), strict=True) if not free]
        if fixed:
            gui.add_html(
                f'<div style="padding:.3em .6em">{", ".join(fixed)}: not commanded in this machine; the colours do not '
                "change along it</div>"
            )

    def _why_tab(self, gui: Any) -> None:
        self._light = gui.add_dropdown("Light an element", (NONE,))
        self._light.on_update(lambda e: self._set("lit", e))
        self._why = gui.add_html("")
        number = gui.add_slider("Mode", 1, 6, 1, 1)

        def changed(event: Any) -> None:
            self.viewer.swing.mode = int(event.target.value) - 1
            self.viewer.worker.ask()

        number.on_update(changed)

        gui.add_checkbox("Mode moves", False).on_update(
            lambda e: self.viewer.swing.play(bool(e.target.value))
        )

    # -- plumbing -----------------------------------------------------------------------------------------------

    def typed(self, handle: Any, deed: Callable[[Any, Any], object], keep: bool = True) -> None:
        """A control whose value goes to the model; what the program itself writes into it does not."""

        def changed(event: Any) -> None:
            if event.client_id is None:
                return
            if not keep:
                self.viewer.model.history.mark()
            self.viewer.act(lambda m: deed(m, event.target.value))

        if hasattr(handle, "precision"):  # else a field takes no more decimals than its step has
            handle.precision = DECIMALS
        handle.on_update(changed)

    def pressed(self, handle: Any, deed: Callable[[Any], object]) -> None:
        handle.on_click(lambda _: self.viewer.act(deed))

    def _set(self, name: str, event: Any) -> None:
        if event.client_id is not None:
            value = event.target.value
            setattr(self, name, "" if name == "lit" and value == NONE else value)
            self.viewer.redraw()

    def _search(self) -> None:
        try:
            moment = self.viewer.now()
            found = assembly_modes(moment.machine, moment.state.position, orientation(moment.state))
        except StiffmapError as problem:
            self.viewer.error = str(problem)
            return
        self._modes = {HOME: None} | {f"mode {i + 1}": x for i, x in enumerate(found[1:], 1)}
        self._mode.options = tuple(self._modes)
        self.viewer.worker.ask()

    # -- what the model says ------------------------------------------------------------------------------------

    def say(self, html: str) -> None:
        """The line on top."""
        write(self._status, "content", html)

    def bar(self, html: str) -> None:
        """The colour bar."""
        write(self._bar, "content", html)

    def why(self, html: str, surface: str) -> None:
        """The panels, and what the size of the surface at the tool means."""
        write(self._why, "content", html)
        write(self._surface_text, "content", f'<div style="padding:.3em .6em">{surface}</div>')

    def elements(self, names: Sequence[str]) -> None:
        """What may be lit, by rank."""
        options = (NONE, *names)
        if tuple(self._light.options) != options:
            chosen = self._light.value
            self._light.options = options
            self._light.value = chosen if chosen in options else NONE

    def show(self, moment: Moment) -> None:
        """The state's numbers in all controls."""
        m, s = moment.machine, moment.state
        turn = Rotation.from_matrix(rotation_of(m, s)).as_rotvec()
        size = float(np.linalg.norm(s.force))
        gravity = m.compiled.gravity(s.gravity)
        write(self._position, "value", _round(1e3 * np.array(s.position)))
        write(self._turn, "value", _round(np.rad2deg(turn)))
        write(self._force, "value", _round(s.force))
        write(self._moment, "value", _round(s.moment))
        write(self._size, "value", min(size, MOST_FORCE))
        write(self._around, "value", round(float(np.rad2deg(np.arctan2(s.force[1], s.force[0]))), 3))
        write(self._gravity, "value", min(max(-float(gravity[2]), 0.0), MOST_GRAVITY))
        rest, solution = self.viewer.scene.rest, self.viewer._solution
        if solution is not None:
            factor = moment.magnification(rest, solution)
            write(self._factor, "value", factor)
            write(self._legend, "content", legend(moment, rest, factor) + hint(moment))
        write(self._quantity, "value", QUANTITIES[s.quantity].title)
        write(self._plane, "value", s.plane)
        write(self._normal, "value", _round(s.normal))
        write(self._tolerance, "value", round(1e6 * s.tolerance, 6))
        write(self._frequency, "value", s.frequency)
        chosen = next((n for n, x in self._modes.items() if x == s.start), HOME)
        write(self._mode, "value", chosen)
        self.numbers.show(s)
        self.outputs.show(moment)


def _round(values: Any) -> tuple[float, float, float]:
    x, y, z = (round(float(v), 6) + 0.0 for v in values)
    return x, y, z


def _sized(model: Any, size: Any) -> object:
    f = np.array(model.state.force)
    length = float(np.linalg.norm(f))
    unit = f / length if length else np.array([0.0, 0.0, -1.0])
    return model.put(force=tuple(float(v) for v in float(size) * unit), keep=False)


def _turned(model: Any, angle: Any) -> object:
    """The force turned about z; one along z lies down first."""
    x, y, z = model.state.force
    flat = float(np.hypot(x, y))
    if flat < 1e-9:
        flat, z = abs(z), 0.0
    a = np.deg2rad(float(angle))
    return model.put(force=(float(flat * np.cos(a)), float(flat * np.sin(a)), z), keep=False)
