"""Where a named point is at commanded poses: nominal geometry, springs at rest."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.spatial.transform import Rotation

from stiffmap.compiled.ball import charted
from stiffmap.description import Block, Element, Joint, MachineDescription, Offset, Point, Pose
from stiffmap.experiment.configuration import coordinates_of
from stiffmap.experiment.experiment import Experiment, Floats
from stiffmap.machine import Machine

Frame = tuple[Floats, Floats]
"""Positions (n, 3) and rotations (n, 3, 3)."""


def point_positions(machine: Machine, name: str, plan: Experiment) -> Floats:
    """(n, 3) m, base axes, of a point where each row is commanded; NaN where that is out of reach."""
    if name == "tcp":
        return plan.position
    found = coordinates_of(machine, plan)
    at = {n: found[:, i] for i, n in enumerate(machine.compiled.names.coordinates)}
    walked = _walk(machine.description, name, at, len(plan))
    return np.where(np.asarray(np.isfinite(found).all(axis=1))[:, None], walked, np.nan)


def _walk(d: MachineDescription, name: str, at: Mapping[str, Floats], n: int) -> Floats:
    start = (np.zeros((n, 3)), np.broadcast_to(np.eye(3), (n, 3, 3)))
    frame, found = _along(d.base, "base", name, at, start)
    for leg in d.legs:
        if found is None:
            end, found = _along(leg.elements, leg.name, name, at, frame)
    if found is None:
        _, found = _along(d.platform, "platform", name, at, end)
    if found is None:
        raise KeyError(name)
    return found


def _along(
    elements: tuple[Element, ...], path: str, name: str, at: Mapping[str, Floats], frame: Frame
) -> tuple[Frame, Floats | None]:
    """Frame at the end of a sequence, and the point where it is in it."""
    for e in elements:
        full = f"{path}.{e.name}"
        if isinstance(e, Point) and full == name:
            return frame, frame[0] + frame[1] @ np.array(e.offset)
        if isinstance(e, Block):
            ends = [_along(b.elements, f"{path}.{b.name}", name, at, frame) for b in e.branches]
            found = next((f for _, f in ends if f is not None), None)
            if found is not None:
                return frame, found
            frame = ends[0][0]
        elif isinstance(e, Offset):
            frame = _step(frame, e.nominal)
        elif isinstance(e, Joint):
            own, turn = charted(e)
            frame = _turn(frame if turn is None else _step(frame, turn), own, full, at)
    return frame, None


def _step(frame: Frame, pose: Pose) -> Frame:
    p, r = frame
    return p + r @ pose.p, r @ pose.r


def _turn(frame: Frame, joint: Joint, full: str, at: Mapping[str, Floats]) -> Frame:
    p, r = frame
    for i, axis in enumerate(np.array(joint.axes)):
        value = at[full if len(joint.axes) == 1 else f"{full}.{i + 1}"]
        if joint.kind == "prismatic":
            p = p + (r @ axis) * value[:, None]
        else:
            r = r @ Rotation.from_rotvec(np.nan_to_num(value)[:, None] * axis).as_matrix()
    return p, r
