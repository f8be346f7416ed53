"""Instruments and targets whose places nobody knows, surfaces that are touched, gravity per set-up."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import stiffmap as sm
from stiffmap.experiment import Predictor, load_experiment, random_plan, residual
from stiffmap.experiment.poses.commanded import resolved
from stiffmap.identification.numbers import Tolerances
from stiffmap.model.description import AppliedEffect
from stiffmap.model.effects import apply_records
from stiffmap.ui.cli.app import main

COUNT = 40


@pytest.fixture(scope="module")
def arm() -> sm.Machine:
    return sm.load_machine("ur10")


def commands(number: int = COUNT) -> np.ndarray:
    rng = np.random.default_rng(3)
    return np.array([0.2, -1.0, 1.4, -1.8, -1.4, 0.3]) + rng.uniform(-0.5, 0.5, (number, 6))


def frame(seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Any rotation at all, and a shift of metres."""
    rng = np.random.default_rng(seed)
    return Rotation.random(random_state=seed).as_matrix(), rng.uniform(-3, 3, 3)


def write(place: Path, machine: sm.Machine, q: np.ndarray, columns: dict[str, np.ndarray], head: str) -> Path:
    place.mkdir(exist_ok=True)
    names = [f"q{i}" for i in range(1, len(machine.actuators) + 1)]
    kinds = {a: machine.compiled.names.is_prismatic(a) for a in machine.actuators}
    told = "".join(
        f"  {n}: {{actuator: {a}, unit: {'m' if kinds[a] else 'rad'}}}\n"
        for n, a in zip(names, machine.actuators, strict=True)
    )
    (place / "experiment.yaml").write_text(
        f"machine: {machine.name}\nquantity: position\n{head}command:\n{told}"
    )
    table = {n: q[:, i] for i, n in enumerate(names)} | columns
    lines = [",".join(table), *(",".join(str(v) for v in row) for row in zip(*table.values(), strict=True))]
    (place / "data.csv").write_text("\n".join(lines) + "\n")
    return place


HEAD = "units: {length: m, angle: rad}\nnoise: {dx: 1e-5, dy: 1e-5, dz: 1e-5, rx: 1e-5, ry: 1e-5, rz: 1e-5}\n"


def sighted(machine: sm.Machine, q: np.ndarray, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """A target (0.03, -0.05, 0.12) m off the flange and turned, seen from somewhere."""
    at = sm.forward_kinematics(machine, q)
    y, y0 = frame(seed)
    x, x0 = Rotation.from_rotvec([0.9, -2.0, 0.4]).as_matrix(), np.array([0.03, -0.05, 0.12])
    p = at.position + np.einsum("nij,j->ni", at.rotation, x0)
    return p @ y.T + y0, y @ at.rotation @ x


@pytest.mark.parametrize("turned", [True, False])
def test_frame_and_target_are_found_without_a_guess(arm: sm.Machine, tmp_path: Path, turned: bool) -> None:
    q = commands()
    p, m = sighted(arm, q, 5)
    columns = {f"p{a}": p[:, i] for i, a in enumerate("xyz")}
    if turned:
        columns |= {f"pr{a}": Rotation.from_matrix(m).as_rotvec()[:, i] for i, a in enumerate("xyz")}
    tool = "unknown" if turned else "offset_unknown"
    e = load_experiment(write(tmp_path, arm, q, columns, f"{HEAD}frame: unknown\ntool: {tool}\n"))
    found = Predictor(arm, e).experiment
    np.testing.assert_allclose(found.reading[:, :3], 0.0, atol=1e-9)
    named = {name: (r, t) for name, r, t in found.registration}
    np.testing.assert_allclose(named["target 1"][1], [0.03, -0.05, 0.12], atol=1e-8)
    np.testing.assert_allclose(named["instrument 1"][0], frame(5)[0], atol=1e-8)


def test_wild_sightings_do_not_move_the_frames(arm: sm.Machine, tmp_path: Path) -> None:
    q = commands()
    p, m = sighted(arm, q, 6)
    p[4] += 0.005
    columns = {f"p{a}": p[:, i] for i, a in enumerate("xyz")}
    columns |= {f"pr{a}": Rotation.from_matrix(m).as_rotvec()[:, i] for i, a in enumerate("xyz")}
    e = load_experiment(write(tmp_path, arm, q, columns, f"{HEAD}frame: unknown\ntool: unknown\n"))
    error = np.linalg.norm(Predictor(arm, e).experiment.reading[:, :3], axis=1)
    assert error[4] > 0.008
    assert np.delete(error, 4).max() < 1e-4


def test_two_setups_have_a_frame_each_and_share_a_target(arm: sm.Machine, tmp_path: Path) -> None:
    q = commands()
    half = len(q) // 2
    a, b = sighted(arm, q[:half], 7)[0], sighted(arm, q[half:], 8)[0]
    columns = {f"p{c}": np.append(a[:, i], b[:, i]) for i, c in enumerate("xyz")}
    columns |= {"setup": np.repeat(["A", "B"], half), "target": np.repeat(["T"], len(q))}
    e = load_experiment(write(tmp_path, arm, q, columns, f"{HEAD}frame: unknown\ntool: offset_unknown\n"))
    found = Predictor(arm, e)
    assert [name for name, _, _ in found.experiment.registration] == [
        "instrument A",
        "instrument B",
        "target T",
    ]
    np.testing.assert_allclose(found.experiment.reading[:, :3], 0.0, atol=1e-8)
    assert "platform.seen_target_1" in found.machine.points


@pytest.mark.parametrize("turned", [True, False])
def test_frames_are_those_of_where_the_machine_stands(arm: sm.Machine, tmp_path: Path, turned: bool) -> None:
    """Drives off by 1 to 3 degrees: frames of best fit at the commands are turned so far that no straight line leads back."""
    q, error = commands(), np.array([0.0, -0.04, 0.05, -0.03, 0.02, 0.0])
    p, m = sighted(arm, q + error, 9)
    columns = {f"p{a}": p[:, i] for i, a in enumerate("xyz")}
    if turned:
        columns |= {f"pr{a}": Rotation.from_matrix(m).as_rotvec()[:, i] for i, a in enumerate("xyz")}
    tool = "unknown" if turned else "offset_unknown"
    e = load_experiment(write(tmp_path, arm, q, columns, f"{HEAD}frame: unknown\ntool: {tool}\n"))
    drives = zip(("base", "shoulder", "elbow", "wrist_1", "wrist_2"), error, strict=False)
    zeros = tuple(AppliedEffect("zero_offset", name, ("arm",), (("error", by),)) for name, by in drives)
    true = sm.Machine(apply_records(arm.description, zeros))
    assert residual(true, e).summary.rms < 1e-8
    found = {name: shift for name, _, shift in Predictor(true, e).experiment.registration}
    np.testing.assert_allclose(found["target 1"], [0.03, -0.05, 0.12], atol=1e-8)
    c = sm.calibrate(arm, e, tolerances=Tolerances(turning_zero=0.03))
    assert c.after.rms < 4e-6 and residual(c.machine, e).summary.rms < 4e-6


def test_an_elbow_off_its_zero_is_seen_through_unknown_frames(arm: sm.Machine, tmp_path: Path) -> None:
    q = commands()
    off = q + 2e-3 * np.eye(6)[2]
    p, m = sighted(arm, off, 9)
    columns = {f"p{a}": p[:, i] for i, a in enumerate("xyz")}
    columns |= {f"pr{a}": Rotation.from_matrix(m).as_rotvec()[:, i] for i, a in enumerate("xyz")}
    e = load_experiment(write(tmp_path, arm, q, columns, f"{HEAD}frame: unknown\ntool: unknown\n"))
    assert residual(arm, e).summary.rms > 1e-4
    term = AppliedEffect("zero_offset", "elbow", ("arm",), (("error", 2e-3),))
    assert residual(arm, e, [term]).summary.rms < 5e-6


def test_touching_an_unknown_plane_reads_the_command_itself(tmp_path: Path) -> None:
    machine = sm.load_machine("linear-delta")
    plan = random_plan(machine, "position", poses=30, repeats=1)
    level = plan.position.copy()
    level[:, 2] = 0.02 + 0.003 * level[:, 0] - 0.002 * level[:, 1] + machine.workspace[0, 2]
    q = sm.inverse_kinematics(machine, level).actuators
    head = "units: {length: m}\nnoise: {hh: 1e-5}\nsurface: {shape: unknown}\n"
    e = load_experiment(write(tmp_path, machine, q, {"contact": np.zeros(len(q))}, head))
    assert residual(machine, e).summary.rms < 1e-9
    # A zero that is off lifts the tool as the rigid geometry says; the plane cannot take all of it.
    term = AppliedEffect(
        "zero_offset", machine.actuators[0].split(".")[1], (machine.legs[0],), (("error", 1e-4),)
    )
    lifted = Predictor(machine, e)([term])[:, 6]
    moved = q + 1e-4 * np.eye(len(machine.actuators))[0]
    rise = sm.forward_kinematics(machine, moved).position[:, 2] - level[:, 2]
    np.testing.assert_allclose(lifted, rise, atol=1e-8)


def test_distances_beside_heights(tmp_path: Path) -> None:
    machine = sm.load_machine("linear-delta")
    plan = random_plan(machine, "position", poses=8, repeats=1)
    q = sm.inverse_kinematics(machine, plan.position).actuators
    apart = np.linalg.norm(plan.position[4:] - plan.position[:4], axis=1)
    columns = {
        "contact": np.array([*("0",) * 4, *("",) * 4]),
        "distance": np.array([*("",) * 4, *map(str, apart)]),
    }
    columns |= {f"q{i + 1}2": np.array([*("",) * 4, *map(str, q[:4, i])]) for i in range(3)}
    head = "units: {length: m}\nnoise: {hh: 1e-5, dd: 1e-5}\nsurface: {shape: unknown}\n"
    e = load_experiment(write(tmp_path, machine, q, columns, head))
    found = Predictor(machine, e).experiment
    at = [c.name for c in found.channels]
    np.testing.assert_allclose(found.reading[4:, at.index("dd")], 0.0, atol=1e-9)
    np.testing.assert_allclose(found.reading[:4, at.index("hh")], -plan.position[:4, 2], atol=1e-9)


def test_angles_only_are_told_without_lengths(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "experiment.yaml").write_text(
        "machine: swing-table\nquantity: deflection\nunits: {length: mm, force: N, angle: deg}\n"
        "noise: {rx: 0.001, ry: 0.001}\n"
    )
    machine = sm.load_machine("swing-table")
    p = machine.workspace.mean(axis=0) * 1e3
    rows = "".join(f"{p[0]},{p[1]},{p[2]},{f},0,{-f},0.0,0.0\n" for f in (10, 20, 30, 40))
    (tmp_path / "data.csv").write_text("x,y,z,fx,fy,fz,rx,ry\n" + rows)
    assert main(["residual", "swing-table", str(tmp_path)]) in (0, 1)
    told = capsys.readouterr().out
    assert "nan" not in told
    assert "all angles" in told


def test_gravity_turns_with_the_setup(tmp_path: Path, arm: sm.Machine) -> None:
    q = commands(2)[[0, 0]]
    columns = {"dx": np.zeros(2), "dy": np.zeros(2), "dz": np.zeros(2), "setup": np.array(["floor", "wall"])}
    head = f"{HEAD}gravity: {{floor: [0, 0, -9.81], wall: [0, 9.81, 0]}}\n"
    e = load_experiment(write(tmp_path, arm, q, columns, head))
    got = Predictor(arm, e)()
    for row, g in zip(got, ([0, 0, -9.81], [0, 9.81, 0]), strict=True):
        alone = arm.solve_joints(q[0], gravity=g, stiffness=False).displacement
        np.testing.assert_allclose(row, alone, atol=1e-12)


def test_bad_files_say_what_is_wrong(arm: sm.Machine, tmp_path: Path) -> None:
    q = commands(4)
    seen = {f"p{a}": np.zeros(4) for a in "xyz"}
    with pytest.raises(sm.StiffmapError, match=r"column 'dx': .*same reading"):
        load_experiment(write(tmp_path, arm, q, {**seen, "dx": np.zeros(4)}, HEAD))
    head = f"{HEAD}gravity: {{A: [0, 0, -9.81]}}\n"
    with pytest.raises(sm.StiffmapError, match="no gravity for set-up 'B'"):
        load_experiment(write(tmp_path, arm, q, {**seen, "setup": np.array(["A", "A", "B", "A"])}, head))
    with pytest.raises(sm.StiffmapError, match="second pose needs the columns q12"):
        load_experiment(write(tmp_path, arm, q, {"distance": np.ones(4)}, HEAD))
    e = load_experiment(
        write(tmp_path, arm, q[:2], {k: v[:2] for k, v in seen.items()}, f"{HEAD}frame: unknown\n")
    )
    with pytest.raises(sm.StiffmapError, match="2 positions are too few"):
        Predictor(arm, e)
    assert resolved(arm, replace(e, seen=None))[1].registration == ()
