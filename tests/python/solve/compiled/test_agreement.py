"""The fast path against the reference path: every shipped machine, every instruction-set level."""

from __future__ import annotations

import numpy as np
import pytest
from tests.python.solve.compiled.agreement import LOADS, TOLERANCE, draw, gap

import stiffmap as sm
from stiffmap import _core
from stiffmap.model.files import shipped_machines

LEVELS = _core.kernel_levels()
FAST = tuple(LOADS)


def test_every_shipped_machine_is_a_case() -> None:
    assert {m.name for m in shipped_machines()} == set(LOADS)


@pytest.mark.parametrize("name", FAST)
def test_machines_that_the_fast_path_takes(name: str) -> None:
    assert sm.load_machine(name).fast == ""


@pytest.mark.parametrize("name", LOADS)
def test_random_poses_and_loads(name: str) -> None:
    machine = sm.load_machine(name)
    found = gap(machine, *draw(machine, 120, seed=11))
    assert found.statuses == 0
    assert found.poses > 60
    assert found.worst() < TOLERANCE


@pytest.mark.parametrize("level", LEVELS)
@pytest.mark.parametrize("name", FAST)
def test_every_level(name: str, level: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("STIFFMAP_ISA", level)
    machine = sm.load_machine(name)
    found = gap(machine, *draw(machine, 40, seed=12))
    assert found.statuses == 0
    assert found.poses > 20
    assert found.worst() < TOLERANCE


def test_no_load_and_every_option_of_pose() -> None:
    machine = sm.load_machine("orthoglide-revised")
    position, wrench = draw(machine, 40, seed=13)
    assert gap(machine, position, np.zeros(6)).worst() < TOLERANCE
    assert gap(machine, position, wrench, gravity=(0, 0, -9.81)).worst() < TOLERANCE


@pytest.mark.parametrize("name", FAST)
def test_stiffness_under_gravity(name: str) -> None:
    """Weights in moving blocks and behind pins; the tilted, heavier pull makes their share large."""
    machine = sm.load_machine(name)
    position, wrench = draw(machine, 30, seed=16)
    for gravity in ((0.0, 0.0, -9.81), (12.0, -20.0, 16.0)):
        found = gap(machine, position, wrench, gravity=gravity)
        assert found.statuses == 0
        assert found.poses > 15
        assert found.worst() < TOLERANCE


def test_out_of_reach_is_the_same_on_both_paths() -> None:
    machine = sm.load_machine("tripteron")
    position, wrench = draw(machine, 60, seed=14, margin=-0.4)
    found = gap(machine, position, wrench)
    assert found.statuses == 0
    assert found.poses < 60
    assert found.worst() < TOLERANCE


@pytest.mark.parametrize("name", FAST)
def test_few_poses_in_the_box_take_the_reference_path(name: str) -> None:
    machine = sm.load_machine(name)
    position, _ = draw(machine, 1000, seed=17, margin=0.0)
    force = np.array([100.0, 50.0, -200.0, 0.0, 0.0, 0.0])
    for load, gravity in ((None, None), (force, None), (force, (0.0, 0.0, -9.81))):
        found = machine.solve(position, load, gravity=gravity)
        assert found.reference_share <= 1e-3


@pytest.mark.parametrize("name", FAST)
def test_beyond_the_box_is_the_same_on_both_paths(name: str) -> None:
    machine = sm.load_machine(name)
    position, wrench = draw(machine, 60, seed=18, margin=-0.5)
    found = gap(machine, position, wrench)
    assert found.statuses == 0
    assert found.worst() < TOLERANCE


def test_an_unknown_level_is_one_clear_error(monkeypatch: pytest.MonkeyPatch) -> None:
    machine = sm.load_machine("tripteron")
    monkeypatch.setenv("STIFFMAP_ISA", "v9")
    with pytest.raises(ValueError, match=r"STIFFMAP_ISA.*base.*v9"):
        machine.solve([0.3, 0.4, 0.5])


def test_levels_are_not_the_same_code(monkeypatch: pytest.MonkeyPatch) -> None:
    """Otherwise the tests above would run one level several times: contraction differs in the last bits."""
    if len(LEVELS) < 2:
        pytest.skip("this processor has one level only")
    machine = sm.load_machine("orthoglide-revised")
    position, wrench = draw(machine, 50, seed=15)
    answers = []
    for level in (LEVELS[0], LEVELS[-1]):
        monkeypatch.setenv("STIFFMAP_ISA", level)
        answers.append(machine.solve(position, wrench, threads=1).displacement)
    assert (answers[0] != answers[1]).any()
