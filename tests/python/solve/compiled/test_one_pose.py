"""The short way for one pose: the same bits as the same pose in a batch, the same errors as the general call."""

from __future__ import annotations

import pickle
from typing import Any

import numpy as np
import pytest
from tests.python.solve.compiled.agreement import draw
from tests.python.solve.compiled.test_determinism import FIELDS

import stiffmap as sm
from stiffmap import _core
from stiffmap.solve.solution import FIELDS as ALL

POSE, FORCE = (0.02, 0.05, 0.1), (10.0, -20.0, 300.0, 0.0, 1.0, 0.0)


@pytest.mark.parametrize("level", _core.kernel_levels())
@pytest.mark.parametrize("name", ["orthoglide-revised", "tripteron", "swing-table", "ur10"])
def test_same_bits_as_in_a_batch(name: str, level: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("STIFFMAP_ISA", level)
    machine = sm.load_machine(name)
    position, wrench = draw(machine, 40, seed=3, margin=-0.05)
    batch = machine.solve(position, wrench)
    for i, (p, w) in enumerate(zip(position, wrench, strict=True)):
        one = machine.solve(tuple(p), tuple(w))
        for field in FIELDS:
            np.testing.assert_array_equal(getattr(one, field), getattr(batch, field)[i], err_msg=field)


@pytest.mark.parametrize(
    ("position", "wrench"),
    [
        (POSE, FORCE),
        (list(POSE), np.array(FORCE)),
        (np.array([*POSE, 7.0])[:3], np.array([v for f in FORCE for v in (f, 0.0)])[::2]),
        (tuple(np.array(POSE)), [10, -20, 300, 0, 1, 0]),
    ],
)
def test_ways_to_say_a_pose(position: Any, wrench: Any) -> None:
    machine = sm.load_machine("orthoglide-revised")
    said = machine.solve(position, wrench)
    general = machine.solve(position, wrench, point="tcp", wrenches={})
    for field in ("displacement", "readings", "free_twists", "coordinates", "indeterminate_mask", *FIELDS):
        a, b = getattr(said, field), getattr(general, field)
        assert a.shape == b.shape and a.dtype == b.dtype, field
        np.testing.assert_array_equal(a, b, err_msg=field)


@pytest.mark.parametrize(
    ("position", "wrench"),
    [
        ((0.0, 0.0), None),
        (("a", "b", "c"), None),
        (POSE, (1.0, 2.0, 3.0)),
        (POSE, (0.0, 0.0, float("nan"), 0.0, 0.0, 0.0)),
        (POSE, (10**400, 0, 0, 0, 0, 0)),
    ],
)
def test_bad_input_raises(position: Any, wrench: Any) -> None:
    with pytest.raises(sm.StiffmapError):
        sm.load_machine("orthoglide-revised").solve(position, wrench)


def test_a_pose_out_of_reach_has_its_status() -> None:
    one = sm.load_machine("orthoglide-revised").solve((5.0, 0.0, 0.0), FORCE)
    assert one.status == sm.Status.UNREACHABLE
    assert np.isnan(one.displacement).all() and np.isnan(one.stiffness).all()


def test_arrays_outlive_the_solution() -> None:
    """Views keep the memory of their answer; later calls leave it alone."""
    machine = sm.load_machine("tripteron")
    stiffness = machine.solve((0.3, 0.4, 0.5)).stiffness
    kept = stiffness.copy()
    for _ in range(50):
        machine.solve((0.5, 0.4, 0.3), FORCE).stiffness.sum()
    np.testing.assert_array_equal(stiffness, kept)


def test_pickles() -> None:
    machine = sm.load_machine("tripteron")
    for solution in (machine.solve((0.3, 0.4, 0.5)), machine.solve([[0.3, 0.4, 0.5]] * 3, FORCE)):
        again = pickle.loads(pickle.dumps(solution))
        assert set(ALL) >= {"stiffness", "coordinates"}
        for field in FIELDS:
            np.testing.assert_array_equal(getattr(again, field), getattr(solution, field))
        assert again.joint_coordinates.keys() == solution.joint_coordinates.keys()
