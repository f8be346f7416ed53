"""The over-constrained swing table against its closed form."""

from __future__ import annotations

import numpy as np
import pytest

import stiffmap as sm

L, A, B = 0.4, 0.15, 0.1  # bar length, half distances along x and y
E, G = 2.1e11, 2.1e11 / 2.6
WIDE, THIN = 0.030, 0.012  # `width` is along x (the axis after z), `height` along y
DRIVE = 1 / 2.0e-5  # N m/rad
CORNERS = {"front_left": (A, B), "front_right": (A, -B), "back_left": (-A, B), "back_right": (-A, -B)}


def torsion(b: float, h: float) -> float:
    """Torsion constant of a rectangle, Saint-Venant's series (Timoshenko and Goodier, art. 109)."""
    a, c = max(b, h), min(b, h)
    n = np.arange(1, 200, 2)
    return a * c**3 / 3 * (1 - 192 * c / (np.pi**5 * a) * np.sum(np.tanh(n * np.pi * a / (2 * c)) / n**5))


def bar(driven: bool) -> np.ndarray:
    """Stiffness of a bar at its top between pins about y, in its own axes (z along it)."""
    area, about_x, about_y = WIDE * THIN, WIDE * THIN**3 / 12, THIN * WIDE**3 / 12
    k = np.zeros((6, 6))
    k[2, 2] = E * area / L
    k[1, 1], k[3, 3] = 12 * E * about_x / L**3, 4 * E * about_x / L
    k[1, 3] = k[3, 1] = 6 * E * about_x / L**2
    k[5, 5] = G * torsion(WIDE, THIN) / L
    if driven:  # the drive and the bending of the bar in series
        k[0, 0] = 1 / (L**2 / DRIVE + L**3 / (3 * E * about_y))
    return k


def closed_form(q: float) -> np.ndarray:
    """Stiffness of the table, bars turned by q about y."""
    c, s = np.cos(q), np.sin(q)
    bar_axes = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
    total = np.zeros((6, 6))
    for name, (x, y) in CORNERS.items():
        lever = np.eye(6)
        lever[:3, 3:] = -np.array([[0, 0, y], [0, 0, -x], [-y, x, 0]])
        local = np.kron(np.eye(2), bar_axes.T) @ lever
        total += local.T @ bar(name == "front_left") @ local
    return total


@pytest.mark.parametrize("x", [0.0, 0.1, -0.2])
def test_stiffness(x: float) -> None:
    machine = sm.load_machine("swing-table")
    got = machine.solve([x, 0, 0.4])
    wanted = closed_form(np.arcsin(x / L))
    scale = np.sqrt(np.outer(np.diag(wanted), np.diag(wanted)))
    # the file reader ends the torsion series at n = 39, which leaves 1e-8 of the constant
    np.testing.assert_allclose(got.stiffness / scale, wanted / scale, rtol=0, atol=1e-8)
    assert got.ok and not got.flags


def test_three_bars_would_do_but_four_share_the_load() -> None:
    """A load at the middle is shared equally by four equal bars: over-constrained, and determined."""
    machine = sm.load_machine("swing-table")
    s = machine.solve([0, 0, 0.4], [0, 0, -1000, 0, 0, 0])
    share = s.leg_wrench[:, 2] / 1000
    np.testing.assert_allclose(share, 0.25, atol=1e-6)
