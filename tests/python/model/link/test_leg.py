"""examples/link_leg.py: a whole leg in finite elements against virtual joints, on coarse meshes."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

pytest.importorskip("gmsh", reason="needs the extra [fea]", exc_type=(ImportError, OSError))
pytest.importorskip("skfem", reason="needs the extra [fea]")

POSE = np.array([-0.08, 0.05, 0.03])


def example() -> ModuleType:
    path = Path(__file__).parents[4] / "examples" / "link_leg.py"
    spec = importlib.util.spec_from_file_location("link_leg", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def leg() -> tuple[ModuleType, Any, Any]:
    m = example()
    return (
        m,
        m.solid(m.FOOT, m.Material(210e9, 0.3), 0.012, study=False),
        m.solid(m.BAR, m.Material(70e9, 0.33), 0.02, study=False),
    )


def ratios(leg: tuple[ModuleType, Any, Any], joint: str, folder: Path) -> tuple[float, float]:
    m, foot, bar = leg
    machine = m.joint_machine(foot, bar, joint, folder)
    return m.spread(m.leg_joints(machine, POSE), m.leg_elements(foot, bar, POSE, joint), 3)


def test_with_the_interfaces_of_the_identification_both_models_agree(leg, tmp_path):
    """Rigid bushes are what links with rigid heads were identified with: substructuring is then exact."""
    low, high = ratios(leg, "bush", tmp_path)
    assert low == pytest.approx(1, abs=1e-6)
    assert high == pytest.approx(1, abs=1e-6)


def test_another_joint_is_another_leg(leg, tmp_path):
    """A hole that slides round its pin deforms otherwise than one under a linear traction."""
    low, high = ratios(leg, "pin", tmp_path)
    assert low < 0.999
    assert low > 0.8
    assert high < 1.05


def test_the_leg_is_free_where_its_joints_are(leg):
    """Three twists without stiffness: turn about z, and two translations of the parallelograms."""
    m, foot, bar = leg
    values = np.abs(np.linalg.eigvalsh(m.leg_elements(foot, bar, POSE, "pin")))
    assert values[2] < 1e-6 * values[3]
