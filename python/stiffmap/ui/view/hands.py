"""What a hand does in the scene: the tool, the tail of the force and the probe follow the mouse."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from stiffmap.common.broadcasting import Floats
from stiffmap.ui.view.numbers import write
from stiffmap.ui.view.panels import probe_text

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
