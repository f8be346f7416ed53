"""Small cable machines for tests, in SI."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from stiffmap import Machine
from stiffmap.model.description import Body, Cable, MachineDescription, Pose
from stiffmap.model.description.machine import TASK

XYZ = ("x", "y", "z")


def hanging(
    anchors: Sequence[tuple[float, float, float]],
    *,
    at: Sequence[tuple[float, float, float]] | None = None,
    freedoms: tuple[str, ...] = XYZ,
    mass: float = 0.0,
    gravity: tuple[float, float, float] | None = None,
    home: tuple[float, float, float] = (0.0, 0.0, 0.0),
    **cable: Any,
) -> Machine:
    """A body in cables from `anchors`, all alike."""
    points = at or [(0.0, 0.0, 0.0)] * len(anchors)
    cables = tuple(
        Cable(f"c{i + 1}", anchor=a, at=b, **cable)
        for i, (a, b) in enumerate(zip(anchors, points, strict=True))
    )
    body = (Body("body", mass),) if mass else ()
    return Machine(
        MachineDescription(
            "hanging",
            (),
            platform=(*cables, *body),
            home=Pose(home),
            freedoms=tuple(c for c in TASK if c in freedoms),
            gravity=gravity,
        )
    )
