"""Singularities of the three types where closed forms have them."""

from __future__ import annotations

import numpy as np
import pytest

import stiffmap as sm
from stiffmap.workspace.performance.kinds.drives import TYPES
from stiffmap.workspace.performance.motion.closing import drive_kinematics
from stiffmap.workspace.performance.motion.velocity import distances


def found(name, p):
    machine = sm.load_machine(name)
    return distances(sm.velocity_transmission(machine, p), drive_kinematics(machine, p).pivot)


# the five-bar on its axis: arms 300 mm, forearms 374 mm, motors at ±150 mm
STRETCHED = np.sqrt(0.674**2 - 0.15**2)
IN_LINE = np.sqrt(0.3**2 - (0.374 - 0.15) ** 2)


def test_stretched_arms_are_type_1():
    """The factor falls with the root of the distance."""
    d = np.array([4e-4, 1e-4])
    table = found("five-bar", np.stack([0 * d, STRETCHED - d, 0 * d], axis=1))
    assert (table.argmin(axis=0) == 0).all()
    assert table[0, 0] / table[0, 1] == pytest.approx(2, rel=0.05)


def test_forearms_in_one_line_are_type_2():
    """The factor falls with the distance itself."""
    d = np.array([4e-4, 1e-4])
    table = found("five-bar", np.stack([0 * d, IN_LINE + d, 0 * d], axis=1))
    assert (table.argmin(axis=0) == 1).all() and table[1, 1] < 2e-3
    assert table[1, 0] / table[1, 1] == pytest.approx(4, rel=0.05)


def test_a_flat_parallelogram_is_a_constraint_singularity():
    """With its driven bar held the table still turns; per drive it moves as ever. Linear in the angle left."""
    angle = np.radians([89.0, 89.5])
    table = found("swing-table", np.stack([0.4 * np.sin(angle), 0 * angle, 0.4 * np.cos(angle)], axis=1))
    assert (table.argmin(axis=0) == 2).all() and table[:2].min() > 0.5
    assert table[2, 0] / table[2, 1] == pytest.approx(2, rel=0.01)


def test_a_sound_pose_is_far_from_all():
    assert found("orthoglide-revised", [0.0, 0.0, 0.0]) == pytest.approx([1, 1, 1])


def test_the_table_names_the_type():
    table = sm.measures(sm.load_machine("orthoglide-revised"), only=["singularity"], nodes=3, coarse=2)
    row = table["singularity"]
    assert row.found.worst == pytest.approx(1 / 2.2438, rel=1e-3) and TYPES[1] in row.found.note
