"""Polar diagrams and sweeps."""

from __future__ import annotations

import numpy as np
import pytest

import stiffmap as sm

CORNER = np.array([-0.2, -0.2, -0.2])


def test_polar_values_are_those_of_solve(machine: sm.Machine) -> None:
    pol = sm.polar(machine, CORNER, force=200.0, directions=12)
    a = pol.angle.values
    zero = np.zeros(12)
    wrench = 200.0 * np.stack([np.cos(a), np.sin(a), zero, zero, zero, zero], axis=-1)
    np.testing.assert_array_equal(pol.displacement, machine.solve(CORNER, wrench).displacement)
    assert pol.worst_deflection >= pol.deflection.max()
    assert pol.best_deflection <= pol.deflection.min()
    assert pol.worst_deflection_xy >= pol.deflection_xy.max()


def test_polar_of_the_isotropic_point_is_a_circle(machine: sm.Machine) -> None:
    pol = sm.polar(machine, np.zeros(3), directions=16)
    assert float(pol.worst_deflection_xy / pol.best_deflection_xy) == pytest.approx(1.0, abs=1e-3)


def test_polar_extremes_of_a_diagonal_point_lie_on_the_diagonals(machine: sm.Machine) -> None:
    pol = sm.polar(machine, CORNER)
    worst, best = np.rad2deg([pol.worst_direction_xy, pol.best_direction_xy])
    # 45 and 135 degrees modulo 180 by the symmetry x <-> y, kept by the loaded equilibrium
    assert worst % 180 == pytest.approx(45, abs=0.05)
    assert best % 180 == pytest.approx(135, abs=0.5)


def test_sweep_starts_at_the_unloaded_machine(machine: sm.Machine) -> None:
    swp = sm.sweep(machine, CORNER, [1.0, 1.0, 0.0], [-300.0, 0.0, 300.0])
    assert float(swp.deflection[1]) < 1e-12
    assert swp.direction.values == pytest.approx([0.5**0.5, 0.5**0.5, 0])
    assert float(swp.deflection_along[0]) < 0 < float(swp.deflection_along[2])
    f = np.array([300.0, 300.0, 0, 0, 0, 0]) * 0.5**0.5
    np.testing.assert_allclose(
        swp.displacement[2], machine.solve(CORNER, f).displacement, rtol=1e-12, atol=1e-15
    )


def test_compliance_along_is_the_slope(machine: sm.Machine) -> None:
    h = 0.5
    swp = sm.sweep(machine, CORNER, [0.0, 1.0, 0.0], [200 - h, 200, 200 + h])
    slope = (swp.deflection_along[2] - swp.deflection_along[0]) / (2 * h)
    assert float(swp.compliance_along[1]) == pytest.approx(float(slope), rel=1e-7)
