"""Bars in closed form: the independent check of the finite elements, and the fast model of a search."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from stiffmap.link.arrays import Floats
from stiffmap.link.transport import twist_transport


class Section(NamedTuple):
    """Constants of a cross-section, axes y and z principal. SI."""

    area: float  # m²
    iz: float  # m⁴, bending that moves along y
    iy: float  # m⁴, bending that moves along z
    torsion: float  # m⁴, Saint-Venant


def rectangle(width: float, height: float) -> Section:
    """Solid rectangle, width along y and height along z; torsion by Saint-Venant's series."""
    a, b = max(width, height), min(width, height)
    n = np.arange(1, 40, 2)
    series = np.sum(np.tanh(n * np.pi * a / (2 * b)) / n**5)
    torsion = a * b**3 / 3 * (1 - 192 * b / (np.pi**5 * a) * series)
    return Section(width * height, height * width**3 / 12, width * height**3 / 12, float(torsion))


def tube(width: float, height: float, wall: float) -> Section:
    """Rectangular tube of constant wall; torsion by Bredt, good to a few per cent for thin walls."""
    outer, inner = rectangle(width, height), rectangle(width - 2 * wall, height - 2 * wall)
    w, h = width - wall, height - wall
    torsion = 2 * wall * (w * h) ** 2 / (w + h)
    return Section(outer.area - inner.area, outer.iz - inner.iz, outer.iy - inner.iy, float(torsion))


def cantilever(section: Section, length: float, young: float, shear: float) -> Floats:
    """(6, 6) Euler-Bernoulli compliance at the tip of a bar along x clamped at its origin."""
    C = np.zeros((6, 6))
    L, EIz, EIy = length, young * section.iz, young * section.iy
    C[0, 0], C[3, 3] = L / (young * section.area), L / (shear * section.torsion)
    C[1, 1], C[5, 5], C[1, 5] = L**3 / (3 * EIz), L / EIz, L**2 / (2 * EIz)
    C[2, 2], C[4, 4], C[2, 4] = L**3 / (3 * EIy), L / EIy, -(L**2) / (2 * EIy)
    C[5, 1], C[4, 2] = C[1, 5], C[2, 4]
    return C


def fork(length: float, prong: float, height: float, gap: float, young: float, shear: float) -> Floats:
    """(6, 6) compliance over two parallel prongs along x, ``gap`` apart along y, joined at both ends.

    Each prong is a cantilever; their stiffnesses add at the middle of the joined end.
    """
    K = np.zeros((6, 6))
    one = np.linalg.inv(cantilever(rectangle(prong, height), length, young, shear))
    for side in (-1.0, 1.0):
        T = twist_transport(np.array([0.0, side * (gap + prong) / 2, 0.0]))
        K += T.T @ one @ T
    return np.asarray(np.linalg.inv(K))


def series(parts: list[tuple[Floats, float]]) -> Floats:
    """(6, 6) compliance at the end of parts in a row, each with its length in m along x."""
    C, rest = np.zeros((6, 6)), 0.0
    for part, length in reversed(parts):
        T = twist_transport(np.array([rest, 0.0, 0.0]))
        C += T @ part @ T.T
        rest += length
    return C


def fork_bar(
    length: float,
    width: float,
    height: float,
    wall: float,
    arm: float,
    prong: float,
    gap: float,
    young: float,
    shear: float,
) -> Floats:
    """(6, 6) compliance between the pins of a tube with a fork of length ``arm`` at both ends: beams only."""
    end = fork(arm, prong, height, gap, young, shear)
    middle = length - 2 * arm
    return series(
        [(end, arm), (cantilever(tube(width, height, wall), middle, young, shear), middle), (end, arm)]
    )
