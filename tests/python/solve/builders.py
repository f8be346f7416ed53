"""Small machines of the tests, written as descriptions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

import stiffmap as sm
from stiffmap.model.description import (
    Block,
    Branch,
    Element,
    Joint,
    Law,
    Leg,
    MachineDescription,
    Offset,
    Pose,
    Spring,
)

AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}


def shift(name: str, translation: ArrayLike) -> Offset:
    return Offset(name, Pose.of(translation))


def revolute(name: str, axis: str = "z", home: float = 0.0, law: Law | None = None) -> Joint:
    return Joint(name, "revolute", (AXES[axis],), home=(home,), law=law)


def slider(name: str, axis: str = "x", home: float = 0.0, law: Law | None = None) -> Joint:
    return Joint(name, "prismatic", (AXES[axis],), home=(home,), actuated=True, law=law)


def motor(name: str, axis: str = "z", home: float = 0.0, law: Law | None = None) -> Joint:
    return Joint(name, "revolute", (AXES[axis],), home=(home,), actuated=True, law=law)


def matrix(values: ArrayLike) -> tuple[tuple[float, ...], ...]:
    return tuple(tuple(float(v) for v in row) for row in np.asarray(values, dtype=float))


def stiff(name: str, values: ArrayLike) -> Spring:
    return Spring(name, stiffness=matrix(values))


def soft(name: str, values: ArrayLike) -> Spring:
    return Spring(name, compliance=matrix(values))


def serial(*elements: Element, name: str = "arm", home: Pose | None = None) -> sm.Machine:
    return sm.Machine(MachineDescription(name, (Leg("arm", tuple(elements)),), home=home or Pose()))


def parallel(*legs: tuple[Element, ...], home: Pose | None = None) -> sm.Machine:
    made = tuple(Leg(f"leg{i + 1}", leg) for i, leg in enumerate(legs))
    return sm.Machine(MachineDescription("parallel", made, home=home or Pose()))


def block(name: str, *branches: tuple[Element, ...]) -> Block:
    return Block(name, tuple(Branch(f"b{i + 1}", b) for i, b in enumerate(branches)))


def random_spd(rng: np.random.Generator, scale: float = 1e6) -> np.ndarray:
    """A full symmetric positive definite 6x6 stiffness of a link about a metre long."""
    a = rng.normal(size=(6, 6))
    return scale * (a @ a.T + 2 * np.eye(6))


def cantilever_compliance(length: float, ea: float, ei: float, gj: float) -> np.ndarray:
    """Free end of a straight beam along x (textbook, not the library's)."""
    c = np.diag(
        [length / ea, length**3 / (3 * ei), length**3 / (3 * ei), length / gj, length / ei, length / ei]
    )
    c[1, 5] = c[5, 1] = length**2 / (2 * ei)
    c[2, 4] = c[4, 2] = -(length**2) / (2 * ei)
    return c


def rotation(axis: ArrayLike, angle: float) -> np.ndarray:
    """Rodrigues."""
    u = np.asarray(axis, dtype=float) / np.linalg.norm(axis)
    s = np.array([[0, -u[2], u[1]], [u[2], 0, -u[0]], [-u[1], u[0], 0]])
    return np.eye(3) + np.sin(angle) * s + (1 - np.cos(angle)) * s @ s


def turned(description: MachineDescription, r: np.ndarray, p: ArrayLike = (0, 0, 0)) -> sm.Machine:
    """The whole machine, carried by the rigid motion x -> p + r x."""
    placed = replace(
        description,
        base=(Offset("placed", Pose.of(p, r)), *description.base),
        home=Pose.of(p, r) @ description.home,
        workspace=None,
        gravity=None,
    )
    return sm.Machine(placed)


def parallelogram(k: np.ndarray, d: float, length: float, q: float) -> sm.Machine:
    """Two bars on pins about y at z = +-d/2, turned by q; the far frame keeps its orientation."""

    def bar(side: float) -> tuple[object, ...]:
        return (
            shift("out", (0, 0, side * d / 2)),
            revolute("proximal", "y", q),
            shift("length", (length, 0, 0)),
            stiff("bar", k),
            revolute("distal", "y", -q),
            shift("back", (0, 0, -side * d / 2)),
        )

    tip = (length * np.cos(q), 0.0, -length * np.sin(q))
    return serial(block("bars", bar(1), bar(-1)), home=Pose.of(tip))  # type: ignore[arg-type]
