"""Cables of the oracle in bodies: their way over a pulley against a taut string laid by hand, pairs in closed form."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq
from tests.oracle.cartesian.cables import way
from tests.oracle.cartesian.solve import Machine
from tests.oracle.energy import Loads

from stiffmap.model.description import Body, Cable, MachineDescription

NONE = np.zeros(3)


@pytest.mark.parametrize("radius", [0.0, 0.05])
def test_way_and_its_derivatives(radius: float) -> None:
    anchor, guide = np.array([0.3, -0.2, 1.0]), np.array([0.0, 0.6, -0.8])
    end = np.array([0.9, 0.5, 0.1])
    length, u, bend = way(anchor, guide, radius, end)
    assert length == pytest.approx(laid(anchor, guide, radius, end), abs=1e-12)
    h = 1e-5
    for i, step in enumerate(h * np.eye(3)):
        ahead, behind = (way(anchor, guide, radius, end + s * step) for s in (1, -1))
        assert (ahead[0] - behind[0]) / (2 * h) == pytest.approx(u[i], abs=1e-9)
        assert (ahead[1] - behind[1]) / (2 * h) == pytest.approx(bend[i], abs=1e-8)


def laid(anchor: np.ndarray, guide: np.ndarray, radius: float, end: np.ndarray) -> float:
    """The string leaves the pulley where it points to its end."""
    off = end - anchor
    side = off - (guide @ off) * guide
    e = side / np.linalg.norm(side)
    centre = anchor + radius * e

    def leaving(turn: float) -> np.ndarray:
        return np.asarray(centre + radius * (-np.cos(turn) * e + np.sin(turn) * guide))

    def amiss(turn: float) -> float:
        along = np.sin(turn) * e + np.cos(turn) * guide
        return float(np.cross(end - leaving(turn), along) @ np.cross(e, guide))

    turn = brentq(amiss, 0.0, np.pi - 1e-9, xtol=1e-15)
    return float(radius * turn + np.linalg.norm(end - leaving(turn)))


@pytest.mark.parametrize("pretension", [50.0, 2000.0])
def test_a_pair_in_line(pretension: float) -> None:
    """EA (1/l1 + 1/l2) along, T (1/L1 + 1/L2) across, lengths l free and L stretched."""
    elasticity, reach = 8e4, (1.0, 2.0)
    cables = tuple(
        Cable(f"c{i}", anchor=(s * reach[i], 0.0, 0.0), elasticity=elasticity, pretension=pretension)
        for i, s in enumerate((-1.0, 1.0))
    )
    d = MachineDescription("pair", (), platform=(*cables, Body("bead", 1.0)), freedoms=("x", "y", "z"))
    a = Machine(d).solve(Loads(NONE, NONE, NONE, {}))
    assert a.found
    free = [r / (1 + pretension / elasticity) for r in reach]
    assert 1 / a.compliance[0, 0] == pytest.approx(elasticity * sum(1 / v for v in free), rel=1e-9)
    assert 1 / a.compliance[1, 1] == pytest.approx(pretension * sum(1 / v for v in reach), rel=1e-9)
    assert a.effort["c0"] == pytest.approx(-pretension, rel=1e-12)


def test_a_bead_hangs_where_its_weight_and_two_strings_agree() -> None:
    elasticity, half, drop, weight = 3e4, 0.8, 0.6, 20.0 * 9.81
    cables = tuple(
        Cable(f"c{i}", anchor=(s * half, 0.0, drop), elasticity=elasticity) for i, s in enumerate((-1.0, 1.0))
    )
    d = MachineDescription("bead", (), platform=(*cables, Body("bead", 20.0)), freedoms=("x", "z"))
    a = Machine(d).solve(Loads(NONE, NONE, np.array([0.0, 0.0, -9.81]), {}))
    assert a.found
    free = np.hypot(half, drop)
    z = brentq(
        lambda z: (
            2 * elasticity * (np.hypot(half, drop - z) / free - 1) * (drop - z) / np.hypot(half, drop - z)
            - weight
        ),
        -0.5,
        0.0,
    )
    assert a.displacement[2] == pytest.approx(z, abs=1e-12)


def test_a_slack_cable_bears_nothing() -> None:
    cables = (
        Cable("above", anchor=(0.0, 0.0, 1.0), elasticity=1e5, pretension=100.0),
        Cable("below", anchor=(0.0, 0.0, -1.0), elasticity=1e5, pretension=100.0),
    )
    d = MachineDescription("line", (), platform=(*cables, Body("bead", 1.0)), freedoms=("z",))
    a = Machine(d).solve(Loads(np.array([0.0, 0.0, -500.0]), NONE, NONE, {}))
    free = 1 / (1 + 100 / 1e5)
    assert a.found and a.effort["below"] == 0
    assert a.effort["above"] == pytest.approx(-500.0, rel=1e-12)
    assert a.displacement[2] == pytest.approx(1 - free * (1 + 500 / 1e5), abs=1e-12)
