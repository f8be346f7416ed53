"""Measures of machines in cables: shares of the deflection, force, acceleration, drive efforts, imposed displacements."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import stiffmap as sm
from stiffmap.workspace.cables import structure_matrix, tension_distribution
from stiffmap.workspace.performance import drive_efforts, fastest, force_transmission, line
from stiffmap.workspace.performance.motion.closing import drive_kinematics
from stiffmap.workspace.performance.motion.efforts import acceleration_of

EXAMPLES = Path(__file__).parents[4] / "examples/cables"
NAMES = ("cogiro", "ipanema-1", "belt-router")


def directions(machine: sm.Machine, count: int = 200) -> np.ndarray:
    """(n, 3) unit vectors that no guide takes."""
    free = np.array([c in machine.description.freedoms for c in "xyz"])
    r = np.random.default_rng(1).normal(size=(count, 3)) * free
    return np.asarray(r / np.linalg.norm(r, axis=1)[:, None])


@pytest.mark.parametrize("name", NAMES)
def test_force_is_held_in_every_direction_and_no_more(name: str) -> None:
    machine = sm.load_machine(EXAMPLES / f"{name}.yaml")
    home, r = machine.description.home.p, directions(machine, 2000)
    f = force_transmission(machine, home)
    assert float(f.force_min) > 0
    held = [
        tension_distribution(machine, home, np.hstack([s * f.force_min * r, 0 * r])).feasible
        for s in (0.999, 1.1)
    ]
    assert held[0].all() and not held[1].all()
    assert (f.bias <= 0).all()  # no cable pushes


@pytest.mark.parametrize("name", NAMES)
def test_fastest_run_is_held_by_tensions_that_balance_inertia_and_weight(name: str) -> None:
    machine = sm.load_machine(EXAMPLES / f"{name}.yaml")
    home = machine.description.home.p
    run = fastest(machine, line(home, home + np.array([0.3, 0.1, 0]), 41))
    e = drive_efforts(machine, run)
    limits = np.array([machine.description.platform[i].drive.force for i in range(len(machine.actuators))])
    assert float(e.effort.max()) <= 1e-9
    assert (e.peak_effort.values <= limits * (1 + 1e-9)).all()
    w = structure_matrix(machine, run.position)
    free = [i for i, c in enumerate(("x", "y", "z")) if c in machine.description.freedoms]
    body = machine.description.platform[-1]
    asked = body.mass * (run.acceleration - np.array(machine.description.gravity))
    given = np.einsum("nij,nj->ni", w, -e.effort.values)[:, :3]
    np.testing.assert_allclose(given[:, free], asked[:, free], atol=1e-5 * np.abs(asked).max())
    speeds = np.array([machine.description.platform[i].drive.speed for i in range(len(limits))])
    assert (e.peak_speed.values <= speeds * (1 + 1e-2)).all()


@pytest.mark.parametrize("name", ["cogiro", "ipanema-1"])
def test_acceleration(name: str) -> None:
    machine = sm.load_machine(EXAMPLES / f"{name}.yaml")
    reached = acceleration_of(machine, drive_kinematics(machine, machine.description.home.p))
    assert 0 < float(reached) < np.inf


@pytest.mark.parametrize("name", NAMES)
def test_shares_of_cables_make_up_the_deflection(name: str) -> None:
    machine = sm.load_machine(EXAMPLES / f"{name}.yaml")
    budget = sm.deflection_budget(machine, None, [50, 20, 0, 0, 0, 0])
    assert set(budget.elements) >= set(machine.actuators)
    assert abs(budget.rest_share) < 0.05
    assert np.abs(budget.shares).max() > 0.1


@pytest.mark.parametrize("name", ["cogiro", "ipanema-1"])
def test_wrench_that_holds_a_displacement_brings_it_about(name: str) -> None:
    machine = sm.load_machine(EXAMPLES / f"{name}.yaml")
    home = machine.description.home.p
    wanted = np.array([2e-3, 1e-3, 0, 0, 0, 0])
    wanted[2] = machine.solve(home).displacement[2]
    held = machine.wrench(home, wanted)
    assert int(held.status) == sm.Status.CONVERGED
    np.testing.assert_allclose(machine.solve(home, held.wrench).displacement, wanted, atol=1e-9)
