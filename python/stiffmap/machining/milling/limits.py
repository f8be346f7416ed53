"""Ranges, efforts and speeds of the drives along a job, and warnings at its points; paths that leave the workspace.

A further kind of warning is a function of the job and its dataset in SOURCES.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import StiffmapError
from stiffmap.common.number_text import place_text
from stiffmap.machining.milling.setting import Setting
from stiffmap.solve.kinematics import SAME, inverse_kinematics, missed, missed_words
from stiffmap.solve.machine import Machine
from stiffmap.solve.status import Flag, Status
from stiffmap.workspace.performance.motion.closing import declared

STILL = 1e-12
"""m/s, rad/s: what a drive that stands still is seen to move by round-off."""
BROKEN = {"joint range": Flag.JOINT_LIMIT, "drive range": Flag.DRIVE_RANGE, "drive effort": Flag.DRIVE_FORCE}


def drive_speeds(job: Setting) -> Floats:
    """(m, actuators) m/s, rad/s at the feed; NaN out of reach."""
    ends = [
        inverse_kinematics(job.machine, job.position + s * 1e-5 * job.tangent, job.rotation).actuators
        for s in (-1, 1)
    ]
    return np.asarray((ends[1] - ends[0]) / 2e-5 * job.feed[:, None])


def fastest(machine: Machine) -> Floats:
    """(actuators,) m/s, rad/s; infinite where none is declared, of a drive that is declared to stand still only round-off."""
    return np.maximum(declared(machine, "speed", np.inf), STILL)


def outside(ds: xr.Dataset, machine: Machine) -> dict[str, np.ndarray]:
    """Points (m,) bool that break each limit, as they are cut or as compensated."""
    flags = ds.flags.values | ds.flags_after.values
    out = {name: np.asarray(flags & flag > 0) for name, flag in BROKEN.items()}
    out["drive speed"] = (np.abs(ds.speed.values) > fastest(machine)).any(axis=1)
    if machine.description.workspace is not None:
        low, high = np.array(machine.description.workspace) + [[-1e-9], [1e-9]]
        out["declared workspace"] = ((ds.wanted.values < low) | (ds.wanted.values > high)).any(axis=1)
    return out


@dataclass(frozen=True, eq=False)
class Warned:
    """One warning: its name, the points that it is about, and a sentence."""

    name: str
    """Few words, as ``drive speed``."""
    points: NDArray[np.bool_]
    """(m,)."""
    text: str
    """A sentence for the report."""
    finding: bool = True
    """Whether the command ends with exit code 1."""


def limits(job: Setting, ds: xr.Dataset) -> list[Warned]:
    """Ranges, efforts and speeds of the drives; the box of the machine file is only mentioned."""
    out = []
    for name, points in outside(ds, job.machine).items():
        text = f"The {name} is broken at {int(points.sum())} of {points.size} points."
        if name == "declared workspace":
            text = f"{int(points.sum())} of {points.size} points are outside the workspace that the machine file declares."
        out.append(Warned(name, points, text, finding=name != "declared workspace"))
    return out


def chatter(job: Setting, ds: xr.Dataset) -> list[Warned]:
    """Where the cut is unstable, with speeds of the spindle that are stable all along the path."""
    if "multiplier" not in ds:
        return []
    return [Warned("chatter", ds.multiplier.values > 1, ds.multiplier.attrs["said"])]


def corners(job: Setting, ds: xr.Dataset) -> list[Warned]:
    """What happens to sharp outside corners: the two walls that meet in each."""
    none = ~job.engaged.wall
    last = np.flatnonzero(none != np.r_[none[1:], none[-1:]])  # next to it, on the one or the other side
    near = np.unique(np.where(none[last], np.minimum(last + 1, len(none) - 1), last))
    most = [1e3 * np.nanmax(np.abs(ds[n].values[near]), initial=0.0) for n in AT_CORNERS]
    text = (
        f"Sharp outside corners have no wall within a tool radius, so that {int(none.sum())} points next to them do not count; the "
        f"walls that meet there are off by up to {most[0]:.4f} mm, compensated {most[1]:.4f} mm."
    )
    return [Warned("outside corner", none, text, finding=False)]


def slots(job: Setting, ds: xr.Dataset) -> list[Warned]:
    """Where the stock ends within the width of a slot, whose force does not follow that."""
    e, cut = job.engaged, job.process.cut
    part = (e.radial < cut.radial * (1 - 1e-9)) & (e.axial > 0) & (cut.side == "slot")
    text = f"The stock is narrower than the slot at {part.sum()} of {part.size} points, where the force is still that of a full slot."
    return [Warned("slot", part, text, finding=False)]


AT_CORNERS = ("error_normal", "error_normal_after")
SOURCES: tuple[Callable[[Setting, xr.Dataset], list[Warned]], ...] = (limits, chatter, corners, slots)


def warned(job: Setting, ds: xr.Dataset) -> tuple[Warned, ...]:
    """All warnings that are about at least one point; the dataset gets `warnings` (m,), one bit for each of its attribute `names`."""
    found = tuple(w for source in SOURCES for w in source(job, ds) if w.points.any())
    bits = np.zeros(len(job), np.uint32)
    for k, w in enumerate(found):
        bits |= np.where(w.points, np.uint32(1 << k), np.uint32(0))
    ds["warnings"] = ("point", bits)
    ds["warnings"].attrs["names"] = [w.name for w in found]
    return found


def reached(job: Setting, position: Floats) -> NDArray[np.bool_]:
    """(...,) bool: poses (..., m, 3) that the machine takes without load."""
    s = job.machine.solve(position, rotation=job.rotation, stiffness=False, threads=job.threads)
    return np.asarray((s.status != Status.UNREACHABLE) & followed(job, position))


def astray(job: Setting, position: Floats) -> Floats:
    """(..., m, 6) m, rad by which the machine misses what the path asks for at positions (..., m, 3): of the three coordinates, the
    tool's axis, and the turn about it where the path sets one."""
    gap = missed(job.machine, position, job.rotation, job.threads)
    if job.angle is None:
        axis = np.einsum("mji,mj->mi", job.rotation, job.tool)
        gap[..., 3:] -= (gap[..., 3:] * axis).sum(axis=-1, keepdims=True) * axis
    return gap


def followed(job: Setting, position: Floats) -> NDArray[np.bool_]:
    """(..., m) bool: positions (..., m, 3) m at which the machine does what the path asks for."""
    return np.asarray((np.abs(astray(job, position)) <= SAME).all(axis=-1))


def must_follow(job: Setting) -> None:
    """Raise StiffmapError with the directions in which the machine does not follow the path."""
    gap = astray(job, job.position)
    words = missed_words(job.machine, gap)
    if words:
        i = int(np.argmax((np.abs(gap) > SAME).any(axis=-1)))
        raise StiffmapError(
            f"{job.machine.name} cannot follow the path: it misses {words}; from line {job.path.line[job.points.move[i]]} of the path on"
        )


def must_reach(job: Setting) -> None:
    """Raise StiffmapError naming the points out of reach, how far the part sticks out, and a place that holds it."""
    must_follow(job)
    ok = reached(job, job.position)
    if ok.all():
        return
    lost = np.flatnonzero(~ok)
    lines = job.path.line[job.points.move[lost]]
    upright = job.machine.solve(job.position[lost], stiffness=False, threads=job.threads)
    if (upright.status != Status.UNREACHABLE).all():
        tilt = np.degrees(np.arccos(np.clip(job.tool[lost, 2], -1.0, 1.0))).max()
        raise StiffmapError(
            f"{job.machine.name} cannot hold the tool as the path asks, tilted by up to {tilt:.4g} deg: {lost.size} of {len(job)} points, "
            f"from line {lines[0]} of the path on; it reaches all of them with the tool as at home"
        )
    text = (
        f"the path leaves the workspace of {job.machine.name}: {lost.size} of {len(job)} points, the first at {place_text(job.position[lost[0]], '.1f')}, "
        f"line {lines[0]} of the path"
    )
    box = job.machine.description.workspace
    if box is None:
        raise StiffmapError(text)
    low, high = np.array(box)
    out = np.maximum(np.maximum(low - job.position, job.position - high), 0.0).max(axis=0)
    text += f"; beyond the declared box by up to {place_text(out, '.1f')}"
    if (np.ptp(job.position, axis=0) > high - low).any():
        raise StiffmapError(f"{text}; the part is larger than that box")
    middle = (job.position.max(axis=0) + job.position.min(axis=0)) / 2
    shift = (low + high) / 2 - middle
    fits = reached(job, job.position + shift).all()
    at = place_text(job.place.at + shift, ".1f")
    raise StiffmapError(f"{text}; it fits with the part's origin at {at}" if fits else text)
