"""What moves in the scene: the tool, the tail of the force and the probe follow the mouse; a mode of the machine swings."""

from __future__ import annotations

import threading
import time
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import StiffmapError
from stiffmap.ui.plot.modes import swung
from stiffmap.ui.plot.skeleton import skeleton
from stiffmap.ui.view.moment import Moment
from stiffmap.ui.view.numbers import write
from stiffmap.ui.view.panels import probe_text
from stiffmap.ui.view.scene import GHOST
from stiffmap.workspace.performance.motion.inertia import NaturalFrequencies

if TYPE_CHECKING:
    from viser import IcosphereHandle, SceneNodeDragEvent, TransformControlsEvent


class ProbePoint:
    """A point of the plane at which the quantity is solved, not read off the picture."""

    def __init__(self, viewer: Any) -> None:
        self._viewer = viewer
        self.point: Floats | None = None

    def along(self, origin: ArrayLike, direction: ArrayLike) -> None:
        """Solve where a ray (m) meets the plane; one that misses it changes nothing."""
        plane = self._viewer._plane
        point = None if plane is None else plane.frame.under_ray(np.array(origin), np.array(direction))
        if point is not None:
            self.at(point)

    def at(self, point: Floats) -> None:
        """Solve at a point (m) and show the number."""
        self.point = np.array(point)
        text = probe_text(self._viewer.now(), [float(v) for v in point])
        self._viewer.scene.marker(self.point, text)
        write(self._viewer.controls.probe, "value", text)

    def again(self) -> None:
        """Solve anew where the probe is, as the machine or its load is another."""
        if self.point is not None:
            self.at(self.point)


def listen(viewer: Any) -> None:
    """Clicks in the scene, and pages that are closed."""
    viewer.server.scene.on_click()(lambda e: viewer.probe.along(e.ray_origin, e.ray_direction))

    def left(_: object) -> None:
        viewer.dragging, viewer.pulling = False, 0.0  # a tab that is closed in the middle of a drag

    viewer.server.on_client_disconnect(left)


def listen_to_nodes(viewer: Any) -> None:
    """What is taken with the mouse, in a scene that is new."""
    scene = viewer.scene
    gizmo, handle = scene.gizmo, scene.force_handle

    def dragged(event: TransformControlsEvent) -> None:
        if event.phase == "start":
            with viewer.lock:
                viewer.dragging = True
                viewer.model.history.mark()
        viewer.drag(np.array(gizmo.position), np.array(gizmo.wxyz))
        if event.phase == "end":
            viewer.dragging = False
            viewer.worker.ask()

    def pulled(event: TransformControlsEvent) -> None:
        if event.phase == "start":
            with viewer.lock:
                viewer.pulling = max(float(np.linalg.norm(viewer.model.state.force)), 1.0)
                viewer.model.history.mark()
        viewer.pull(np.array(handle.position))
        if event.phase == "end":
            viewer.pulling = 0.0
            viewer.worker.ask()

    def probed(event: SceneNodeDragEvent[IcosphereHandle]) -> None:
        eye = np.array(event.client.camera.position)
        viewer.probe.along(eye, np.array(event.end_position) - eye)

    gizmo.on_update(dragged)
    handle.on_update(pulled)
    scene.probe.on_drag(probed)


MODES, RATE, PERIOD, SWING = 6, 20.0, 1.5, 0.05
"""Modes shown, pictures per second, seconds of a swing on the screen, its size as part of the extent."""


class Swing:
    """Moves the ghost through a mode while it is switched on."""

    def __init__(self, viewer: Any) -> None:
        self._viewer = viewer
        self._on = threading.Event()
        self._end = False
        self._found: tuple[Moment, NaturalFrequencies | None] | None = None
        self._thread = threading.Thread(target=self._run, daemon=True, name="stiffmap view mode")
        self._thread.start()

    def play(self, on: bool) -> None:
        """Start or hold."""
        if on:
            self._on.set()
        else:
            self._on.clear()
            self._viewer.worker.ask()

    def frequencies(self, moment: Moment) -> NaturalFrequencies | None:
        """The lowest modes; None where bodies lack masses or the pose has none."""
        try:
            w = moment.modes(moment.state.position, MODES)
        except StiffmapError:
            w = None
        if w is not None and not np.isfinite(w.frequency).any():
            w = None
        self._found = (moment, w)
        return w

    def _run(self) -> None:
        while True:
            self._on.wait()
            if self._end:
                return
            begun = time.perf_counter()
            found = self._found
            mode = self._viewer.controls.mode.value - 1
            if found is not None and found[1] is not None and mode < len(found[1].frequency):
                self._frame(found[0], found[1], mode, 2 * np.pi * begun / PERIOD)
            time.sleep(max(0.0, 1 / RATE - (time.perf_counter() - begun)))

    def _frame(self, moment: Moment, w: NaturalFrequencies, mode: int, phase: float) -> None:
        scene = self._viewer.scene
        if not np.isfinite(w.frequency[mode]):
            return
        at = swung(moment.machine, w, mode, phase, SWING * scene.extent)
        moved = skeleton(moment.machine, at).links
        scene.lines("/ghost", moved, GHOST, 0.004 * scene.extent)

    def stop(self) -> None:
        """End the thread."""
        self._end = True
        self._on.set()
