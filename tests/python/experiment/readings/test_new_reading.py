"""A kind of reading that the library does not have is one new file."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import stiffmap as sm
from stiffmap.experiment import Experiment, Predictor, load_experiment, random_plan, save_experiment, simulate
from stiffmap.experiment.readings import ReadingKind, kinds, load_readings, register, unregister
from stiffmap.model.description import AppliedEffect

# An electronic level on the platform: the slope about an axis across x and y, whose zero nobody knows.
LEVEL = """
import numpy as np

from stiffmap.experiment.readings import ReadingKind

AXIS = np.array([0.6, 0.8, 0.0])


def change(here, there):
    return here.motion[:, 3:] @ AXIS


def nuisance(e):
    yield np.ones(len(e))


READING = ReadingKind(
    name="slope",
    unit="rad",
    title="a slope",
    change=change,
    absolute="level",
    commanded=lambda e: np.zeros(len(e)),
    nuisance=nuisance,
)
"""
YAML = """machine: orthoglide-revised
quantity: deflection
units: {length: mm, force: N, angle: rad, slope: mrad}
noise: {slope: 0.001}
"""


@pytest.fixture
def level(tmp_path: Path) -> Iterator[ReadingKind]:
    file = tmp_path / "level.py"
    file.write_text(LEVEL, encoding="utf-8")
    kind = load_readings(file)
    yield kind
    unregister(kind.name)


def levelled(machine: sm.Machine, kind: ReadingKind) -> Experiment:
    """A plan that reads the three rotations and the level."""
    plan = random_plan(machine, poses=12, loads=9, repeats=1, noise=1e-6, seed=2)
    n = len(plan)
    reading, sigma = np.full((n, 7), np.nan), np.full((n, 7), np.nan)
    reading[:, [3, 4, 6]], sigma[:, [3, 4, 6]] = 0.0, 1e-7
    return replace(plan, extra=(kind.channel,), reading=reading, sigma=sigma)


def test_it_is_predicted_from_the_motion_of_the_point(level: ReadingKind) -> None:
    machine = sm.load_machine("orthoglide-revised")
    shown = Predictor(machine, levelled(machine, level))()
    assert np.abs(shown[:, 6]).max() > 1e-6
    np.testing.assert_allclose(shown[:, 6], 0.6 * shown[:, 3] + 0.8 * shown[:, 4], rtol=0, atol=1e-18)


def test_it_is_read_from_a_file_and_written_again(level: ReadingKind, tmp_path: Path) -> None:
    (tmp_path / "experiment.yaml").write_text(YAML, encoding="utf-8")
    rows = "\n".join(f"{x},0,0,0,300,0,{0.01 * x}" for x in (-100, 0, 100))
    (tmp_path / "data.csv").write_text(f"x,y,z,fx,fy,fz,slope\n{rows}\n", encoding="utf-8")
    e = load_experiment(tmp_path)
    assert e.extra == (level.channel,)
    np.testing.assert_allclose(e.reading[:, 6], [-1e-3, 0.0, 1e-3])
    np.testing.assert_allclose(e.sigma[:, 6], 1e-6)
    save_experiment(e, tmp_path / "again")
    again = load_experiment(tmp_path / "again")
    np.testing.assert_allclose(again.reading[:, 6], e.reading[:, 6], rtol=1e-8)
    np.testing.assert_allclose(again.sigma[:, 6], e.sigma[:, 6], rtol=1e-6)


def test_its_own_coordinates_are_taken_against_the_command(level: ReadingKind, tmp_path: Path) -> None:
    (tmp_path / "experiment.yaml").write_text(YAML, encoding="utf-8")
    (tmp_path / "data.csv").write_text("x,y,z,fx,fy,fz,level\n0,0,0,0,300,0,2\n", encoding="utf-8")
    e = load_experiment(tmp_path)
    assert e.absolute["slope"] == pytest.approx([2e-3])
    assert Predictor(sm.load_machine("orthoglide-revised"), e).experiment.reading[0, 6] == pytest.approx(2e-3)


def test_a_residual_uses_it_and_takes_its_unknown_zero_out(level: ReadingKind) -> None:
    machine = sm.load_machine("orthoglide-revised")
    plan = levelled(machine, level)
    soft = AppliedEffect("compliance", "foot", ("x",), (("scale", 1.5),))
    measured = simulate(machine, plan, [soft], seed=1)
    shifted = measured.with_readings(measured.reading + np.array([0, 0, 0, 0, 0, 0, 3e-4]))
    r = sm.residual(machine, shifted, [soft])
    assert r.nuisances == 1
    assert r.lack_of_fit > 1e-3
    assert sm.residual(machine, shifted).lack_of_fit < 1e-9


def test_without_the_file_its_column_is_unknown(tmp_path: Path) -> None:
    (tmp_path / "experiment.yaml").write_text(YAML.replace(", slope: mrad", ""), encoding="utf-8")
    with pytest.raises(sm.StiffmapError, match="slope"):
        load_experiment(tmp_path)
    assert [k.name for k in kinds()] == ["dd", "hh", "ll"]


def test_definitions_that_cannot_be_are_refused(level: ReadingKind, tmp_path: Path) -> None:
    with pytest.raises(sm.StiffmapError, match="'dx': expected a name of its own"):
        register(replace(level, name="dx"))
    with pytest.raises(sm.StiffmapError, match="unit: expected m or rad, got 'V'"):
        register(replace(level, unit="V"))
    with pytest.raises(sm.StiffmapError, match="absolute and commanded go together"):
        register(replace(level, commanded=None))
    (tmp_path / "none.py").write_text("READING = 3\n", encoding="utf-8")
    with pytest.raises(sm.StiffmapError, match=r"none\.py: defines no reading"):
        load_readings(tmp_path / "none.py")
