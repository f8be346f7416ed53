"""Prediction of readings, noise, outliers and model-free checks."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import stiffmap as sm
from stiffmap.experiment import Predictor, predict, random_plan, save_experiment, simulate
from stiffmap.experiment.calls import placed
from stiffmap.experiment.experiment import numbered
from stiffmap.experiment.noise.checks import checks
from stiffmap.experiment.noise.level import noise_of
from stiffmap.experiment.noise.outliers import suspects, without_suspects
from stiffmap.experiment.prediction.predict import fingerprint, readings, true_wrench
from stiffmap.model.description import AppliedEffect


@pytest.fixture(scope="module")
def machine() -> sm.Machine:
    return sm.load_machine("orthoglide-revised")


@pytest.fixture(scope="module")
def plan(machine: sm.Machine) -> sm.Experiment:
    return random_plan(machine, "deflection", poses=8, loads=6, seed=2)


def test_prediction_is_the_machine_row_by_row(machine: sm.Machine, plan: sm.Experiment) -> None:
    got = predict(machine, plan)
    for i in (0, 17, 60):
        alone = machine.solve(plan.position[i], plan.wrench[i]).displacement
        np.testing.assert_allclose(got[i], alone, atol=1e-12)


def test_repeats_are_solved_once(machine: sm.Machine, plan: sm.Experiment) -> None:
    predictor = Predictor(machine, plan)
    predictor()
    assert predictor.solved == len(np.unique(plan.conditions)) == len(plan) // 2


def test_deflection_subtracts_the_unloaded_state(machine: sm.Machine, plan: sm.Experiment) -> None:
    term = AppliedEffect("length", "bar", ("x",), (("error", 1e-4),))
    moved = predict(machine, plan, (term,)) - predict(machine, plan)
    assert np.abs(moved[:, :3]).max() < 1e-6  # the length itself cancels, only its geometry is left
    still = replace(plan, quantity="position", wrench=np.zeros_like(plan.wrench))
    assert np.abs(predict(machine, still, (term,))[:, 0]).min() > 5e-5


@pytest.mark.parametrize(
    ("kind", "element", "value"),
    [("friction", "actuator", {"force": 40.0}), ("thermal_growth", "bar", {"coefficient": 1.2e-5})],
)
def test_rows_say_what_an_effect_leaves_open_in_a_file_as_on_a_command_line(
    machine: sm.Machine, plan: sm.Experiment, kind: str, element: str, value: dict[str, float]
) -> None:
    """A corrected machine shows the readings that it was corrected by: on the way down, and warm."""
    e = replace(
        plan.rows(np.arange(8)), branch=("loading", "unloading") * 4, temperature=np.linspace(20, 28, 8)
    )
    e = replace(e, quantity="position" if kind == "thermal_growth" else "deflection")
    term = AppliedEffect(kind, element, ("x",), tuple(value.items()))
    own = machine.with_effect(kind, element=element, legs=["x"], **value)
    shown = predict(machine, e, (term,))
    assert np.abs(shown - predict(machine, e)).max() > 1e-6
    np.testing.assert_allclose(predict(own, e), shown, rtol=0, atol=1e-12)
    np.testing.assert_allclose(Predictor(machine, e).beside(machine=own)(), shown, rtol=0, atol=1e-12)
    more = AppliedEffect("compliance", "actuator", ("y",), (("scale", 1.5),))
    np.testing.assert_allclose(
        predict(own, e, (more,)), predict(machine, e, (term, more)), rtol=0, atol=1e-12
    )
    said = {"temperature_difference": 5.0} if kind == "thermal_growth" else {"branch": "loading"}
    fixed = machine.with_effect(kind, element=element, legs=["x"], **value, **said)
    assert np.abs(predict(fixed, e) - shown).max() > 1e-6  # the file's own word holds


def test_measurement_effects_act_on_loads_and_readings(plan: sm.Experiment) -> None:
    gain = AppliedEffect("load_gain", "load", (), (("gain", 1.1),))
    np.testing.assert_allclose(true_wrench(plan, [gain]), 1.1 * plan.wrench)
    turn = AppliedEffect("load_direction", "load", (), (("angle_z", np.pi / 2),))
    np.testing.assert_allclose(true_wrench(plan, [turn])[:, 1], plan.wrench[:, 0], atol=1e-12)
    motion = np.full((len(plan), 6), 1e-5)
    sensor = AppliedEffect("sensor_gain", "sensor", (), (("gain_x", 1.2),))
    np.testing.assert_allclose(readings(plan, motion, [sensor])[:, 0], 1.2e-5)
    drift = AppliedEffect("drift", "sensor", (), (("x", 1e-8),))
    assert readings(plan, motion, [drift])[-1, 0] == pytest.approx(1e-5 + 1e-8 * (len(plan) - 1))


def test_a_force_at_another_point_has_a_moment(plan: sm.Experiment) -> None:
    pulled = replace(plan, wrench=np.tile([0.0, 0.0, -100.0, 0.0, 0.0, 2.0], (len(plan), 1)))
    arm = AppliedEffect("load_offset", "load", (), (("offset_x", 0.05),))
    np.testing.assert_allclose(true_wrench(pulled, [arm]), [[0, 0, -100, 0, 5, 2]] * len(plan), atol=1e-12)
    quarter = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])  # tool x along base y
    turned = replace(pulled, rotation=np.tile(quarter, (len(plan), 1, 1)))
    np.testing.assert_allclose(true_wrench(turned, [arm]), [[0, 0, -100, -5, 0, 2]] * len(plan), atol=1e-12)


def test_noise_floor_is_the_larger_and_contradictions_are_told(
    machine: sm.Machine, plan: sm.Experiment
) -> None:
    twin = simulate(machine, plan, seed=1)
    honest = noise_of(twin)
    assert not honest.contradictions()
    assert honest.floor[0] == pytest.approx(3e-6, rel=0.25)
    assert (honest.floor[:3] >= honest.declared[:3]).all()
    bold = noise_of(replace(twin, sigma=twin.sigma / 10))
    assert len(bold.contradictions()) == 3
    np.testing.assert_allclose(bold.floor[:3], honest.repeats[:3])


def test_unknown_noise_is_an_error(machine: sm.Machine, plan: sm.Experiment) -> None:
    twin = simulate(machine, plan, seed=1)
    single = replace(twin, sigma=np.zeros_like(twin.sigma)).rows(np.arange(0, len(twin), 2))
    with pytest.raises(sm.StiffmapError, match="noise of dx, dy, dz is zero or unknown"):
        noise_of(single)


def test_outliers_are_found_and_never_a_whole_pose(machine: sm.Machine, plan: sm.Experiment) -> None:
    twin = simulate(machine, plan, seed=4)
    reading = twin.reading.copy()
    reading[[5, 40]] += 4e-5
    reading[twin.groups == twin.groups[70]] += 4e-5
    residual = reading - predict(machine, plan)
    noise, found = without_suspects(twin.with_readings(reading), predict(machine, plan))
    assert np.flatnonzero(found).tolist() == [5, 40]
    assert set(np.flatnonzero(suspects(twin.with_readings(reading), residual, twin.sigma))) >= {5, 40}
    assert noise.repeats[:3] == pytest.approx(noise.declared[:3], rel=0.2)


def test_model_free_checks_see_what_they_should(machine: sm.Machine, plan: sm.Experiment) -> None:
    keep = np.ones(len(plan), bool)

    def p_values(*terms: AppliedEffect) -> dict[str, float]:
        twin = simulate(machine, plan, terms, seed=5)
        return {c.name: c.p for c in checks(twin, twin.reading, twin.sigma, keep) if c.contrasts}

    clean = p_values()
    assert min(clean.values()) > 1e-3
    slack = p_values(AppliedEffect("dead_zone", "actuator", ("y",), (("half_width", 1.2e-5),)))
    assert slack["linearity"] < 1e-6 and slack["sign reversal"] > 1e-3
    turned = p_values(AppliedEffect("load_direction", "load", (), (("angle_z", 0.1),)))
    assert turned["reciprocity"] < 1e-6 and turned["linearity"] > 1e-3


def test_rows_that_are_left_out_say_whether_it_is_the_load() -> None:
    machine = sm.load_machine("linear-delta")
    plan = random_plan(machine, "deflection", poses=2, seed=1)
    with pytest.raises(sm.StiffmapError, match=r"at 36 rows .*: it gives way under the load there"):
        Predictor(machine, replace(plan, wrench=plan.wrench * 300))
    with pytest.raises(sm.StiffmapError, match=r"at 36 rows .*: out of reach, or units are wrong"):
        Predictor(machine, replace(plan, position=plan.position + np.array([1.0, 0, 0])))


def test_numbers_of_rows_are_those_of_sorted_different_rows() -> None:
    """Against `np.unique` along an axis, which shares no code with it; unread cells are alike."""
    rng = np.random.default_rng(4)
    key = rng.integers(-2, 3, (400, 3)) / 7.0
    key[rng.random(400) < 0.1, 2] = np.nan
    words = tuple(rng.choice(["up", "down"], 400))
    number = numbered([key[:, 0], None, key[:, 1:], words, ()])
    plain = np.hstack([np.round(np.nan_to_num(key, nan=9.0), 9) + 0.0, (np.array(words) == "up")[:, None]])
    np.testing.assert_array_equal(number, np.unique(plain, axis=0, return_inverse=True)[1].reshape(-1))
    assert numbered([np.array([-0.0, 0.0, 1e-12])]).tolist() == [0, 0, 0]


TEXT = "compliance actuator x scale=1.5"
WRONG: dict[str, Callable[[sm.Machine, sm.Experiment], object]] = {
    "expected a machine: .* got int": lambda m, e: predict(3, e),  # type: ignore[arg-type]
    "experiment: expected an Experiment, or its folder, got ndarray": lambda m, e: predict(m, e.reading),  # type: ignore[arg-type]
    "terms: expected effects, .* got NoneType": lambda m, e: predict(m, e, None),  # type: ignore[arg-type]
    "machine: expected a Machine, got 'ur10'": lambda m, e: Predictor("ur10", e),  # type: ignore[arg-type]
    "experiment: expected an Experiment, got 'folder'": lambda m, e: Predictor(m, "folder"),  # type: ignore[arg-type]
    "terms: expected several, each an AppliedEffect, got 'comp": lambda m, e: Predictor(m, e)(TEXT),  # type: ignore[arg-type]
    "terms: expected several, each an AppliedEffect, got None": lambda m, e: Predictor(m, e)(None),  # type: ignore[arg-type]
    "poses: expected 1 or more, got 0": lambda m, e: random_plan(m, poses=0),
    "poses: expected a whole number, got '3'": lambda m, e: random_plan(m, poses="3"),  # type: ignore[arg-type]
    "loads: expected 1 or more, got -1": lambda m, e: random_plan(m, loads=-1),
    "force: expected a positive number .N., got 0": lambda m, e: random_plan(m, force=0.0),
    "force: expected a number, got list": lambda m, e: random_plan(m, force=[400.0]),  # type: ignore[arg-type]
    "experiment: expected an Experiment, got None": lambda m, e: save_experiment(None, "there"),  # type: ignore[arg-type]
    "folder: expected text or a path, got None": lambda m, e: save_experiment(e, None),  # type: ignore[arg-type]
}


@pytest.mark.parametrize("message", WRONG)
def test_what_is_no_input_is_refused_by_name(machine: sm.Machine, plan: sm.Experiment, message: str) -> None:
    with pytest.raises(sm.StiffmapError, match=message):
        WRONG[message](machine, plan)


def test_names_folders_and_texts_serve_as_well(
    machine: sm.Machine, plan: sm.Experiment, tmp_path: Path
) -> None:
    wanted = predict(machine, plan, [placed(machine, TEXT)])
    save_experiment(simulate(machine, plan), tmp_path / "e")
    for m, e, terms in (
        (machine, plan, TEXT),
        ("orthoglide-revised", plan, [TEXT]),
        (machine, tmp_path / "e", TEXT),
    ):
        np.testing.assert_allclose(predict(m, e, terms), wanted, atol=1e-9)  # type: ignore[arg-type]
    assert random_plan("orthoglide-revised", poses=2).machine == machine.name


@pytest.mark.parametrize(
    ("change", "same"),
    [
        ({"name": "again", "reading": 1e-5, "notes": "cold"}, True),
        ({"anchor": (0.0, 0.0, 1.0)}, False),
        ({"registration": (("anchor 1", np.eye(3), np.ones(3)),)}, False),
        ({"unloaded": "unknown"}, False),
        ({"wrench": 2.0}, False),
    ],
)
def test_a_fingerprint_is_of_all_that_a_prediction_depends_on(machine, plan, change, same) -> None:
    own = {k: np.full(getattr(plan, k).shape, v) for k, v in change.items() if isinstance(v, float)}
    own |= {k: v for k, v in change.items() if k != "notes" and not isinstance(v, float)}
    record = (("notes", change["notes"]),) if "notes" in change else ()
    other = replace(plan, **own, record=record)
    assert (fingerprint(Predictor(machine, other)) == fingerprint(Predictor(machine, plan))) == same
