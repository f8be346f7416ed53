"""A view that is served: the model, the scene, the panels, and a worker that keeps them together: a thread that draws the newest state;
what came in between is never drawn."""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import StiffmapError
from stiffmap.solve.solution import Solution
from stiffmap.ui.plot.skeleton import element_links
from stiffmap.ui.view import panels
from stiffmap.ui.view.controls import NONE, Controls
from stiffmap.ui.view.data import Data
from stiffmap.ui.view.model import ViewModel
from stiffmap.ui.view.moment import COARSE, FINE, Moment
from stiffmap.ui.view.moving import ProbePoint, Swing, listen, listen_to_nodes
from stiffmap.ui.view.numbers import write
from stiffmap.ui.view.plane import QUANTITIES, PlaneMap, colours_of
from stiffmap.ui.view.scene import Scene, look_at_machine
from stiffmap.ui.view.serving import silent
from stiffmap.ui.view.state import ViewState

if TYPE_CHECKING:
    from viser import ViserServer

BUDGET = 0.018
"""s, of the plane while something is dragged; fewer poses are solved where they would take longer."""
COUNTS = (FINE, COARSE, 35, 25, 17, 11)


class Viewer:
    """Everything behind one address; all browsers that open it see the same."""

    def __init__(self, model: ViewModel, server: ViserServer, data: Data | None = None) -> None:
        self.model, self.server, self.data = model, server, data
        self.lock = threading.RLock()
        self.error = ""
        self._per_pose = 3e-6
        self._plane: PlaneMap | None = None
        self._plane_key: object = None
        self._held: PlaneMap | None = None
        self._solution: Solution | None = None
        self._cloud_key: object = None
        self._renewed = False
        self.dragging, self.pulling = False, 0.0
        """Whether the tool is in a hand; N of the force when its arrow was taken, 0 when it is not."""
        self.scene = Scene(server.scene, model.moment)
        model.message = self.scene.remark
        self.controls = Controls(self)
        self.swing = Swing(self)
        self.worker = Worker([self.quick, self.fine, self.panels, self.cloud], self._fail)
        self.probe = ProbePoint(self)
        listen(self)
        listen_to_nodes(self)
        if data is not None:
            data(self.scene, model.moment)
        look_at_machine(server, self.scene.rest)
        self.worker.ask()

    # -- what hands do ------------------------------------------------------------------------------------------

    def act(self, deed: Callable[[ViewModel], object]) -> bool:
        """Change the model; what it refuses is shown and nothing has changed then."""
        with self.lock:
            try:
                deed(self.model)
                self.error = ""
            except ValueError as problem:  # StiffmapError, or a message of a page with a turn that is none
                self.error = str(problem)
        self.worker.ask()
        return not self.error

    def pull(self, tail: ArrayLike) -> None:
        """The tail of the arrow was moved (m): the force points from there to the tool, as much larger as the arrow is longer."""
        with self.lock:
            size = self.pulling or max(float(np.linalg.norm(self.model.state.force)), 1.0)
            way = (np.array(self.model.state.position) - tail) / self.scene.arrow_length
            self.act(lambda m: m.put(force=tuple(float(v) for v in size * way), keep=False))

    def drag(self, position: Floats, wxyz: ArrayLike) -> None:
        """The gizmo was moved (m, quaternion)."""

        def deed(model: ViewModel) -> None:
            turned = Rotation.from_quat(np.roll(wxyz, -1)).as_matrix()
            same = np.abs(turned - model.moment.rotation).max() < 1e-9
            model.drag(position, None if same else turned)

        self.act(deed)

    # -- what is drawn, the quick part first --------------------------------------------------------------------

    def now(self) -> Moment:
        """What is on the screen."""
        with self.lock:
            return self.model.moment

    def quick(self) -> None:
        """The machine and a plane with as many poses as the time allows."""
        if self._renewed:
            self._renewed = False
            self._new_scene()
        moment = self.now()
        s = moment.solve()
        rest = moment.rest()
        ghost = moment.ghost(rest, s)
        self._solution = s
        found = self._map(moment)
        with self.server.atomic():
            self.scene.machine(rest, ghost)
            self.scene.force(moment, self.pulling)
            if not self.dragging:
                self.scene.tool(moment)
            if found is not None:
                self._show(found, moment.state)
            said = panels.status_line(moment, s, self.model.message, self.error)
            write(self.controls.status, "content", said)
        self.server.flush()

    def fine(self) -> None:
        """The plane with all poses, and the panel's numbers as they are now."""
        moment = self.now()
        self.controls.show(moment)
        if self.controls.map_on.value and (self._plane is None or self._plane.count < FINE):
            if QUANTITIES[moment.state.quantity].of is None and self._plane is not None:
                return
            found = moment.plane(FINE)
            self._learn(found)
            self._plane = found
            with self.server.atomic():
                self._show(found, moment.state)
        self.probe.again()

    def _learn(self, found: PlaneMap) -> None:
        if QUANTITIES[found.quantity].of is not None:
            self._per_pose = 0.5 * self._per_pose + 0.5 * found.seconds / found.count**2

    def _map(self, moment: Moment) -> PlaneMap | None:
        """A new map of the plane; None where it would be the one that is shown."""
        if not self.controls.map_on.value:
            self._plane_key = self._plane = None
            self.scene.no_plane()
            return None
        key = moment.map_key()
        if key == self._plane_key:
            return None
        count = next((n for n in COUNTS if n * n * self._per_pose <= BUDGET), COUNTS[-1])
        found = moment.plane(count)
        self._learn(found)
        self._plane, self._plane_key = found, key
        return found

    def _show(self, found: PlaneMap, state: ViewState) -> None:
        if not self.controls.hold.value or self._held is None or found.quantity != self._held.quantity:
            self._held = found
        limits = self._held.range
        self.scene.plane(found, limits, state.tolerance, self.controls.isolines.value)
        write(self.controls.bar, "content", panels.colour_bar(found, limits, state.tolerance))

    def redraw(self) -> None:
        """The plane is to be drawn again though the machine is the same."""
        self._plane_key = None
        self.worker.ask()

    def panels(self) -> None:
        """Where the deflection comes from, compliance, efforts, frequencies."""
        moment, s = self.now(), self._solution
        assert s is not None
        parts = []
        lit = self.controls.light.value
        try:
            budget = moment.shares()
            self.controls.elements([n for n, _, _ in budget.ranked()])
            parts.append(panels.shares_panel(budget, lit))
        except StiffmapError as problem:
            parts.append(panels.status_line(moment, s, "", str(problem)))
        parts += [panels.compliance_panel(s), panels.efforts_panel(moment, s)]
        w = self.swing.frequencies(moment)
        if w is not None:
            parts.append(panels.frequencies_panel(w.frequency.tolist(), self.controls.mode.value - 1))
        if self.data is not None:
            self.data(self.scene, moment)
            parts.insert(0, self.data.html)
        self.scene.lit = [] if lit == NONE else element_links(moment.machine, lit)
        self.controls.why("".join(parts), self.scene.surface(moment, s, self.controls.surface.value))
        self.scene.lights()

    def cloud(self) -> None:
        """The quantity over the whole box."""
        moment = self.now()
        key = (moment.map_key(anywhere=True), self.controls.cloud.value)
        if key == self._cloud_key:
            return
        self._cloud_key = key
        points, values = moment.cloud() if key[1] else (np.zeros((0, 3)), np.zeros(0))
        limits = (0.0, 1.0) if self._held is None else self._held.range
        self.scene.points("/cloud", points, colours_of(values, *limits), 0.012)

    def _fail(self, problem: Exception) -> None:
        self.error = (
            str(problem) if isinstance(problem, StiffmapError) else f"{type(problem).__name__}: {problem}"
        )
        s = self._solution
        if s is not None:
            write(self.controls.status, "content", panels.status_line(self.now(), s, "", self.error))

    def renew(self) -> None:
        """The machine's file has changed: its own scene and addresses, made by the thread that draws."""
        self._renewed = True
        self.redraw()

    def _new_scene(self) -> None:
        moment = self.now()
        self.server.scene.reset()
        self.scene = Scene(self.server.scene, moment)
        listen_to_nodes(self)
        self.controls.numbers.renew(moment)
        self._plane_key = self._cloud_key = None

    def close(self) -> None:
        """End the threads and the server."""
        self.swing.stop()
        self.worker.stop()
        with silent():
            self.server.stop()
            time.sleep(0.01)


YIELD = 0.002
"""s after the first stage, in which the server's thread sends what it drew before dearer stages compute."""
Stage = Callable[[], None]


class Worker:
    """Runs stages, from the quick one to the dear ones, and begins anew as soon as something is asked."""

    def __init__(self, stages: list[Stage], failed: Callable[[Exception], None]) -> None:
        self.stages, self._failed = stages, failed
        self._wake = threading.Condition()
        self._asked = self._done = self._finished = 0
        self._since: float | None = None
        self._stopped = False
        self.latencies: deque[float] = deque(maxlen=1000)
        """s, from an event to the end of the first stage that answers it."""
        self._thread = threading.Thread(target=self._run, daemon=True, name="stiffmap view")
        self._thread.start()

    def ask(self) -> None:
        """Something has changed."""
        with self._wake:
            self._asked += 1
            if self._since is None:
                self._since = time.perf_counter()
            self._wake.notify_all()

    def idle(self, seconds: float = 30.0) -> bool:
        """Wait until all is drawn; False where that takes longer."""
        with self._wake:
            return self._wake.wait_for(lambda: self._finished == self._asked, seconds)

    def _run(self) -> None:
        while True:
            with self._wake:
                self._wake.wait_for(lambda: self._stopped or self._asked != self._done)
                if self._stopped:
                    return
                self._done, since, self._since = self._asked, self._since, None
            self._draw(since)
            with self._wake:
                self._finished = self._done
                self._wake.notify_all()

    def _draw(self, since: float | None) -> None:
        for i, stage in enumerate(self.stages):
            if i and (self._asked != self._done or self._stopped):
                return  # what is being drawn is old already
            try:
                stage()
            except Exception as problem:  # the thread lives on; the panel shows it
                self._failed(problem)
            if i == 0 and since is not None:
                self.latencies.append(time.perf_counter() - since)
                time.sleep(YIELD)

    def stop(self) -> None:
        """End the thread after what it is doing."""
        with self._wake:
            self._stopped = True
            self._wake.notify_all()
        if threading.current_thread() is not self._thread:
            self._thread.join(timeout=5)
