"""Pieces of the hand-made machines of `unseen`: struts, square bars, strips, drives that only pull."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from stiffmap.model.description import Body, Element, Joint, Law, Leg, Offset, Pose, Spring

from .parts import end_of

X, Y, Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
SLACK = -2.0  # m: a one-sided law bears nothing from here to zero


def turn(axis: str, degrees: float) -> np.ndarray:
    """(3, 3) rotation about a coordinate axis."""
    return np.asarray(Rotation.from_euler(axis, degrees, degrees=True).as_matrix())


def pulls(stiffness: float, preload: float = 0.0) -> Law:
    """A drive that only pulls: nothing where it would push. `preload`: m that are wound up beyond the command."""
    return Law(stiffness, knots=((SLACK, -1e-6 * stiffness * -SLACK), (-preload, 0.0)))


def strut(
    name: str, foot: np.ndarray, head: np.ndarray, home: Pose, law: Law, *, elastic: bool = False
) -> Leg:
    """Universal joint, drive along the line to the head, ball."""
    line = head - foot
    z = line / np.linalg.norm(line)
    x = np.cross((0.3, 0.8, 0.1), z)
    x /= np.linalg.norm(x)
    rod: list[Element] = []
    if elastic:
        rod = [Body("rod", 5.0, (0.0, 0.0, -0.3)), beam("rod", 0.7, 0.06, along="z")]
    out: list[Element] = [
        Offset("foot", Pose.of(foot, np.column_stack([x, np.cross(z, x), z]))),
        Joint("cardan", "universal", (X, Y), (0.0, 0.0)),
        Joint("drive", "prismatic", (Z,), (float(np.linalg.norm(line)),), actuated=True, law=law),
        *rod,
        Joint("ball", "spherical", (X, Y, Z), (0.0, 0.0, 0.0)),
    ]
    return closed(name, out, home)


def closed(name: str, out: Sequence[Element], home: Pose) -> Leg:
    return Leg(name, (*out, Offset("attach", end_of(list(out)).inverse() @ home)))


def matrix(name: str, diagonal: Sequence[float]) -> Spring:
    return Spring(name, stiffness=tuple(map(tuple, np.diag(diagonal).tolist())))


def beam(name: str, length: float, side: float, along: str = "x", young: float = 7e10) -> Spring:
    """A square bar, at its end."""
    return bar(name, length, side, side, young, along)


def leaf(name: str, length: float, wide: float, thick: float) -> Spring:
    """A piece of steel strip along z that bends about y, in its middle."""
    area, iy, ix = wide * thick, wide * thick**3 / 12, thick * wide**3 / 12
    young, shear = 2.1e11, 8.1e10
    k = [12 * young * iy / length**3, 12 * young * ix / length**3, young * area / length]
    k += [young * ix / length, young * iy / length, shear * 4 * iy / length]
    return matrix(name, k)


def bar(name: str, length: float, width: float, height: float, young: float, along: str) -> Spring:
    area, second = width * height, width * height**3 / 12
    bend, turning, both = length**3 / 3, length, length**2 / 2
    ei = young * second
    c = np.zeros((6, 6))
    c[0, 0], c[3, 3] = length / (young * area), length / (0.76 * ei)
    c[1, 1] = c[2, 2] = bend / ei
    c[4, 4] = c[5, 5] = turning / ei
    c[1, 5] = c[5, 1] = both / ei
    c[2, 4] = c[4, 2] = -both / ei
    if along == "z":
        q = np.kron(np.eye(2), turn("y", -90.0))  # x to z
        c = q @ c @ q.T
    return Spring(name, compliance=tuple(map(tuple, ((c + c.T) / 2).tolist())))


def triple(v: Sequence[float] | np.ndarray) -> tuple[float, float, float]:
    x, y, z = (float(u) for u in v)
    return (x, y, z)


def box_of(
    low: np.ndarray, high: np.ndarray
) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
    return triple(low), triple(high)
