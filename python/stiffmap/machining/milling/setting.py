"""One job: a machine, the points of a path on it, and the force that the cut makes at each (theory.md, M9)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import FileError, StiffmapError
from stiffmap.machining.process.description import Process, mean_force, widened
from stiffmap.machining.process.force import SMALL
from stiffmap.machining.toolpath import Placement, Points, Toolpath, engagement
from stiffmap.machining.toolpath.engagement import Engagement, part_side
from stiffmap.solve.machine import Machine


@dataclass(frozen=True, eq=False)
class Setting:
    """m points in base axes, SI."""

    machine: Machine
    process: Process
    path: Toolpath
    points: Points
    place: Placement
    engaged: Engagement
    position: Floats
    """(m, 3) where the tool's tip is wanted."""
    tangent: Floats
    off: Floats
    """(m, 3) away from the part's wall; of a slot to the left."""
    tool: Floats
    """(m, 3) from the tip to the holder."""
    rotation: Floats
    """(m, 3, 3) commanded orientation."""
    feed: Floats
    """(m,) m/s."""
    faster: Floats
    """(m,) feed per revolution as a multiple of the process's own."""
    angle: Floats | None = None
    """(m,) rad, turn of an arm's tool about its axis; None: as at home."""
    scale: float = 1.0
    """Of the force: 0.8 to 1.2 for a band of 20 %."""
    threads: int | None = None
    """That solve its points; None: all cores."""

    def __len__(self) -> int:
        return len(self.position)

    @property
    def coupled(self) -> tuple[bool, bool]:
        """Whether the cut follows the deflection off the wall, and along the tool."""
        return self.process.cut.side != "slot", not self.process.cut.through

    @cached_property
    def axes(self) -> Floats:
        """(m, 3, 3) rows: feed, normal, along the tool from holder to tip."""
        side = part_side(self.process)
        return np.stack([self.tangent, -side * self.off, -self.tool], axis=1)

    @cached_property
    def ways(self) -> Floats:
        """(m, 2, 3) directions that change the cut: off the wall, and along the tool to its holder."""
        return np.stack([self.off, self.tool], axis=1)

    def fed(self, feed: Floats) -> Setting:
        """The job with other feeds (moves,) m/s of its path."""
        path, points = replace(self.path, feed=feed), replace(self.points, feed=feed[self.points.move])
        feed, faster = _speeds(path, self.process, points)
        return replace(self, path=path, points=points, feed=feed, faster=faster)

    def turns(self, rows: NDArray[np.int64] | None = None) -> Floats:
        """Orientations of some points, None: all; one (3, 3) where all are the same: the kernels need not check each."""
        r = self.rotation
        return r[0] if r.strides[0] == 0 else r if rows is None else r[rows]

    def across(self, error: Floats) -> Floats:
        """(m,) m across the wall, positive where material stays, of errors (m, 3) m; 0 where there is no wall."""
        return np.where(self.engaged.wall, (error * self.off).sum(axis=1), 0.0)

    def width(self, off: Floats) -> Floats:
        """(m,) m: width of the straight cut that has the engaged arc, the tool pushed `off` (m,) m."""
        e, r = self.engaged, self.process.tool.diameter / 2
        radial = np.clip(e.radial - off, 0.0, 2 * r)
        w = widened(self.process, radial, e.curvature)
        if not e.corner.any():
            return w
        arc = np.arccos(np.clip(1 - w / r, -1.0, 1.0)) + np.where(radial > 0, e.corner, 0.0)
        return np.asarray(r * (1 - np.cos(np.minimum(arc, np.pi))))

    def force(self, away: Floats) -> Floats:
        """(m, 3) N, base axes, of the tool pushed (m, 2) m off the wall and up."""
        side, depth = self.coupled
        width = self.width(away[:, 0] if side else np.zeros(len(self)))
        axial = np.maximum(self.engaged.axial - (away[:, 1] if depth else 0.0), 0.0)
        local = mean_force(self.process, width, axial, self.faster)
        return np.asarray(self.scale * np.einsum("mi,mij->mj", local, self.axes))

    def force_slopes(self, away: Floats) -> Floats:
        """(m, 3, 2) N/m of `force` by both, central differences; 0 for what does not couple."""
        out = np.zeros((len(self), 3, 2))
        for k, on in enumerate(self.coupled):
            if on:
                step = np.zeros((1, 2))
                step[0, k] = SMALL
                out[:, :, k] = (self.force(away + step) - self.force(away - step)) / (2 * SMALL)
        return out


def setting(
    machine: Machine,
    path: Toolpath,
    process: Process,
    points: Points,
    place: Placement,
    *,
    stock: Floats | None = None,
    thickness: float | None = None,
    angle: Floats | None = None,
    threads: int | None = None,
) -> Setting:
    """A job; `angle` (m,) rad turns the tool of an arm about its axis. Raises StiffmapError for what does not go together."""
    if angle is not None and np.shape(angle) != (len(points),):
        raise StiffmapError(f"angle: expected {len(points)} turns of the tool (rad), one for each point")
    speeds = _speeds(path, process, points)
    if angle is None and path.turn is not None:
        if len(machine.actuators) < 6:
            raise FileError(
                f"the path turns the tool about its axis (C, turn_deg); {machine.name} has no such motion: it needs six drives",
                file=path.name,
            )
        angle = path.turn_at(points.move, points.share)
    tool = place.vectors(points.tool)
    return Setting(
        machine,
        process,
        path,
        points,
        place,
        engagement(points, path, process, stock, thickness),
        place.points(points.position),
        place.vectors(points.tangent),
        -part_side(process) * place.vectors(points.normal),
        tool,
        orientations(machine, tool, angle),
        *speeds,
        angle,
        threads=threads,
    )


def _speeds(path: Toolpath, process: Process, points: Points) -> tuple[Floats, Floats]:
    """`feed` and `faster` of a job. Raises FileError for what cuts nothing, or too thick a chip."""
    for wrong, message in (
        (points.spindle == 0, "the spindle is off in a cut: expected M3 and S above zero before it"),
        (points.spindle < 0, "the spindle turns counter-clockwise (M4): the process is for a clockwise one"),
        (points.feed <= 0, "expected a feed above zero"),
    ):
        if wrong.any():
            line = int(path.line[points.move[int(np.argmax(wrong))]])
            raise FileError(message, file=path.name, line=line)
    feed = np.where(np.isfinite(points.feed), points.feed, process.feed)
    spindle = np.where(np.isfinite(points.spindle), points.spindle, process.spindle)
    faster = np.asarray(feed / spindle / (process.feed / process.spindle))
    thick = faster * process.chip
    if process.tool.teeth and (thick > process.tool.diameter / 2).any():
        at = int(np.argmax(thick))
        what = f"the chip is too thick: {1e3 * thick[at]:.4g} mm per tooth with this feed and spindle speed"
        raise FileError(what, file=path.name, line=int(path.line[points.move[at]]))
    return feed, faster


def orientations(machine: Machine, tool: Floats, angle: Floats | None) -> Floats:
    """(m, 3, 3): at home the tool stands along the base's z; elsewhere the smallest turn from there, then `angle` about it."""
    home = machine.description.home.r
    upright = np.array([0.0, 0.0, 1.0])
    if np.abs(tool - upright).max() < 1e-12:
        base = np.broadcast_to(home, (len(tool), 3, 3))
    else:
        cosine = tool[:, 2]
        if (cosine < -1 + 1e-9).any():
            raise StiffmapError("tool axis: a tool that points upwards from below has no smallest turn")
        base = Rotation.from_quat(np.column_stack([np.cross(upright, tool), 1 + cosine])).as_matrix() @ home
    if angle is None:
        return np.asarray(base)
    return np.asarray(Rotation.from_rotvec(np.asarray(angle)[:, None] * tool).as_matrix() @ base)
