"""The scene in the browser: handles of viser, and what is sent to them."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from stiffmap.common.broadcasting import Floats
from stiffmap.solve.solution import Solution
from stiffmap.ui.plot.scene import ARROW, FORCE, box_edges
from stiffmap.ui.plot.skeleton import COINCIDENT, Skeleton, thicknesses
from stiffmap.ui.plot.style import BLACK, ORANGE, SKY, TOLERANCE, leg_colours
from stiffmap.ui.view.meshes import Meshes
from stiffmap.ui.view.moment import Moment, box_of, moves, turns
from stiffmap.ui.view.plane import NO_LINES, PlaneMap, plane_image, rgb

if TYPE_CHECKING:
    from viser import ImageHandle, LineSegmentsHandle, MeshHandle, PointCloudHandle, SceneApi, ViserServer

Shape = Literal["circle", "square"]
Units = Literal["world", "screen"]
SURFACE = 0.12  # of the extent, size of the surface at the tool
GHOST, LIT, DIAGNOSED = ORANGE, "#FFD400", "#E8279B"
GREY, DARK = "#BBBBBB", "#666666"


def _seen(points: Floats) -> NDArray[np.float32]:
    """Points as they are sent; where there are none, one that is hidden, as no node is empty."""
    return np.asarray(points if len(points) else np.zeros((1, *np.shape(points)[1:])), np.float32)


def quaternion(rotation: Floats) -> tuple[float, float, float, float]:
    """w, x, y, z of a matrix (3, 3)."""
    x, y, z, w = (float(v) for v in Rotation.from_matrix(rotation).as_quat())
    return w, x, y, z


class Scene:
    """Draws moments; the nodes are made once and then only changed."""

    def __init__(self, api: SceneApi, moment: Moment) -> None:
        self.api = api
        self.rest = rest = moment.rest()
        self.extent = rest.extent
        self.arrow_length = ARROW * self.extent
        """Of a force that is not being dragged, m."""
        self._lines: dict[str, LineSegmentsHandle] = {}
        self._surfaces: dict[str, MeshHandle] = {}
        self._image: ImageHandle | None = None
        self._frame_size = (0.0, 0.0)
        self.lit: list[int] = []
        self.diagnosed: list[int] = []
        """Links on which an element that was chosen, or that a diagnosis named, is lit."""
        self._groups = _groups(moment, rest)
        api.set_up_direction("+z")
        api.world_axes.visible = False
        api.add_frame("/axes", axes_length=0.08 * self.extent, axes_radius=0.002 * self.extent)
        self._points = self.points("/joints/passive", rest.passive, rgb("#FFFFFF"), 0.008)
        self._drives = self.points("/joints/drives", rest.actuators, rgb(BLACK), 0.014, "square")
        self._meshes = None if moment.meshes is None else Meshes(api, moment.machine, moment.meshes)
        self.remark = "" if self._meshes is None else self._meshes.remark
        self._arrow = api.add_arrows(
            "/force", np.zeros((1, 2, 3), np.float32), rgb(FORCE), shaft_radius=0.005 * self.extent,
            head_radius=0.013 * self.extent, head_length=0.035 * self.extent, visible=False,
        )  # fmt: skip
        self.lines("/box", box_edges(*box_of(moment.machine)), GREY, 1.5, "screen")
        if len(rest.guides):
            self.lines("/travel", rest.guides, GREY, 0.006 * self.extent)
        free = moves(moment.machine)
        self.gizmo = api.add_transform_controls(
            "/tool", scale=0.14 * self.extent, active_axes=free if any(free) else (True, True, True), disable_rotations=not any(turns(moment.machine)),
            disable_sliders=not all(free), depth_test=False, position=tuple(rest.tcp),
        )  # fmt: skip

        self.force_handle = api.add_transform_controls(
            "/force_handle", scale=0.06 * self.extent, disable_rotations=True, depth_test=False,
        )  # fmt: skip
        self.probe = api.add_icosphere("/probe", 0.01 * self.extent, rgb(FORCE), visible=False)
        self._said = api.add_label("/probe/label", "", anchor="bottom-left")

    def lines(self, name: str, points: Floats, colour: str, thick: float, units: Units = "world") -> None:
        """Pieces of lines (n, 2, 3); none hide the node."""
        there = self._lines.get(name)
        shown = len(points) > 0
        p = _seen(points)
        if there is None or there.points.shape != p.shape:
            self._lines[name] = self.api.add_line_segments(
                name, p, rgb(colour), thickness=thick, thickness_units=units, visible=shown
            )
            return
        there.points = p
        if there.visible != shown:
            there.visible = shown

    def points(
        self,
        name: str,
        places: Floats,
        colours: NDArray[np.uint8] | tuple[int, int, int],
        size: float,
        shape: Shape = "circle",
    ) -> PointCloudHandle:
        """Places (n, 3) as dots of a size (of the extent), in one colour or one for each; none hide them. Their handle."""
        return self.api.add_point_cloud(
            name, _seen(places), colours if len(places) else rgb(GREY), point_size=size * self.extent,
            point_shape=shape, precision="float32", visible=len(places) > 0,
        )  # fmt: skip

    def mesh(
        self, name: str, vertices: Floats, faces: NDArray[np.uint32], colour: str, opacity: float = 0.4
    ) -> None:
        """A surface seen from both sides; without triangles it is hidden."""
        there, shown = self._surfaces.get(name), len(faces) > 0
        v = np.asarray(vertices, np.float32)
        if there is None or not np.array_equal(there.faces, faces):
            self._surfaces[name] = self.api.add_mesh_simple(
                name, v, faces if shown else np.zeros((1, 3), np.uint32), color=rgb(colour), opacity=opacity,
                side="double", cast_shadow=False, visible=shown,
            )  # fmt: skip
            return
        there.vertices, there.visible = v, True

    def machine(self, rest: Skeleton, ghost: Floats) -> None:
        """Links, joints, platform, and the links of the deflected ghost."""
        self.rest = rest
        for name, colour, thick, chosen in self._groups:
            self.lines(name, rest.links[chosen], colour, thick)
        if self._meshes is not None:
            self._meshes(rest.coordinates)
        self._points.points, self._drives.points = _seen(rest.passive), _seen(rest.actuators)
        if len(rest.plate):
            middle = np.concatenate([rest.plate, rest.plate.mean(axis=0)[None]])
            n = len(rest.plate)
            fan = np.array([[i, (i + 1) % n, n] for i in range(n)], np.uint32)
            self.mesh("/platform", middle, fan, DARK)
        self.lines("/ghost", ghost, GHOST, 0.004 * self.extent)
        self.lights()

    def lights(self) -> None:
        """Links on which an element is lit."""
        links = self.rest.links
        named = links[self.diagnosed] if self.diagnosed else NO_LINES
        self.lines("/diagnosis/element", named, DIAGNOSED, 0.025 * self.extent)
        self.lines("/lit", links[self.lit] if self.lit else NO_LINES, LIT, 0.03 * self.extent)

    def tool(self, moment: Moment) -> None:
        """The gizmo at the tool of the state."""
        self.gizmo.position = moment.state.position
        self.gizmo.wxyz = quaternion(moment.rotation)

    def force(self, moment: Moment, pulled: float = 0.0) -> None:
        """The arrow that ends at the tool; one that is dragged from a size `pulled` (N) is as long as it is pulled."""
        f = np.array(moment.state.force)
        size = float(np.linalg.norm(f))
        tip = np.array(moment.state.position)
        tail = tip - (self.arrow_length / (pulled or size) * f if size else 0.0)
        if not pulled:
            self.force_handle.position = tuple(tail if size else tip + (0.0, 0.0, self.arrow_length))
        self._arrow.points = np.array([[tail, tip]], np.float32)
        self._arrow.visible = size > 0

    def plane(self, found: PlaneMap, limits: tuple[float, float], tolerance: float, lines: bool) -> None:
        """The coloured plane, and lines of equal value on it."""
        image, f = plane_image(found, limits), found.frame
        stretch = found.count / (found.count - 1)  # nodes are the centres of pixels
        size = (f.width * stretch, f.height * stretch)
        if self._image is None or size != self._frame_size:
            self._image = self.api.add_image("/map", image, *size, format="png", cast_shadow=False)
            self._frame_size = size
        else:
            self._image.image = image
        self._image.position = tuple(f.centre)
        self._image.wxyz = quaternion(np.stack([f.u, f.v, f.normal], axis=1))
        self._image.visible = True
        lift = 5e-4 * self.extent * f.normal  # to both sides of the plane
        flat = found.isolines(limits) if lines else NO_LINES
        self.lines("/isolines", np.concatenate([flat + lift, flat - lift]), "#FFFFFF", 1.2, "screen")
        edge = found.tolerance_lines(tolerance)
        self.lines("/tolerance", np.concatenate([edge + lift, edge - lift]), TOLERANCE, 3.5, "screen")

    def no_plane(self) -> None:
        """Hide the map."""
        if self._image is not None:
            self._image.visible = False
        for name in ("/isolines", "/tolerance"):
            if name in self._lines:
                self._lines[name].visible = False

    def surface(self, moment: Moment, solution: Solution, kind: str) -> str:
        """The polar diagram or the ellipsoid at the tool; what its size means, in words."""
        c = solution.compliance[:3, :3]
        if kind == "none" or not np.isfinite(c).all():
            if "/surface" in self._surfaces:
                self._surfaces["/surface"].visible = False
            return ""
        make = ellipsoid if kind == "ellipsoid" else polar_surface
        around, most = make(c, SURFACE * self.extent)
        self.mesh("/surface", around + np.array(moment.state.position), sphere()[1], SKY, 0.45)
        return f"longest radius: {1e6 * most:.4g} µm/N"

    def marker(self, point: Floats, text: str) -> None:
        """What the probe says, at its place."""
        self.probe.position, self._said.text, self.probe.visible = tuple(point), text, True


def _groups(moment: Moment, rest: Skeleton) -> list[tuple[str, str, float, list[int]]]:
    """Node, colour, thickness and links of each set of links that look alike."""
    thick = thicknesses(moment.machine, rest)
    colours = leg_colours(moment.machine.legs) | {"": DARK}
    sets: dict[tuple[str, float], list[int]] = {}
    for i, (leg, (start, end)) in enumerate(zip(rest.legs, rest.links, strict=True)):
        if np.linalg.norm(end - start) > COINCIDENT:
            sets.setdefault((leg, round(float(thick[i]), 5)), []).append(i)
    return [(f"/links/{k}", colours[leg], t, found) for k, ((leg, t), found) in enumerate(sets.items())]


def look_at_machine(server: ViserServer, rest: Skeleton) -> None:
    """The first look: from the front right, from above where all lies in a plane of constant height."""
    points = np.vstack(
        [rest.links.reshape(-1, 3), rest.tcp]
    )  # not the travel of the drives, which reaches far beyond
    middle = (points.min(axis=0) + points.max(axis=0)) / 2
    direction = np.array([0.02, -0.05, 1.0] if rest.is_flat else [0.75, -0.9, 0.6])
    server.initial_camera.look_at = tuple(middle)
    server.initial_camera.position = tuple(middle + 0.8 * rest.extent * direction / np.linalg.norm(direction))
    server.initial_camera.up = (0.0, 0.0, 1.0)


RINGS, SECTORS = 24, 48  # of the sphere of directions in which the tool is pushed


@cache
def sphere() -> tuple[Floats, NDArray[np.uint32]]:
    """Vertices (n, 3) and triangles (m, 3) of a unit sphere."""
    a = np.linspace(0, np.pi, RINGS + 1)[:, None]
    b = np.linspace(0, 2 * np.pi, SECTORS, endpoint=False)[None]
    points = np.stack([np.sin(a) * np.cos(b), np.sin(a) * np.sin(b), np.cos(a) + 0 * b], axis=-1)
    i, j = np.meshgrid(np.arange(RINGS), np.arange(SECTORS), indexing="ij")
    right = (j + 1) % SECTORS
    p, q, r, s = (u * SECTORS + v for u, v in ((i, j), (i + 1, j), (i + 1, right), (i, right)))
    faces = np.concatenate([np.stack(t, -1).reshape(-1, 3) for t in ((p, q, r), (p, r, s))])
    return points.reshape(-1, 3), faces.astype(np.uint32)


def polar_surface(compliance: Floats, size: float) -> tuple[Floats, float]:
    """Vertices relative to the tool, and the deflection (m/N) that the longest stands for.

    In each direction u of a force the distance is the deflection |C u|; the longest is drawn `size` (m).
    """
    moved, most = ellipsoid(compliance, size)
    return np.asarray(sphere()[0] * np.linalg.norm(moved, axis=1, keepdims=True)), most


def ellipsoid(compliance: Floats, size: float) -> tuple[Floats, float]:
    """The same of the displacements C u themselves: an ellipsoid."""
    d = sphere()[0] @ compliance.T
    most = float(np.linalg.norm(d, axis=1).max())
    return np.asarray(d * (size / most if most > 0 else 0.0)), most
