"""Drives that remember: against incremental energy minimisation, and on a machine of one joint."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

import stiffmap as sm
from stiffmap.experiment import Predictor, load_experiment, random_plan
from stiffmap.experiment.calls import placed
from stiffmap.experiment.poses.configuration import coordinates_of
from stiffmap.experiment.prediction.history import Drives
from stiffmap.experiment.ramps import directions
from stiffmap.identification.planning import estimate
from stiffmap.model.description.tree import joints
from stiffmap.model.effects.library.friction import deflection, spring_force

ONE_JOINT = """
name: gear
title: a gearbox whose output is clamped
units: {length: mm, force: N, angle: deg}
home: {translation: [0, 0, 0]}
legs:
  box:
    elements:
      - {actuator: gear, kind: revolute, axis: z, home: 0, compliance: 1.0e-6}
"""
PLAIN = {
    "level": 0.0,
    "spread": 0.0,
    "breakaway": 1.0,
    "half_width": 0.0,
    "seat": 1e-3,
    "ratio": 1.0,
    "knee": 1.0,
}


def ramps(top: float = 40.0, number: int = 60) -> np.ndarray:
    legs = [
        np.linspace(0, top, number),
        np.linspace(top, -top, 2 * number),
        np.linspace(-top, 0.6 * top, number),
    ]
    return np.concatenate([*legs, np.linspace(0.6 * top, 0.0, number)])


def test_coulomb_beside_a_stiffening_spring_is_the_path_of_least_energy() -> None:
    """Each step minimises energy - work + level |step|: no operator in it."""
    level, cubic, stiffness = 5.0, 3.0, 2.0
    force, a, wanted = ramps(), 0.0, []
    for f in force:

        def energy(x: float, f: float = f, last: float = a) -> float:
            return 0.5 * stiffness * x**2 + 0.25 * cubic * x**4 - f * x + level * abs(x - last)

        best = minimize_scalar(energy, bounds=(-20, 20), method="bounded", options={"xatol": 1e-12}).x
        a = a if energy(a) <= energy(best) + 1e-12 else best
        wanted.append(a)
    s = spring_force(force, level)
    got = [next(r.real for r in np.roots([cubic, 0, stiffness, -v]) if abs(r.imag) < 1e-9) for v in s]
    np.testing.assert_allclose(got, wanted, atol=2e-4)


def test_masing_the_branches_are_the_first_loading_twice_as_large() -> None:
    values = PLAIN | {"level": 4.0, "spread": 1.0}
    up = np.linspace(0, 20, 400)
    first = deflection(up, 0.1, values)
    down = deflection(np.append(up, 20 - 2 * up), 0.1, values)[400:]
    np.testing.assert_allclose(first[-1] - down, 2 * first, atol=1e-9)


def test_breaking_away_needs_more_than_going_on() -> None:
    s = spring_force(np.array([1.0, 1.9, 2.1, 3.0, 2.5, 1.0, 0.5]), 1.0, 2.0)
    np.testing.assert_allclose(s, [0, 0, 1.1, 2.0, 2.0, 2.0, 2.0])


def test_play_and_stiffening() -> None:
    force = np.array([-1e3, 1e3])
    wide = deflection(force, 1e-6, PLAIN | {"half_width": 0.03})
    np.testing.assert_allclose(wide, [-0.031, 0.031])
    stiff = deflection(force, 1e-6, PLAIN | {"ratio": 0.5, "knee": 1.0})
    np.testing.assert_allclose(stiff[1], 0.5e-3 + 0.5e-6, rtol=1e-6)


@pytest.fixture
def gear(tmp_path: Path) -> sm.Machine:
    (tmp_path / "gear.yaml").write_text(ONE_JOINT)
    return sm.load_machine(tmp_path / "gear.yaml")


def ramp_folder(place: Path, reading: np.ndarray | None = None, order: bool = True) -> Path:
    place.mkdir(exist_ok=True)
    (place / "experiment.yaml").write_text(
        "machine: gear\nquantity: position\nunits: {length: m, force: N, angle: rad}\nnoise: {rz: 1e-5}\n"
        "command: {q: {actuator: box.gear, unit: rad}}\nframe: offset_unknown\n"
    )
    torque = ramps()
    rz = np.zeros(len(torque)) if reading is None else reading
    rows = [
        f"0,{t},{r},{i}" if order else f"0,{t},{r}" for i, (t, r) in enumerate(zip(torque, rz, strict=True))
    ]
    (place / "data.csv").write_text("\n".join(["q,mz,rz" + (",order" if order else ""), *rows]) + "\n")
    return place


def test_one_joint_is_a_machine_of_its_own(gear: sm.Machine, tmp_path: Path) -> None:
    text = "hysteresis gear level=4N.m spread=0.5 half_width=0.5deg ratio=0.6 knee=15N.m seat=1N.m"
    term = placed(gear, text.replace("N.m", "N·m"))
    e = load_experiment(ramp_folder(tmp_path / "a"))
    exact = Predictor(gear, e)([term])[:, 5]
    values = PLAIN | dict(term.parameters)
    np.testing.assert_allclose(exact, deflection(ramps(), 1e-3, values), atol=1e-9)
    noisy = exact + 1e-5 * np.random.default_rng(0).standard_normal(len(exact)) + 0.2
    data = load_experiment(ramp_folder(tmp_path / "b", noisy))
    start = placed(gear, text.replace("level=4", "level=3").replace("0.5deg", "0.4deg").replace("N.m", "N·m"))
    found = estimate(gear, data, [start])
    at = dict(found.terms[0].parameters)
    assert at["level"] == pytest.approx(4.0, rel=0.01)
    assert at["half_width"] == pytest.approx(np.radians(0.5), rel=0.01)
    assert found.misfit < 1.15


def test_time_is_needed(gear: sm.Machine, tmp_path: Path) -> None:
    e = load_experiment(ramp_folder(tmp_path / "a", order=False))
    with pytest.raises(sm.StiffmapError, match="order"):
        Predictor(gear, e)([placed(gear, "hysteresis gear level=4N·m")])


def test_gravity_and_loads_of_every_row_reach_the_drives(tmp_path: Path) -> None:
    """An arm under its own weight: friction of the shoulder shifts it by level times compliance."""
    machine = sm.load_machine("ur10")
    names = [f"q{i}" for i in range(6)]
    commands = "".join(
        f"  {n}: {{actuator: {a}, unit: deg}}\n" for n, a in zip(names, machine.actuators, strict=True)
    )
    (tmp_path / "experiment.yaml").write_text(
        "machine: ur10\nquantity: position\nunits: {length: m, angle: deg}\nnoise: {dx: 1e-5}\n"
        f"gravity: {{up: [0, 0, -9.81], down: [0, 0, 9.81]}}\ncommand:\n{commands}"
    )
    rows = ["0,-60,90,-120,-90,0,0,1,up", "0,-60,90,-120,-90,0,0,2,down"]
    (tmp_path / "data.csv").write_text("\n".join([",".join([*names, "dx", "order", "setup"]), *rows]) + "\n")
    predict = Predictor(machine, load_experiment(tmp_path))
    more = predict([placed(machine, "hysteresis shoulder level=5N·m")]) - predict()
    q = np.radians([0, -60, 90, -120, -90, 0])
    step = 1e-6 * np.eye(6)[1]
    ahead, behind = (sm.forward_kinematics(machine, q + s * step).position for s in (1, -1))
    lag = 2.5e-5 * 5.0 * (ahead - behind) / 2e-6
    np.testing.assert_allclose(np.abs(more[:, :3]), np.abs([lag, lag]), rtol=1e-3, atol=1e-9)
    np.testing.assert_allclose(more[0, :3], -more[1, :3], atol=1e-9)


def test_friction_of_a_drive_behind_the_platform(tmp_path: Path) -> None:
    """The fork of the hybrid turns the tool by level times compliance where its torque exceeds the level."""
    machine = sm.load_machine("hybrid")
    p, loads = machine.description.home.p, [0.0, 500.0, 0.0]
    rows = [f"{p[0]},{p[1]},{p[2]},{f},{i}" for i, f in enumerate(loads)]
    (tmp_path / "experiment.yaml").write_text(
        "machine: hybrid\nquantity: deflection\nunits: {length: m, force: N, angle: rad}\nnoise: {rx: 1e-6}\n"
    )
    data = [f"{row},0" for row in rows]
    (tmp_path / "data.csv").write_text("\n".join(["x,y,z,fy,order,rx", *data]) + "\n")
    plan = load_experiment(tmp_path)
    predict = Predictor(machine, plan)
    more = predict([placed(machine, "hysteresis a level=5N·m")]) - predict()
    torque = np.abs(Drives.of(machine, plan).effort[:, machine.actuators.index("a")])
    assert torque[1] > 10.0
    law = joints(machine.description)["a"].law
    assert law is not None
    lag = 5.0 / law.stiffness
    np.testing.assert_allclose(np.abs(more[1, 3]), lag, rtol=1e-3)


def measured_ramps(
    folder: Path, twist: np.ndarray, torque: np.ndarray, noise: float, starts: int = 3
) -> Path:
    """A folder of ramps as a user writes it; `twist` (n,) in degrees, each ramp a set-up of its own."""
    folder.mkdir()
    (folder / "gear.yaml").write_text(ONE_JOINT)
    (folder / "experiment.yaml").write_text(
        "machine: gear.yaml\nquantity: position\nunits: {length: mm, force: N, angle: deg}\n"
        f"noise: {{rz: {noise}}}\nframe: offset_unknown\ncommand: {{q: {{actuator: box.gear, unit: deg}}}}\n"
    )
    each = np.array_split(np.arange(len(torque)), starts)
    rows = [f"r{k},{i},0,{1e3 * torque[i]:.6f},{twist[i]:.9f}" for k, part in enumerate(each) for i in part]
    (folder / "data.csv").write_text("\n".join(["setup,order,q,mz,rz", *rows]))
    return folder


@pytest.mark.parametrize(
    "truth",
    [
        PLAIN | {"level": 4.0, "half_width": 0.02, "seat": 1.0},
        PLAIN | {"level": 5.0},
        PLAIN,
    ],
)
def test_a_diagnosis_finds_what_a_gear_remembers(tmp_path: Path, truth: dict[str, float]) -> None:
    """Ramps of a gear whose twist was computed here, with noise of 0.02 degrees."""
    one = ramps(40.0, 20)
    rng = np.random.default_rng(4)
    twist = np.concatenate([deflection(one, 1e-3, truth) for _ in range(3)])
    twist = np.degrees(twist) + 0.02 * rng.standard_normal(len(twist))
    folder = measured_ramps(tmp_path / "ramps", twist, np.tile(one, 3), 0.02)
    d = sm.diagnose(str(folder / "gear.yaml"), folder)
    assert [e.kind for e in d.effects] == (["hysteresis"] if truth["level"] else [])
    assert "nan" not in str(d)
    if truth["level"]:
        value, low, high, _ = d.effects[0].parameters["level"]
        assert abs(value - truth["level"]) < 3 * (high - low) / 2 / 1.96
        assert d.after.size[0] < 1.3 * np.radians(0.02)
        assert d.after.size[1] == "rad"
        d.report(tmp_path / "report.html")
        assert "Reading over load" in (tmp_path / "report.html").read_text()


def test_which_way_a_load_was_reached() -> None:
    """On a ramp with noise each row knows its direction; loads that jump have none."""
    load = np.concatenate([np.arange(0, 40), np.arange(40, -40, -1), np.arange(-40, 0)]).astype(float)
    wrench = np.zeros((len(load), 6))
    wrench[:, 5] = load + 0.3 * np.sin(7.0 * np.arange(len(load)))
    one = np.zeros(len(load), dtype=np.intp)
    way = directions(wrench, np.arange(len(load)), one)
    assert way is not None
    wanted = np.sign(np.gradient(load))
    assert np.mean(way == wanted) > 0.95
    mixed = np.random.default_rng(0).permutation(len(load))
    assert directions(wrench[mixed], np.arange(len(load)), one) is None
    assert directions(np.zeros((5, 6)), np.arange(5), one[:5]) is None


def test_one_element_and_many_alike() -> None:
    force = np.cumsum(np.random.default_rng(0).standard_normal(500))
    for breakaway in (1.0, 1.6):
        np.testing.assert_array_equal(
            spring_force(force, 2.0, breakaway), spring_force(force, np.array([2.0, 2.0]), breakaway)[:, 1]
        )


@pytest.mark.parametrize("name", ["orthoglide-revised", "linear-delta", "ur10"])
def test_efforts_are_those_where_the_drives_are_commanded(name: str) -> None:
    """Solved at the poses, or with the drives held where these poses have them: the same machine."""
    machine = sm.load_machine(name)
    plan = random_plan(machine, poses=3, loads=3, seed=4)
    start = coordinates_of(machine, plan)
    drives = [machine.compiled.names.joints[a] for a in machine.actuators]
    held = machine.solve_joints(start[:, drives], plan.wrench, start=start)
    found = Drives.of(machine, plan)
    assert found.effort == pytest.approx(held.actuator_effort, rel=1e-9, abs=1e-9)
    soft = machine.with_effect("compliance", element=machine.actuators[0].rpartition(".")[2], scale=2.0)
    assert Drives.of(soft, plan).jacobian is found.jacobian  # of the rigid machine, found out once


def test_the_way_of_a_load_is_that_of_the_component_that_varies_most() -> None:
    """Up, down with noise, up; beside it a component at rest and one that varies less, the other way."""
    up = np.linspace(0.0, 100.0, 11)
    load = np.concatenate([up, up[-2::-1], up[1:]])
    wrench = np.zeros((len(load), 6))
    wrench[:, 2] = load + 0.5 * (-1.0) ** np.arange(len(load))
    wrench[:, 0], wrench[:, 1] = 300.0, -0.1 * load
    found = directions(wrench, np.arange(len(load)), np.zeros(len(load), dtype=np.intp))
    assert found is not None
    assert found.tolist() == [0, *[1] * 10, *[-1] * 10, *[1] * 10]
    assert directions(wrench[:, [0, 3, 4, 5, 3, 4]], np.arange(31), np.zeros(31, dtype=np.intp)) is None
