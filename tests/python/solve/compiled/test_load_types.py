"""Loads that turn with the tool, in the kernels (docs/fast_path.md F18), against the reference path."""

from __future__ import annotations

import numpy as np
import pytest
from tests.python.solve.compiled.agreement import LOADS, TOLERANCE, draw, gap

import stiffmap as sm
from stiffmap import _core

KINDS = ("follower", "semitangential")


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", LOADS)
def test_loads_that_turn(name: str, kind: str) -> None:
    machine = sm.load_machine(name)
    position, wrench = draw(machine, 24, seed=31)
    for gravity in ((0.0, 0.0, 0.0), (3.0, -4.0, -9.0)):
        found = gap(machine, position, wrench, load_type=kind, gravity=gravity)
        assert found.statuses == 0
        assert found.poses > 12
        assert found.worst() < TOLERANCE
        assert machine.solve(position, wrench, load_type=kind, gravity=gravity).reference_share == 0


@pytest.mark.parametrize("kind", KINDS)
def test_far_turned(kind: str) -> None:
    """The tool turns by degrees, so that the stiffness shows whether the load went along."""
    machine = sm.load_machine("ur10")
    position, wrench = draw(machine, 20, seed=32)
    found = gap(machine, position, 20 * wrench, load_type=kind)
    assert found.statuses == 0
    assert found.worst() < TOLERANCE
    here, dead = (machine.solve(position, 20 * wrench, load_type=k) for k in (kind, "dead"))
    assert np.nanmax(np.linalg.norm(here.displacement[:, 3:], axis=1)) > 0.02
    assert np.nanmax(np.abs(here.stiffness - dead.stiffness)) > 1e-4 * np.nanmax(np.abs(dead.stiffness))


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(
    ("name", "effect", "values"),
    [
        ("orthoglide-revised", "dead_zone", {"element": "actuator", "legs": ["y"], "half_width": 12e-6}),
        ("orthoglide-revised", "hardening", {"element": "actuator", "cubic": 1e13}),
        ("ur10", "dead_zone", {"element": "elbow", "half_width": 1e-4}),
        ("ur10", "external_spring", {"stiffness": 1e4, "anchor_x": 0.1, "anchor_y": -0.2, "anchor_z": 2.0}),
        (
            "hexapod",
            "external_spring",
            {"stiffness": 1e5, "anchor_x": 0.1, "anchor_y": -0.2, "anchor_z": 2.0},
        ),
    ],
)
def test_with_effects(name: str, effect: str, values: dict[str, object], kind: str) -> None:
    machine = sm.load_machine(name).with_effect(effect, **values)
    found = gap(machine, *draw(machine, 16, seed=33), load_type=kind)
    assert found.statuses == 0
    assert found.poses > 8
    assert found.worst() < TOLERANCE


@pytest.mark.parametrize("level", _core.kernel_levels())
def test_every_level(level: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("STIFFMAP_ISA", level)
    for name in ("orthoglide-revised", "ur10"):
        machine = sm.load_machine(name)
        for kind in KINDS:
            found = gap(machine, *draw(machine, 12, seed=34), load_type=kind)
            assert (found.statuses, found.worst() < TOLERANCE) == (0, True)


@pytest.mark.parametrize("name", ["hexapod", "ur10"])
def test_derivatives(name: str) -> None:
    """Variants (F10) turn the load too: against differences of whole machines, solved by the reference path."""
    machine = sm.load_machine(name)
    position, wrench = draw(machine, 4, seed=35)
    place, h = {"ur10": "elbow", "hexapod": "strut"}[name], 1e-3
    answer = machine.solve(
        position,
        wrench,
        load_type="follower",
        derivatives=[("compliance", {"element": place, "scale": 1.5})],
    )

    def at(scale: float) -> np.ndarray:
        changed = machine.with_effect("compliance", element=place, scale=scale)
        return changed.solve(position, wrench, load_type="follower", method="reference").displacement

    true = (at(1.5 + h) - at(1.5 - h)) / (2 * h)
    (slope,) = answer.derivatives.values()
    assert np.abs(true).max() > 0
    assert np.abs(slope - true).max() < 1e-5 * np.abs(true).max()
