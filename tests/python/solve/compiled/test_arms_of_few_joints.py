"""Arms that cannot move their tip in every direction: compliance in the kernels, no stiffness."""

from __future__ import annotations

import os
import re

import numpy as np
import pytest
from tests.python.solve.compiled.agreement import TOLERANCE, displacement_gap

import stiffmap as sm
from stiffmap import _core
from stiffmap.model.files import description_from_text, shipped_machines

SCARA = """
name: scara
units: {length: mm, force: N, angle: deg, mass: kg}
home: {translation: [536.2311101832846, -64.27876096865393, 200], turns: [{about: z, by: 40}]}
task: [x, y, z, rz]
workspace: {x: [350, 600], y: [-200, 200], z: [100, 300]}
legs:
  arm:
    elements:
      - {actuator: shoulder, kind: revolute, axis: z, home: -40, compliance: 2.5e-8}
      - {offset: upper, translation: [400, 0, 0]}
      - {body: upper, mass: 5, com: [-200, 0, 0]}
      - {actuator: elbow, kind: revolute, axis: z, home: 80, compliance: 5.0e-8}
      - {offset: fore, translation: [300, 0, 0]}
      - {body: fore, mass: 3, com: [-150, 0, 0]}
      - {actuator: quill, kind: prismatic, axis: z, home: 200, compliance: 2.0e-5}
      - {actuator: wrist, kind: revolute, axis: z, home: 0, compliance: 1.0e-7}
"""
GANTRY = """
name: gantry
units: {length: mm, force: N, angle: deg, mass: kg}
home: {translation: [0, 0, 0]}
task: [x, y, z]
workspace: {x: [-300, 300], y: [-200, 200], z: [-100, 100]}
legs:
  gantry:
    elements:
      - {actuator: bridge, kind: prismatic, axis: x, compliance: 2.0e-5}
      - {body: bridge, mass: 40, com: [0, 0, 50]}
      - {spring: rail, compliance: [0, 2.0e-6, 4.0e-6, 0, 0, 0]}
      - {actuator: carriage, kind: prismatic, axis: y, compliance: 1.0e-5}
      - {spring: guide, compliance: [3.0e-6, 0, 2.0e-6, 0, 0, 0]}
      - {body: carriage, mass: 12, com: [0, 0, 30]}
      - {actuator: quill, kind: prismatic, axis: z, compliance: 1.5e-5}
      - {body: quill, mass: 3, com: [0, 0, 40]}
"""
LOADS = np.array([50.0, 50, 50, 5, 5, 5])


def machine_of(text: str) -> sm.Machine:
    return sm.Machine(description_from_text(text))


def arm_with(change: tuple[str, str]) -> sm.Machine:
    """The UR10 with one piece of its file exchanged."""
    text = next(m.path for m in shipped_machines() if m.name == "ur10").read_text()
    assert change[0] in text
    return machine_of(text.replace(*change, 1))


RIGID = (
    'compliance: {value: 1.25e-07, u: 3.75e-08, source: assumed, note: "declared, not the maker\'s"}',
    "rigid: true",
)
BENDS = (
    "- {offset: link_3, translation: [-572.3, 0, 0]}",
    "- {offset: link_3, translation: [-572.3, 0, 0]}\n"
    "      - {spring: fore, compliance: [0, 2.0e-5, 2.0e-5, 0, 0, 0]}",
)
MACHINES = {
    "scara": lambda: machine_of(SCARA),
    "rigid": lambda: machine_of(
        re.sub("compliance: [0-9.e-]+", "rigid: true", SCARA)
    ),  # as of a table of lengths alone
    "gantry": lambda: machine_of(GANTRY),
    "five_of_six": lambda: arm_with(RIGID),
    "six_and_a_spring": lambda: arm_with(BENDS),
}


def draw(machine: sm.Machine, n: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    low, high = machine.workspace
    wrench = LOADS * rng.uniform(-1, 1, (n, 6))
    wrench[::7] = 0.0
    return rng.uniform(low, high, (n, 3)), wrench


@pytest.mark.parametrize("gravity", [None, (0.0, 0.0, -9.81)], ids=["weightless", "heavy"])
@pytest.mark.parametrize("name", MACHINES)
def test_agreement(name: str, gravity: tuple[float, ...] | None, monkeypatch: pytest.MonkeyPatch) -> None:
    machine = MACHINES[name]()
    assert machine.fast == ""
    position, wrench = draw(machine, 60, 3)
    for kind in ("dead", "follower", "semitangential"):
        same = {"gravity": gravity, "load_type": kind}
        reference = machine.solve(position, wrench, method="reference", **same)
        for level in _core.kernel_levels():
            monkeypatch.setitem(os.environ, "STIFFMAP_ISA", level)
            fast = machine.solve(position, wrench, **same)
            assert fast.reference_share == 0
            np.testing.assert_array_equal(fast.status, reference.status)
            np.testing.assert_array_equal(fast.flags, reference.flags)
            assert displacement_gap(fast.displacement, reference.displacement) < TOLERANCE
            size = np.abs(reference.compliance).max(axis=(-2, -1), keepdims=True)
            assert (np.abs(fast.compliance - reference.compliance) <= TOLERANCE * size).all()
            np.testing.assert_array_equal(np.isnan(fast.stiffness), np.isnan(reference.stiffness))
            np.testing.assert_allclose(fast.actuator_effort, reference.actuator_effort, rtol=1e-9, atol=1e-9)


def test_a_body_that_stands() -> None:
    """No joint, no spring: it is where it is, and nowhere else."""
    machine = machine_of(
        "{name: stand, units: {length: mm, force: N, angle: deg, mass: kg}, home: {translation: [10, 0, 200]}, "
        "legs: {stand: {elements: [{body: all, mass: 5}, {offset: top, translation: [10, 0, 200]}]}}}"
    )
    position = np.tile(machine.description.home.translation, (40, 1))
    position[7] += 1e-3
    s = machine.solve(position, LOADS, gravity=(0, 0, -9.81))
    assert (s.status == np.where(np.arange(40) == 7, sm.Status.UNREACHABLE, sm.Status.CONVERGED)).all()
    ok = s.ok
    np.testing.assert_allclose(s.displacement[ok], 0, atol=1e-15)
    assert not s.compliance[ok].any() and np.isnan(s.stiffness).all()


def test_compliance_of_a_scara_in_closed_form() -> None:
    machine = machine_of(SCARA)
    position, _ = draw(machine, 20, 5)
    s = machine.solve(position)
    for x, c in zip(s.coordinates, s.compliance, strict=True):
        a, b = x[0], x[0] + x[1]
        fore = 0.3 * np.array([np.cos(b), np.sin(b)])
        whole = 0.4 * np.array([np.cos(a), np.sin(a)]) + fore
        j = np.zeros((6, 4))
        for k, arm in ((0, whole), (1, fore), (3, np.zeros(2))):
            j[[0, 1, 5], k] = -arm[1], arm[0], 1.0
        j[2, 2] = 1.0
        # rad/(N·mm) is 1e3 rad/(N·m), mm/N is 1e-3 m/N
        np.testing.assert_allclose(c, j @ np.diag([2.5e-5, 5e-5, 2e-8, 1e-4]) @ j.T, rtol=1e-12, atol=1e-18)
    assert np.isnan(s.stiffness).all()
    assert (s.flags & sm.Flag.RIGID_DIRECTION > 0).all()


@pytest.mark.parametrize(
    ("kind", "values"),
    [
        ("dead_zone", {"half_width": 2e-5}),
        ("hardening", {"cubic": 1e7}),
        ("friction", {"torque": 2.0, "branch": "loading"}),
        ("bilinear", {"ratio": 2.0, "knee": 4.0}),
    ],
)
def test_effects_of_a_drive(kind: str, values: dict[str, float]) -> None:
    machine = machine_of(SCARA).with_effect(kind, element="elbow", **values)
    position, wrench = draw(machine, 60, 7)
    fast, reference = (machine.solve(position, wrench, method=m) for m in ("fast", "reference"))
    np.testing.assert_array_equal(fast.status, reference.status)
    ok = reference.ok
    assert ok.sum() > 40
    assert displacement_gap(fast.displacement[ok], reference.displacement[ok]) < TOLERANCE
    assert fast.reference_share < 0.2  # the unloaded ones, where a gap is open


def test_derivatives_are_those_of_the_reference() -> None:
    machine = machine_of(SCARA)
    position, wrench = draw(machine, 10, 9)
    request = ("compliance", {"element": "elbow", "scale": 1.0})
    found = machine.solve(position, wrench, derivatives=[request]).derivatives["compliance elbow scale"]
    ends = [
        machine.with_effect("compliance", element="elbow", scale=v).solve(
            position, wrench, method="reference"
        )
        for v in (0.999, 1.001)
    ]
    wanted = (ends[1].displacement - ends[0].displacement) / 2e-3
    np.testing.assert_allclose(found, wanted, rtol=1e-5, atol=1e-12)
