"""Calibration of twins whose true errors are known."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import stiffmap as sm
from stiffmap.experiment import Experiment, Predictor, random_plan, save_experiment
from stiffmap.experiment.experiment import Floats
from stiffmap.experiment.noise.whitening import LinearProblem
from stiffmap.identification.calibration import calibrate
from stiffmap.identification.calibration.calibrate import independent
from stiffmap.identification.inference.corrected import corrected
from stiffmap.identification.inference.kernels import Covariance
from stiffmap.identification.inference.readings import Readings
from stiffmap.identification.inference.shares import WideGroup, tolerance_word
from stiffmap.identification.numbers import Tolerances, Unknown, unknowns
from stiffmap.identification.numbers.sensitivity import bends, predicted, sensitivity, sensitivity_at
from stiffmap.model.with_errors import edited
from stiffmap.solve.validity import Validity
from stiffmap.ui.cli.app import main

MACHINES = ("linear-delta", "ur10", "orthoglide-revised")


def drawn(
    name: str, seed: int, size: float = 1.0, poses: int = 30
) -> tuple[sm.Machine, Experiment, dict[str, float]]:
    """A twin whose every unknown is drawn from its uncertainty times `size`."""
    machine = sm.load_machine(name)
    plan = random_plan(machine, "position", poses=poses, seed=seed)
    predictor = Predictor(machine, plan)
    wanted = unknowns(machine.description, predictor.experiment)
    rng = np.random.default_rng(seed)
    t = rng.standard_normal(len(wanted)) * size
    exact = predicted(predictor, wanted, t)
    noise = np.nan_to_num(plan.sigma) * rng.standard_normal(exact.shape)
    truth = {p.name: float(v * p.u) for p, v in zip(wanted, t, strict=True)}
    return machine, plan.with_readings(exact + noise), truth


@pytest.mark.parametrize("name", MACHINES)
def test_values_are_within_their_posterior(name: str) -> None:
    machine, data, truth = drawn(name, 3)
    c = calibrate(machine, data)
    assert c.verdict == "adjusted within tolerance"
    z = np.array([(r.value - truth[r.name]) / r.sigma for r in c.rows])
    assert np.mean(np.abs(z) < 1.96) > 0.85
    assert c.after.rms < 1.3 * c.noise
    assert c.held_out is not None and c.held_out.after.rms < 1.5 * c.noise < 0.2 * c.held_out.before.rms
    assert c.promise is not None
    assert c.promise[0] == pytest.approx(c.held_out.after.rms, rel=0.2)


@pytest.mark.parametrize("name", MACHINES)
def test_a_perfect_machine_is_as_declared(name: str) -> None:
    machine, data, _ = drawn(name, 5, size=0.0)
    c = calibrate(machine, data)
    assert c.verdict == "as declared" and c.which == "declared"
    assert replace(c.machine.description, extra=()) == machine.description
    assert c.held_out is not None and c.held_out.after == c.held_out.before
    valid = Validity.of_machine(c.machine)
    assert valid is not None and valid.poses == len(np.unique(data.groups))
    assert valid.error == pytest.approx(c.held_out.after.size[0])
    few = data.rows(data.groups < 12)
    again = calibrate(c.machine, few)
    assert (
        again.which == "declared" and Validity.of_machine(again.machine) == valid
    )  # not what 12 poses cover


def test_one_beyond_tolerance_is_named() -> None:
    machine, data, _ = drawn("ur10", 8, size=0.5)
    far = Predictor(machine.with_effect("zero_offset", element="elbow", error=0.03), data)
    data = data.with_readings(data.reading + far() - Predictor(machine, data)())
    c = calibrate(machine, data)
    (found,) = c.beyond
    assert found.name == "zero of arm.elbow"
    assert found.value == pytest.approx(0.03, abs=2e-3)
    assert c.verdict == "beyond tolerance: zero of arm.elbow"
    assert c.after.rms < 1.2 * c.noise  # 30 mrad are no straight line any more


def test_the_instrument_keeps_its_certificate() -> None:
    """0.15 % of scale on a tracker of 1e-5 is the machine's, whatever explains it best."""
    machine, data, _ = drawn("ur10", 9, size=0.0)
    at = np.pad(1.5e-3 * data.position, ((0, 0), (0, 3)))
    c = calibrate(machine, data.with_readings(data.reading + at))
    assert "instrument" not in c.verdict
    scale = next(r for r in c.rows if r.group == "instrument")
    assert abs(scale.value) < 5e-5


def test_the_machine_as_built_predicts_the_readings(tmp_path: Path) -> None:
    machine, data, _ = drawn("linear-delta", 4)
    c = calibrate(machine, data)
    again = Predictor(c.machine, data)()
    assert np.nanmax(np.abs(data.reading - again - c.residual)) < 5e-6
    c.machine.save(tmp_path / "built.yaml")
    back = Predictor(sm.load_machine(tmp_path / "built.yaml"), data)()
    assert back == pytest.approx(again, abs=1e-9)


Edit = Callable[[float], tuple[tuple[str, str], float]]


@pytest.mark.parametrize(
    ("what", "effect"),
    [
        (("arm.elbow", "zero"), {"kind": "zero_offset", "element": "elbow", "error": 1e-3}),
        (("arm.elbow", "rx"), {"kind": "tilt", "element": "elbow", "angle_x": 1e-3}),
        (("arm.elbow", "y"), {"kind": "position_offset", "element": "elbow", "error_y": 1e-3}),
    ],
)
def test_errors_are_those_of_the_effects(what: tuple[str, str], effect: dict[str, object]) -> None:
    """The edit of the tree against the library's own effects, which share no code with it."""
    machine = sm.load_machine("ur10")
    plan = random_plan(machine, "position", poses=8, seed=2)
    mine = Predictor(sm.Machine(edited(machine.description, {what: 1e-3})), plan)()
    kind = str(effect.pop("kind"))
    theirs = Predictor(machine.with_effect(kind, **effect), plan)()  # type: ignore[arg-type]
    assert mine == pytest.approx(theirs, abs=1e-12, nan_ok=True)


def test_effects_of_the_machine_stay(tmp_path: Path) -> None:
    machine = sm.load_machine("linear-delta").with_effect("dead_zone", element="carriage", half_width=1e-4)
    built = edited(machine.description, {("a.carriage", "rx"): 1e-3})
    assert built.effects == machine.description.effects


def test_unknowns_name_each_number_once() -> None:
    for name in MACHINES:
        machine = sm.load_machine(name)
        plan = random_plan(machine, "position", poses=2, seed=2)
        found: list[Unknown] = unknowns(machine.description, plan)
        assert len({p.name for p in found}) == len(found)


def test_a_budget_stops_early() -> None:
    machine, data, _ = drawn("linear-delta", 3)
    c = calibrate(machine, data, time_limit=1e-6)
    assert c.stopped and c.held_out is None
    assert "stopped early" in c.lines()[0]


def test_at_the_command_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    _, data, _ = drawn("linear-delta", 3)
    save_experiment(data, tmp_path / "twin")
    assert (
        main(["calibrate", "linear-delta", str(tmp_path / "twin"), "-o", str(tmp_path / "out"), "--json"])
        == 0
    )
    told = json.loads(capsys.readouterr().out)
    assert told["verdict"] == "adjusted within tolerance"
    assert {p.name for p in (tmp_path / "out").iterdir()} == {"calibration.json", "table.txt", "machine.yaml"}
    assert main(["calibrate", "linear-delta", str(tmp_path / "twin"), "--rows", "3"]) == 0
    last = capsys.readouterr().out.splitlines()[-1]
    many = len(told["table"])
    assert last == f"… {many - 3} more, which the readings determine less well (--rows {many})"
    for command in ("calibrate", "diagnose"):
        for excluded in (["wings"], ["gains,wings"], ["zeros, gains", "wings"]):
            more = [part for text in excluded for part in ("--exclude", text)]
            assert main([command, "linear-delta", str(tmp_path / "twin"), *more]) == 2
            assert "'wings'" in capsys.readouterr().err


def test_columns_are_those_of_the_machine_that_is_found() -> None:
    """A drive twice as soft: its deflection, and what the readings say of it, are twice as large."""
    machine = sm.load_machine("orthoglide-revised")
    plan = random_plan(machine, "deflection", poses=8, loads=6, seed=1)
    predictor = Predictor(machine, plan)
    wanted = [u for u in unknowns(machine.description, plan) if u.name == "compliance of x.foot"]
    s = sensitivity(predictor, wanted)
    values = np.array([np.log(2.0) / wanted[0].u])
    moved = sensitivity_at(predictor, s, values)
    problem = LinearProblem.of(plan, plan.sigma, s.base)
    size = [float(np.linalg.norm(problem.white(c.columns))) for c in (s, moved)]
    assert size[1] / size[0] == pytest.approx(2.0, rel=0.05)
    assert bends(problem.white, s, values, predicted(predictor, s.unknowns, values))
    assert not bends(problem.white, s, values * 0.01, predicted(predictor, s.unknowns, values * 0.01))


def test_a_calibration_of_compliances_ends_at_their_most_likely_values() -> None:
    """At the end the gradient of misfit and priors is zero, by differences that share nothing with the fit's columns."""
    machine = sm.load_machine("orthoglide-revised")
    plan = random_plan(machine, "deflection", poses=10, loads=6, seed=1)
    predictor = Predictor(machine, plan)
    wanted = [u for u in unknowns(machine.description, plan) if u.group == "drive compliance"]
    exact = predicted(predictor, wanted, np.array([2.0, -1.5, 1.0]))
    twin = plan.with_readings(exact + np.random.default_rng(2).standard_normal(exact.shape) * plan.sigma)
    p = Predictor(machine, twin)
    problem, s = LinearProblem.of(twin, twin.sigma, p()), sensitivity(p, wanted)
    rows, channel = problem.index
    n, spread = len(rows), np.array([1.0, 2.0, 0.7])
    rest = Covariance(np.ones(n), np.zeros((n, 0)))
    given = Readings(p, twin.sigma, rows, channel, 1.0, np.ones(n), rest, s, spread)
    found = corrected(given, ())

    def cost(t: Floats) -> float:
        r = problem.residual(predicted(predictor, wanted, t))
        return 0.5 * float(r @ r + np.sum((t / spread) ** 2))

    at = found.numbers
    a = problem.white(s.columns)
    sd = np.sqrt(np.diag(np.linalg.inv(a.T @ a + np.diag(spread**-2))))
    for i in range(len(at)):
        step = np.eye(len(at))[i] * 0.3 * sd[i]
        slope = (cost(at + step) - cost(at - step)) / 0.6
        bend = (cost(at + step) - 2 * cost(at) + cost(at - step)) / 0.09
        assert abs(slope) < 0.05
        assert bend > 0
    assert np.all(np.abs(at - [2.0, -1.5, 1.0]) < 4 * sd)


def test_rows_that_fail_at_the_fit_keep_their_columns(monkeypatch: pytest.MonkeyPatch) -> None:
    """An outlier may stand where the calibrated machine has no equilibrium: that is no column of NaN."""
    machine, data, _ = drawn("linear-delta", 3, poses=6)
    predictor = Predictor(machine, data)
    s = sensitivity(predictor, unknowns(machine.description, predictor.experiment)[:3])

    def failing(p: Predictor, names: Sequence[Unknown], values: Floats) -> Floats:
        out = predicted(p, names, values)
        return np.where(np.arange(len(out))[:, None] == 2, np.nan, out)

    monkeypatch.setattr("stiffmap.identification.numbers.sensitivity.predicted", failing)
    again = sensitivity_at(predictor, s, np.ones(len(s.unknowns)))
    read = predictor.experiment.read
    assert np.isfinite(again.columns[read]).all()
    assert (again.columns[2] == s.columns[2]).all()
    assert not np.array_equal(again.columns[0], s.columns[0])


@pytest.mark.parametrize(("name", "seed"), [("linear-delta", 2), ("orthoglide-revised", 6), ("ur10", 1)])
def test_what_no_number_explains_is_unattributed(name: str, seed: int) -> None:
    """Long waves over the workspace that none of the machine's numbers makes."""
    machine, data, _ = drawn(name, seed, size=0.0, poses=40)
    rng = np.random.default_rng(seed)
    x = (data.position - data.position.mean(0)) / np.ptp(data.position, axis=0)
    waves = 1e-4 * np.sin(x @ (4.0 * rng.standard_normal((3, 3))) + rng.uniform(0.0, 6.0, 3))
    c = calibrate(machine, data.with_readings(data.reading + np.pad(waves, ((0, 0), (0, 3)))))
    assert c.verdict == "unattributed" and not c.beyond
    assert "field" in c.rest and f"left: {c.rest}" in c.lines()


@pytest.mark.parametrize(
    ("name", "what"), [("linear-delta", "gain of c.carriage"), ("ur10", "turn of arm.wrist_1 about x")]
)
@pytest.mark.parametrize("poses", [40, 150])
def test_a_fault_does_not_disappear_with_more_readings(name: str, what: str, poses: int) -> None:
    """Every number off by half its uncertainty, one by twelve, and a wave of one noise floor below all."""
    machine, data, _ = drawn(name, 3, size=0.0, poses=poses)
    data = replace(data, frame="unknown")
    p = Predictor(machine, data)
    names = unknowns(machine.description, p.experiment)
    rng = np.random.default_rng(0)
    t = 0.5 * rng.standard_normal(len(names)) * np.array([u.group != "instrument" for u in names])
    quiet = predicted(p, names, t)
    t[[u.name for u in names].index(what)] = 12.0
    x = (data.position - data.position.mean(0)) / np.ptp(data.position, axis=0)
    wave = np.sin(x @ (6.0 * rng.standard_normal((3, 3))) + rng.uniform(0.0, 6.0, 3))
    more = np.nan_to_num(data.sigma) * np.pad(wave, ((0, 0), (0, 3))) + data.reading - p()
    (found,) = calibrate(machine, data.with_readings(predicted(p, names, t) + more)).beyond
    assert found.name == what
    assert not calibrate(machine, data.with_readings(quiet + more)).beyond


@pytest.mark.parametrize(
    ("name", "factor"),
    [("rotary-delta", 1.5), ("rotary-delta", 3.0), ("rotary-delta", 0.6), ("five-bar", 3.0)],
)
def test_soft_drives_move_no_length_that_hardly_shows(name: str, factor: float) -> None:
    machine = sm.load_machine(name)
    plan = random_plan(machine, poses=20, loads=6, repeats=1, seed=2)
    c = calibrate(machine, sm.simulate(machine, plan, f"compliance motor scale={factor}", seed=1))
    assert c.after.rms < 1.05 * c.noise < 0.1 * c.before.rms
    assert c.promise is not None
    assert c.promise[0] < 1.15 * c.noise


def test_a_group_that_is_off_as_a_whole_is_said() -> None:
    machine, data, _ = drawn("ur10", 4, size=4.0, poses=40)
    c = calibrate(machine, data)
    assert c.verdict.startswith(("adjusted beyond", "beyond"))
    assert c.wide and all(2.0 < w.factor < 8.0 for w in c.wide)
    assert any("--tolerance" in x for x in c.lines())
    wide = calibrate(machine, data, tolerances=Tolerances().scaled(4.0))
    assert not wide.wide and wide.verdict == "adjusted within tolerance"


def test_a_single_number_beyond_tolerance_is_said_before_its_group() -> None:
    wide = (WideGroup("zeros", 3.0),)
    assert tolerance_word("", ()) == "adjusted within tolerance"
    assert tolerance_word("", wide) == "adjusted beyond tolerance"
    assert tolerance_word("zero of x", wide) == "beyond tolerance: zero of x"


def test_a_minimal_set_spans_what_the_readings_determine() -> None:
    rng = np.random.default_rng(4)
    a = 5.0 * rng.standard_normal((30, 3))
    columns = np.column_stack([a, a @ [1.0, 0.5, 0.0], 1e-3 * rng.standard_normal(30)])
    kept = independent(columns.T @ columns)
    assert len(kept) == 3 and 4 not in kept
    assert np.linalg.matrix_rank(columns[:, kept]) == 3


@pytest.mark.parametrize("command", ["residual", "calibrate", "monitor"])
def test_rows_out_of_reach_are_said_wherever_they_are_missed(
    command: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    _, data, _ = drawn("ur10", 3, poses=6)
    far = data.position.copy()
    far[0, 0] = 5.0
    folder = str(tmp_path / "e")
    save_experiment(replace(data, position=far), folder)
    more = {"monitor": [folder, "--effect", "zero_offset elbow error=0mrad"]}.get(command, [])
    said = "the machine has no equilibrium at 1 row"
    main([command, "ur10", folder, *more])
    assert f"left out: {said}" in capsys.readouterr().out
    main([command, "ur10", folder, *more, "--json"])
    found = json.loads(capsys.readouterr().out)
    assert any(said in text for text in found.get("left_out", found.get("limitations")))


@pytest.mark.parametrize("wrong", [-1e-4, float("nan"), float("inf"), "1e-4", None])
@pytest.mark.parametrize("name", ["position", "gain", "frame"])
def test_a_tolerance_is_a_size(name: str, wrong: float) -> None:
    with pytest.raises(sm.StiffmapError, match=f"{name}: expected"):
        Tolerances(**{name: wrong})
    with pytest.raises(sm.StiffmapError, match="expected"):
        Tolerances().scaled(wrong if wrong != "1e-4" else float("-inf"))


def test_no_endless_tolerance_at_the_command_line(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    for factor in ("inf", "nan"):
        assert main(["calibrate", "ur10", str(tmp_path), "--tolerance", factor]) == 2
    assert "position: expected a standard uncertainty, 0 or more, got inf" in capsys.readouterr().err
