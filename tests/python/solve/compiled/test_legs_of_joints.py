"""Legs of six joints alone that end in a ball: their tangent by blocks (docs/fast_path.md F12); drives that only pull."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation
from tests.oracle.classes import Classes
from tests.oracle.unseen import cable_suspension, planar_cable_suspension
from tests.python.solve.compiled.agreement import TOLERANCE, compare

import stiffmap as sm
from stiffmap import _core
from stiffmap.model.description import Element, Joint, Law, Leg, MachineDescription


def struts(ball: Law | None = None) -> MachineDescription:
    """The suspension's cables as struts that push as well, their balls free or elastic."""
    d = cable_suspension()

    def changed(e: Element) -> Element:
        if not isinstance(e, Joint):
            return e
        if e.actuated:
            return replace(e, law=Law(9e5))
        return replace(e, law=ball) if e.kind == "spherical" else e

    def leg(of: Leg) -> Leg:
        return replace(of, elements=tuple(changed(e) for e in of.elements))

    return replace(d, legs=tuple(leg(of) for of in d.legs))


MACHINES = {
    "struts": struts(),
    "elastic balls": struts(Law(2e3)),
    "locked balls": Classes(5).task("locked balls").description,
}


@pytest.mark.parametrize("level", _core.kernel_levels())
@pytest.mark.parametrize("name", MACHINES)
def test_both_paths_agree(name: str, level: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("STIFFMAP_ISA", level)
    d = MACHINES[name]
    box = (tuple(d.home.p - 0.03), tuple(d.home.p + 0.03))
    machine = sm.Machine(replace(d, workspace=box))
    rng = np.random.default_rng(3)
    position = rng.uniform(*machine.workspace, (24, 3))
    wrench = rng.normal(size=(24, 6)) * [800, 800, 800, 30, 30, 30]
    wrench[::6] = 0
    for gravity in ((0, 0, 0), (1.0, 2.0, -9.0)):
        fast = machine.solve(position, wrench, gravity=gravity)
        assert fast.reference_share < 0.2
        gap = compare(fast, machine.solve(position, wrench, gravity=gravity, method="reference"))
        assert gap.statuses == 0
        assert gap.poses > 20
        assert gap.worst() < TOLERANCE
        assert np.median(fast.iterations) < 5


PRELOAD, PULL = 9e-4, 9e5  # m, N/m


def least_energy(d: MachineDescription, at: np.ndarray, force: np.ndarray) -> np.ndarray:
    """Displacement (6,) of the suspension at a commanded position by its energy alone: cables between two points, pulled by as
    much as they are longer than commanded and wound up."""
    feet, heads = [], []
    for leg in d.legs:
        foot = leg.elements[0].nominal.p
        joint = next(e for e in leg.elements if isinstance(e, Joint) and e.actuated)
        head = foot + leg.elements[0].nominal.r @ [0, 0, joint.home[0]]
        feet.append(foot)
        heads.append(d.home.r.T @ (head - d.home.p))
    body = d.platform[0]

    def placed(u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return at + u[:3], Rotation.from_rotvec(u[3:]).as_matrix() @ d.home.r

    def lengths(u: np.ndarray) -> np.ndarray:
        p, r = placed(u)
        return np.linalg.norm(p + np.array(heads) @ r.T - feet, axis=1)

    commanded = lengths(np.zeros(6))

    def energy(u: np.ndarray) -> float:
        pulled = np.maximum(lengths(u) - commanded + PRELOAD, 0)
        p, r = placed(u)
        height = (p + r @ body.com)[2]
        return float(PULL / 2 * pulled @ pulled - force @ u[:3] + 9.81 * body.mass * height)

    found = np.zeros(6)
    for _ in range(3):  # differences leave 1e-5 of the way at first
        found = minimize(energy, found, method="BFGS", options={"gtol": 1e-9}).x
    return found


def test_drives_that_pull_settle_in_the_kernels_with_their_preload() -> None:
    """Newton started where they carry the load alone, without the preload: hundreds of steps of the reference path."""
    d = cable_suspension(PRELOAD)
    machine, rng = sm.Machine(d), np.random.default_rng(5)
    position = rng.uniform(*machine.workspace, (16, 3))
    force = rng.normal(size=(16, 3)) * 40
    fast = machine.solve(position, np.hstack([force, np.zeros((16, 3))]))
    assert fast.ok.all()
    assert fast.reference_share == 0
    assert (np.abs(fast.actuator_effort) < 1).any()  # some cables are slack
    reference = machine.solve(position[:4], np.hstack([force, np.zeros((16, 3))])[:4], method="reference")
    assert np.abs(reference.displacement - fast.displacement[:4]).max() < 1e-10
    assert reference.iterations.max() < 40
    for i in range(3):
        u = least_energy(d, position[i], force[i])
        assert np.abs(u - fast.displacement[i]).max() < 1e-3 * np.abs(u).max()


@pytest.mark.parametrize("level", _core.kernel_levels())
def test_drives_that_go_slack_settle_in_the_kernels(level: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Newton started slack drives kilometres away, where the law bears the linear force, and its steps were lengths of the machine:
    four of ten poses were left to the reference path, at a hundred times the price."""
    monkeypatch.setenv("STIFFMAP_ISA", level)
    machine, rng = sm.Machine(planar_cable_suspension()), np.random.default_rng(7)
    position = rng.uniform(*machine.workspace, (96, 3))
    wrench = np.zeros((96, 6))
    wrench[:, :2] = rng.normal(size=(96, 2)) * 150
    fast = machine.solve(position, wrench)
    assert fast.ok.all()
    assert (np.abs(fast.actuator_effort) < 1).any(axis=1).mean() > 0.3  # newtons: a drive is slack
    assert fast.reference_share < 0.05
    reference = machine.solve(position[:24], wrench[:24], method="reference")
    assert np.abs(reference.displacement - fast.displacement[:24]).max() < TOLERANCE
