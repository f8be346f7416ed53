"""Structures whose buckling and snap-through loads have closed forms."""

from __future__ import annotations

import numpy as np
from tests.python.solve import builders as b

import stiffmap as sm
from stiffmap.model.description import Joint, Law, Offset, Pose

SPRING, REACH, RISE = 1.0e5, 0.5, 0.1


def bar(side: int, hinged: bool) -> tuple[object, ...]:
    """One bar of the truss: from a support at x = side REACH up to the apex at (0, RISE)."""
    length, angle = np.hypot(REACH, RISE), np.arctan2(RISE, -side * REACH)
    elements = [
        b.shift("support", (side * REACH, 0, 0)),
        b.revolute("foot", "z", angle),
        Joint("length", "prismatic", ((1.0, 0.0, 0.0),), home=(length,), law=Law(SPRING)),
    ]
    return (
        (*elements, b.revolute("apex", "z", -angle))
        if hinged
        else (*elements, Offset("back", Pose.of((0, 0, 0), b.rotation((0, 0, 1), -angle))))
    )


def truss(loose: bool = False) -> sm.Machine:
    """Two bars that stretch and nothing else; the platform rides on the left one (loose: on a pin)."""
    return b.parallel(bar(-1, loose), bar(1, True), home=Pose.of((0, RISE, 0)))


def truss_force(drop: np.ndarray) -> np.ndarray:
    """Downward force at the apex after a drop (m), dead load: F = 2 k (L0 - L) h / L."""
    height = RISE - drop
    rest, length = np.hypot(REACH, RISE), np.hypot(REACH, height)
    return 2 * SPRING * (rest - length) * height / length


def column(links: int, stiffness: float = 100.0, link: float = 0.2) -> sm.Machine:
    """Cantilever column along x: rigid links on rotational springs about z, clamped at the foot."""
    elements = []
    for i in range(links):
        elements += [
            b.revolute(f"hinge_{i + 1}", "z", law=Law(stiffness)),
            b.shift(f"link_{i + 1}", (link, 0, 0)),
        ]
    return b.serial(*elements, home=Pose.of((links * link, 0, 0)))


def column_load(links: int, mode: int = 1, stiffness: float = 100.0, link: float = 0.2) -> float:
    """Buckling load of the hinged column: (c / l) 2 (1 - cos((2 mode - 1) pi / (2 links + 1)))."""
    return stiffness / link * 2 * (1 - np.cos((2 * mode - 1) * np.pi / (2 * links + 1)))
