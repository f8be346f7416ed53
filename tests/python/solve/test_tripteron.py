"""The Tripteron: values on which independent programs agree, to their printed digits."""

from __future__ import annotations

import numpy as np
import pytest

import stiffmap as sm

HOME = (0.3, 0.4, 0.5)
Z = np.array([0.0, 0.0, 1.0, 0.0, 0.0, 0.0])


def printed(value: float, digits: int) -> object:
    """Equal when rounded to so many significant digits (half a unit of the last one)."""
    return pytest.approx(value, abs=0.5000001 * 10.0 ** (np.floor(np.log10(abs(value))) - digits + 1))


def norm(solution: sm.Solution) -> float:
    return float(np.linalg.norm(solution.displacement[:3]))


UNLOADED = [(HOME, 1.161353e-4), ((0.2, 0.6, 0.35), 1.191988e-4), ((0.5, 0.5, 0.5), 1.207481e-4)]
LOADED = [(HOME, 1.161354e-4), ((0.2, 0.6, 0.35), 1.191992e-4), ((0.5, 0.5, 0.5), 1.207482e-4)]


@pytest.mark.parametrize(("position", "value"), UNLOADED)
def test_unloaded_compliance_times_100_newtons(
    tripteron: sm.Machine, position: tuple[float, ...], value: float
) -> None:
    twist = tripteron.solve(position).compliance @ (100 * Z)
    assert np.linalg.norm(twist[:3]) == printed(value, 7)


def test_unloaded_vector(tripteron: sm.Machine) -> None:
    twist = tripteron.solve(HOME).compliance @ (100 * Z)
    for got, wanted in zip(
        twist, [7.4661e-7, 8.8957e-6, 1.1579e-4, 2.1669e-5, 5.9744e-6, 1.5087e-6], strict=True
    ):
        assert got == printed(wanted, 5)


@pytest.mark.parametrize(("position", "value"), LOADED)
def test_loaded_equilibrium_at_100_newtons(
    tripteron: sm.Machine, position: tuple[float, ...], value: float
) -> None:
    assert norm(tripteron.solve(position, 100 * Z)) == printed(value, 7)


@pytest.mark.parametrize(
    ("force", "value", "digits"), [(5e3, 5.806929e-3, 7), (5e4, 5.807578e-2, 7), (5e5, 0.5879, 4)]
)
def test_large_loads(tripteron: sm.Machine, force: float, value: float, digits: int) -> None:
    solution = tripteron.solve(HOME, force * Z)
    assert norm(solution) == printed(value, digits)
    assert int(solution.status) == sm.Status.CONVERGED


@pytest.mark.parametrize("method", ["fast", "reference"])
def test_stretched_leg_is_solved_and_flagged(tripteron: sm.Machine, method: str) -> None:
    solution = tripteron.solve((0.9, 1.2, 0.5), 100 * Z, method=method)
    assert int(solution.status) == sm.Status.CONVERGED
    assert int(solution.flags) & sm.Flag.LEG_SINGULAR
    assert norm(solution) == printed(1.431802e-4, 7)
    unloaded = tripteron.solve((0.9, 1.2, 0.5), method=method)
    assert np.linalg.norm((unloaded.compliance @ (100 * Z))[:3]) == printed(1.431802e-4, 7)


def test_folded_leg_leaves_the_configuration_undetermined(tripteron: sm.Machine) -> None:
    solution = tripteron.solve((0.0, 0.0, 0.5), 100 * Z)
    assert int(solution.status) == sm.Status.SINGULAR
    assert int(solution.flags) & sm.Flag.CONFIGURATION_UNDETERMINED
    for values in (solution.displacement, solution.stiffness, solution.compliance):
        assert np.isnan(values).all()


def test_beyond_reach(tripteron: sm.Machine) -> None:
    solution = tripteron.solve((1.2, 1.2, 0.5), 100 * Z)
    assert int(solution.status) == sm.Status.UNREACHABLE
    assert np.isnan(solution.displacement).all() and np.isnan(solution.compliance).all()
