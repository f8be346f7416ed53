"""Bars in closed form: the independent check of the finite elements, and the fast model of a search."""

from __future__ import annotations

import numpy as np

from stiffmap.common.broadcasting import Floats
from stiffmap.model.beams import Section, cantilever_compliance, hollow_section, rectangle_section
from stiffmap.model.link.transport import twist_transport


def rectangle(width: float, height: float) -> Section:
    """Solid rectangle, width along y and height along z."""
    return rectangle_section(width, height)


def tube(width: float, height: float, wall: float) -> Section:
    """Rectangular tube of constant wall, width along y; torsion good to a few per cent for thin walls."""
    return hollow_section(width, height, wall)


def cantilever(section: Section, length: float, young: float, shear: float) -> Floats:
    """(6, 6) compliance at the tip of a bar along x clamped at its origin."""
    bending = young * section.about_width, young * section.about_height
    return cantilever_compliance(length, "x", young * section.area, shear * section.torsion, *bending)


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
