"""Effects on top of a calibration: twins whose every number is drawn from its uncertainty."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import stiffmap as sm
from stiffmap.experiment import Experiment, Predictor, random_plan
from stiffmap.identification.diagnosis.report.sentences import next_step, opening
from stiffmap.identification.numbers import unknowns
from stiffmap.identification.numbers.sensitivity import predicted
from stiffmap.machining.compensation.check import check_compensation
from stiffmap.model.description import AppliedEffect
from stiffmap.ui.cli.diagnose import write

LEAD = AppliedEffect("lead_error", "carriage", ("a",), (("slope", 5e-3),))


def twin(
    seed: int, *effects: AppliedEffect, rough: float = 0.0, spread: float = 1.0, poses: int | None = None
) -> tuple[sm.Machine, Experiment]:
    """Readings of a delta that is off everywhere, with effects and a pattern (m) that no model holds; with `poses` the same
    delta read at so many others."""
    machine = sm.load_machine("linear-delta")
    plan = random_plan(machine, "position", poses=poses or 40, seed=seed + 1000 * bool(poses))
    p = Predictor(machine, plan)
    wanted = unknowns(machine.description, p.experiment)
    rng = np.random.default_rng(seed)
    exact = predicted(p, wanted, spread * rng.standard_normal(len(wanted))) + p(effects) - p()
    exact[:, 2] += rough * np.sin(plan.position[:, 0] / 0.011) * np.cos(plan.position[:, 1] / 0.009)
    return machine, plan.with_readings(exact + np.nan_to_num(plan.sigma) * rng.standard_normal(exact.shape))


def test_no_cause_is_invented_where_every_number_is_a_little_off() -> None:
    machine, data = twin(2)
    d = sm.diagnose(machine, data)
    assert d.verdict == "none" and not d.effects
    assert d.calibration is not None and d.calibration.verdict == "adjusted within tolerance"
    assert d.after.rms < 1.3 * d.noise.rms < 0.1 * d.before.rms


def test_numbers_that_are_further_off_than_stated_are_said_to_be() -> None:
    machine, data = twin(2, spread=5.0)
    found = sm.diagnose(machine, data)
    assert found.calibration is not None and all(3.0 < w.factor < 8.0 for w in found.calibration.wide)
    assert found.calibration.verdict.startswith(("adjusted beyond tolerance", "beyond tolerance"))
    assert any("times as far off" in line for line in found.lines())


def test_a_machine_whose_numbers_are_off_as_a_group_is_not_as_declared() -> None:
    """What `calibrate` calls beyond tolerance is never "nothing to mend" in a diagnosis."""
    machine, data = twin(4, spread=2.2, poses=20)
    d = sm.diagnose(machine, data)
    assert d.calibration is not None and d.calibration.wide and not d.calibration.beyond and not d.effects
    assert d.verdict == "unattributed" and not d.unexplained
    assert "by more than its numbers are uncertain" in opening(d) and "Nothing to mend" not in next_step(d)
    assert "none of them alone can be named" in d.lines()[0]
    assert any("times as far off" in line for line in d.lines())
    assert sm.calibrate(machine, data).verdict == "adjusted beyond tolerance"


@pytest.mark.slow
def test_a_cause_is_named_beside_small_errors_and_a_rest() -> None:
    machine, data = twin(5, LEAD, rough=8e-5)
    d = sm.diagnose(machine, data)
    assert d.verdict == "effects+unattributed"
    assert [(e.kind, e.legs) for e in d.effects] == [("lead_error", ("a",))]
    assert any("lead_error" in line for line in d.lines() if line.startswith("shares of the squares:"))


@pytest.mark.slow
def test_the_file_does_on_new_readings_what_the_headline_says(tmp_path: Path) -> None:
    machine, data = twin(5, LEAD)
    d = sm.diagnose(machine, data)
    assert [e.kind for e in d.effects] == ["lead_error"] and d.calibration is not None
    write(d, tmp_path)
    file = sm.load_machine(tmp_path / "machine.yaml")
    assert not (tmp_path / "calibrated.yaml").exists()
    _, fresh = twin(5, LEAD, poses=200)
    after = check_compensation(file, fresh).whole[1]
    assert after.rms == pytest.approx(d.after.rms, rel=0.15)
    # the effect alone, on the declared numbers, is not the machine
    bare = machine.with_effect(
        "lead_error", element="carriage", legs=["a"], slope=d.effects[0].parameters["slope"][0]
    )
    assert check_compensation(bare, fresh).whole[1].rms > 3.0 * after.rms


@pytest.mark.slow
def test_a_rest_alone_names_nothing() -> None:
    machine, data = twin(6, rough=8e-5)
    d = sm.diagnose(machine, data)
    assert d.verdict == "unattributed" and not d.effects


def test_a_budget_gives_the_best_so_far() -> None:
    machine, data = twin(2)
    d = sm.diagnose(machine, data, time_limit=1e-3)
    assert d.stopped
    assert "stopped early" in d.lines()[-1]
    assert d.as_plain()["held_out"] is None


def test_an_unknown_exclusion_is_refused() -> None:
    machine, data = twin(2)
    with pytest.raises(sm.StiffmapError, match="no effect 'wings'"):
        sm.diagnose(machine, data, exclude=["wings"])
