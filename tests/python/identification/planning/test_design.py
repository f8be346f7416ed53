"""Chosen rows against all choices there are, and the loop from plan to compensated commands."""

from __future__ import annotations

from itertools import combinations, count
from pathlib import Path

import numpy as np
import pytest

import stiffmap as sm
from stiffmap.experiment import Predictor, simulate
from stiffmap.experiment.calls import placed
from stiffmap.identification.planning import estimate, follow, plan as design
from stiffmap.identification.planning.changes import monitor as compare
from stiffmap.machining.compensation import compensate
from stiffmap.ui.cli.app import main


@pytest.fixture(scope="module")
def orthoglide() -> sm.Machine:
    return sm.load_machine("orthoglide-revised")


def sensitivities(machine: sm.Machine, plan: sm.Experiment, texts: list[str]) -> np.ndarray:
    """(n, 3, k) change per standard deviation, by one-sided differences of the prediction."""
    predict, columns = Predictor(machine, plan), []
    for text in texts:
        columns.append((predict([placed(machine, text)]) - predict())[:, :3] / plan.sigma[:, :3])
    return np.stack(columns, axis=-1)


def test_identify_is_the_best_of_all_choices(orthoglide: sm.Machine) -> None:
    terms = [placed(orthoglide, f"compliance actuator {leg} scale=1") for leg in "xy"]
    pool = design(orthoglide, terms, rows=9, poses=3).experiment
    best = design(orthoglide, terms, rows=3, candidates=pool).experiment
    x = sensitivities(orthoglide, pool, [f"compliance actuator {leg} scale=1.001" for leg in "xy"])
    information = np.einsum("nca,ncb->nab", x, x)
    value = {c: np.linalg.slogdet(information[list(c)].sum(axis=0))[1] for c in combinations(range(9), 3)}
    chosen = [i for i, p in enumerate(zip(pool.position.tolist(), pool.wrench.tolist(), strict=True))
              if p in list(zip(best.position.tolist(), best.wrench.tolist(), strict=True))]  # fmt: skip
    assert value[tuple(chosen)] == pytest.approx(max(value.values()), abs=1e-6)


def test_expected_uncertainty_is_what_twins_scatter_by(orthoglide: sm.Machine) -> None:
    term = placed(orthoglide, "compliance actuator x scale=1")
    plan = design(orthoglide, [term], rows=4, poses=10)
    assert (plan.sigma < plan.random_sigma).all()
    found = [
        estimate(orthoglide, simulate(orthoglide, plan.experiment, [term], seed=s), [term]) for s in range(40)
    ]
    scatter = np.std([f.values[0] for f in found], ddof=1)
    assert 0.65 < scatter / plan.sigma[0] < 1.45  # 40 draws: +- 11 % one sigma
    assert found[0].sigma[0] == pytest.approx(plan.sigma[0], rel=0.02)


def test_what_no_reading_tells_is_not_known() -> None:
    machine = sm.load_machine("ur10")  # nothing on the axis of the last joint moves when that joint yields
    terms = [placed(machine, f"compliance {joint} arm scale=1") for joint in ("elbow", "wrist_3")]
    plan = design(machine, terms, rows=4, poses=6)
    assert np.isfinite(plan.sigma).tolist() == [True, False]
    readings = [simulate(machine, plan.experiment, terms, seed=s) for s in range(2)]
    found = estimate(machine, readings[0], terms)
    assert found.sigma == pytest.approx(plan.sigma, rel=0.01)
    assert found.values[1] == 1.0
    compared = compare(machine, *readings, terms)
    alone = compare(machine, *readings, terms[:1])
    assert compared.p == pytest.approx(alone.p)
    assert (compared.changes[1].p, compared.changes[1].u) == (1.0, np.inf)
    assert "not identifiable" in str(compared.changes[1])


def test_rivals_are_told_apart_better_than_at_random(orthoglide: sm.Machine) -> None:
    gap, soft = (
        placed(orthoglide, t)
        for t in ("dead_zone actuator y half_width=10um", "compliance actuator y scale=1.2")
    )
    one_force = design(orthoglide, [gap], rival=[soft], aim="separate", rows=6, poses=12)
    assert one_force.value > one_force.random_value
    # What the rival's best fit leaves, by least squares on the chosen rows.
    predict = Predictor(orthoglide, one_force.experiment)
    signal = ((predict([gap]) - predict()) / one_force.experiment.sigma)[:, :3].ravel()
    column = ((predict([soft]) - predict()) / one_force.experiment.sigma)[:, :3].ravel()
    left = signal - column * (column @ signal) / (column @ column)
    assert one_force.value == pytest.approx(np.linalg.norm(left), rel=1e-3)


def test_the_map_is_made_certain(orthoglide: sm.Machine) -> None:
    terms = [placed(orthoglide, f"compliance actuator {leg} scale=1") for leg in "xyz"]
    plan = design(orthoglide, terms, rows=5, poses=12, aim="map", position=np.array([[0.1, 0.1, 0.0]]))
    assert plan.value < plan.random_value
    with pytest.raises(
        sm.StiffmapError, match=r"^position: .* at 1 row \(id 2; first at \(9000.0, 0.0, 0.0\) mm"
    ):
        design(
            orthoglide, terms, rows=5, poses=12, aim="map", position=np.array([[0.1, 0.1, 0.0], [9, 0, 0]])
        )


def test_limits_and_unknown_frames() -> None:
    machine = sm.load_machine("linear-delta")
    term = placed(machine, f"zero_offset {machine.actuators[0].split('.')[1]} {machine.legs[0]} error=0.1mm")
    plan = design(machine, [term], rows=8, quantity="position", poses=15, frame="offset_unknown")
    assert np.isfinite(plan.sigma).all()
    drives = sm.inverse_kinematics(machine, plan.experiment.position)
    assert not (drives.flags & sm.Flag.DRIVE_RANGE).any()


def test_measuring_stops_when_it_is_known_well_enough(orthoglide: sm.Machine) -> None:
    truth, seeds = [placed(orthoglide, "compliance actuator x scale=1.4")], count()
    start = [placed(orthoglide, "compliance actuator x scale=1")]
    steps = follow(
        orthoglide,
        start,
        lambda e: simulate(orthoglide, e, truth, seed=next(seeds)),
        until=0.15,
        batch=3,
        poses=8,
    )
    rows, last = steps[-1]
    assert last.sigma[0] * last.misfit <= 0.15 * 0.1 < steps[-2][1].sigma[0] * steps[-2][1].misfit
    assert abs(last.values[0] - 1.4) < 4 * last.sigma[0]
    assert rows == 3 * len(steps)


def test_from_a_plan_to_compensated_commands(orthoglide: sm.Machine) -> None:
    """docs/planning.md: the error left on a twin that has an effect nobody looks for."""
    named = placed(orthoglide, "length bar x error=0.1mm")
    hidden = placed(orthoglide, "zero_offset actuator y error=0.01mm")
    plan = design(orthoglide, [named], rows=10, quantity="position", poses=15)
    data = simulate(orthoglide, plan.experiment, [named, hidden], seed=1)
    found = estimate(orthoglide, data, [placed(orthoglide, "length bar x error=1um")])
    corrected = orthoglide.with_effect("length", element="bar", legs=["x"], error=float(found.values[0]))
    wanted = np.array([[0.05, 0.0, 0.02], [-0.1, 0.08, 0.0], [0.0, -0.1, 0.1]])
    commands = compensate(corrected, wanted)
    twin = Predictor(orthoglide, data).with_terms([named, hidden])

    def error(actuators: np.ndarray) -> float:
        real = twin.solve_joints(actuators, stiffness=False).displacement[:, :3]
        off = sm.forward_kinematics(twin, actuators).position + real - wanted
        return float(np.sqrt(np.mean(np.sum(off**2, axis=1))))

    assert error(commands.declared) > 8e-5
    assert error(commands.actuators) < 2.5e-5  # what is left is the hidden 10 um


def test_the_command_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "plan.csv"
    plan = ["plan", "orthoglide-revised", "--identify", "compliance actuator x scale=1", "--poses", "8"]
    assert main([*plan, "--rows", "4", "-o", str(out)]) == 0
    assert "random" in capsys.readouterr().out
    assert main(["simulate", "orthoglide-revised", "--plan", str(out), "-o", str(tmp_path / "twin")]) == 0
    assert len(sm.load_experiment(tmp_path / "twin")) == 4
    capsys.readouterr()
    assert main([*plan, "--rows", "400"]) == 2
    assert "candidates" in capsys.readouterr().err
    assert main([*plan, "--map", "--rival", "compliance actuator y scale=1.2"]) == 2
