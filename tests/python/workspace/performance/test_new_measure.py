"""A new measure is one new file: it is in the table, in requirements and in designs without another line."""

from __future__ import annotations

import sys

import numpy as np
import pytest

import stiffmap as sm
from stiffmap.workspace.performance import kinds, load_requirements
from stiffmap.workspace.performance.registry import all_measures

FILE = '''
"""Largest stroke of the drives over the box."""

import numpy as np

from stiffmap.workspace.performance.registry import Case, Found, Measure


def compute(case: Case) -> Found:
    return Found(float(np.ptp(case.kinematics.actuators, axis=0).max()))


MEASURE = Measure("own_stroke", "largest stroke", "m", "low", compute, "mm", 1e3)
'''


@pytest.fixture
def own(tmp_path, monkeypatch):
    (tmp_path / "own_stroke.py").write_text(FILE, encoding="utf-8")
    monkeypatch.setattr(kinds, "__path__", [*kinds.__path__, str(tmp_path)])
    all_measures.cache_clear()
    yield tmp_path
    sys.modules.pop(f"{kinds.__name__}.own_stroke", None)
    all_measures.cache_clear()


def test_a_new_file_is_a_new_measure(own):
    task = own / "task.yaml"
    task.write_text("name: task\nrequirements: {own_stroke: {at_most: 400 mm}}\n", encoding="utf-8")
    machine = sm.load_machine("orthoglide-revised")
    table = sm.measures(machine, requirements=load_requirements(task), only=["own_stroke"], nodes=3, coarse=2)
    # the x drive from the far corner to the near one, in closed form
    p = np.stack(np.meshgrid(*[[-0.2, 0.05, 0.3]] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    rho = p[:, 0] - 0.0775 - np.sqrt(0.775**2 - p[:, 1] ** 2 - p[:, 2] ** 2)
    assert table["own_stroke"].found.worst == pytest.approx(np.ptp(rho), rel=1e-9)
    assert table["own_stroke"].verdict == ("pass" if np.ptp(rho) <= 0.4 else "fail")


def test_it_is_gone_with_its_file():
    with pytest.raises(sm.StiffmapError, match="unknown measure 'own_stroke'"):
        sm.measures(sm.load_machine("five-bar"), only=["own_stroke"], nodes=2, coarse=2)
