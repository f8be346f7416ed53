"""Compensated commands against the machine itself, exported geometry against transforms written out here."""

from __future__ import annotations

import json
import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import stiffmap as sm
from stiffmap.experiment import Predictor, random_plan, save_experiment
from stiffmap.machining.compensation import (
    axis_errors,
    check_compensation,
    compensate,
    write_dh,
)
from stiffmap.machining.compensation.geometry import corrected_geometry, dh_list
from stiffmap.ui.cli.app import main

MACHINES = (
    *("orthoglide-revised", "tripteron", "hexapod", "linear-delta", "rotary-delta"),
    *("ur10", "five-bar", "swing-table", "hybrid", "3-rps"),
)
LOAD = np.array([60.0, -40.0, -150.0, 0.0, 0.0, 0.0])


def with_error(name: str) -> sm.Machine:
    machine = sm.load_machine(name)
    first = machine.actuators[0]
    leg, _, element = first.rpartition(".")
    size = 2e-4 if machine.compiled.names.is_prismatic(first) else 1e-3
    return machine.with_effect("zero_offset", element=element, legs=[leg] if leg else None, error=size)


def middle(machine: sm.Machine) -> np.ndarray:
    low, high = machine.workspace
    out = low + (high - low) * np.array([[0.3, 0.6, 0.4], [0.7, 0.4, 0.6]])
    still = [axis not in machine.description.task for axis in "xyz"]
    out[:, still] = machine.description.home.p[still]  # what is not commanded stays at home
    return out


@pytest.mark.parametrize("name", MACHINES)
def test_the_loaded_machine_stands_where_it_is_wanted(name: str) -> None:
    machine = with_error(name)
    found = compensate(machine, middle(machine), wrench=LOAD)
    assert found.ok.all()
    k = len([c for c in found.components if c in "xyz"])
    real = machine.solve_joints(found.actuators, LOAD, stiffness=False)
    at = sm.forward_kinematics(machine, found.actuators).position + real.displacement[:, :3]
    rows = ["xyz".index(c) for c in found.components if c in "xyz"]
    assert k
    wanted = sm.forward_kinematics(machine, found.declared).position
    np.testing.assert_allclose(at[:, rows], wanted[:, rows], atol=1e-9)
    assert np.abs(found.before[:, rows]).max() > 1e-5


@pytest.mark.parametrize("also", [False, True])
def test_a_pose_without_an_equilibrium_has_no_command(also: bool, tmp_path: Path) -> None:
    """Alone as among others: out of reach, and under a load that it does not bear."""
    machine = sm.load_machine("orthoglide-revised")
    fine, heavy = [0.05, 0.05, 0.05], [1e7, 0, 0, 0, 0, 0]
    for bad, load in (([9.0, 0, 0], LOAD), (fine, heavy), ([np.nan, 0, 0], LOAD)):
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", "1 of . positions are not finite", UserWarning)
            found = compensate(machine, [bad, fine][: 1 + also], wrench=[load, LOAD][: 1 + also])
        assert found.ok.tolist() == [False, True][: 1 + also]
        for values in (found.actuators, found.position, found.after):
            assert np.isnan(values[0]).all()
        found.write(tmp_path / "commands.csv")
        rows = [line.split(",") for line in (tmp_path / "commands.csv").read_text().splitlines()]
        answers = [i for i, name in enumerate(rows[0]) if name.startswith(("command_", "pose_", "after_"))]
        assert len(answers) == 12 and {rows[1][i] for i in answers} == {""}
        assert np.isfinite(found.rms(found.after)) == also


def test_a_redundant_configuration_stays_in_its_branch() -> None:
    machine = with_error("ur10")
    elbow_down = np.array([[0.4, -0.3, -1.7, 0.5, 1.2, 0.3]])
    found = compensate(machine, actuators=elbow_down)
    assert np.abs(found.actuators - elbow_down).max() < 2e-3
    np.testing.assert_allclose(found.actuators[0, 0] - elbow_down[0, 0], -1e-3, atol=1e-9)


@pytest.mark.parametrize("approach", [[0, 0, 0], [[1, 0, 0], [0, 0, 0]], [0, np.nan, 1]])
def test_an_approach_has_a_direction(approach: list[float]) -> None:
    with pytest.raises(sm.StiffmapError, match=r"approach: expected directions with a length, got .0.0"):
        compensate(sm.load_machine("orthoglide-revised"), np.zeros((2, 3)), approach=approach)


def test_play_is_taken_up_on_the_side_of_the_approach() -> None:
    machine = sm.load_machine("orthoglide-revised").with_effect(
        "dead_zone", element="actuator", legs=["x"], half_width=2e-5
    )
    ahead, back = (compensate(machine, [[0.0, 0.0, 0.0]], approach=[s, 0, 0]) for s in (1.0, -1.0))
    gap = (ahead.actuators - back.actuators)[0]
    np.testing.assert_allclose(np.abs(gap), [4e-5, 0, 0], atol=1e-8)


def test_out_of_reach_is_nan_beside_good_rows() -> None:
    machine = with_error("rotary-delta")
    found = compensate(machine, np.vstack([middle(machine)[0], [9.0, 9.0, 9.0]]))
    assert found.ok.tolist() == [True, False]
    assert np.isnan(found.actuators[1]).all()

    home = machine.description.home
    found = compensate(machine, [home.p, home.p], np.stack([home.r, np.full((3, 3), np.nan)]))
    assert found.ok.tolist() == [True, False]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"position": None}, "either position or actuators"),
        ({"components": ("q",)}, "got 'q'"),
        ({"components": ()}, "components: expected one or more of x, y, z, rx, ry, rz, got none"),
        ({"rotation": np.ones((3, 3))}, r"rotation: expected rotation matrices, got one with"),
        ({"point": "foo"}, "point: expected one of tcp"),
        ({"threads": 0}, "threads: expected 1 or more, got 0"),
    ],
    ids=str,
)
def test_bad_input(arguments: dict[str, object], message: str) -> None:
    with pytest.raises(sm.StiffmapError, match=message):
        compensate(sm.load_machine("ur10"), **{"position": [0, 0, 0], **arguments})


def test_a_machine_with_three_legs_has_no_denavit_and_hartenberg_list() -> None:
    with pytest.raises(sm.StiffmapError, match="3 legs"):
        dh_list(sm.load_machine("linear-delta").description)


def errors_of_an_arm() -> sm.Machine:
    """Errors of geometry only, as rotations and shifts of the links."""
    from dataclasses import replace

    from stiffmap.model.description import Offset, Pose

    d = sm.load_machine("ur10").description
    rng = np.random.default_rng(2)

    def bent(e: object) -> object:
        if not isinstance(e, Offset):
            return e
        turn = Rotation.from_rotvec(rng.normal(0, 2e-3, 3)).as_matrix()
        return replace(e, actual=Pose.of(e.nominal.p + rng.normal(0, 3e-4, 3), e.nominal.r @ turn))

    legs = tuple(replace(leg, elements=tuple(map(bent, leg.elements))) for leg in d.legs)  # type: ignore[arg-type]
    return sm.Machine(replace(d, legs=legs))


def test_rows_of_denavit_and_hartenberg_lead_to_the_tool() -> None:
    machine = errors_of_an_arm()
    corrected, _ = corrected_geometry(machine.description)
    (p, r), rows, (tool_p, tool_r) = dh_list(corrected)
    q = np.array([0.3, -1.1, 1.2, -0.7, 0.9, 0.2])
    real = machine.solve_joints(q, stiffness=False)
    wanted = sm.forward_kinematics(machine, q).position + real.displacement[:3]

    def step(axis: str, angle: float) -> np.ndarray:
        return Rotation.from_euler(axis, angle).as_matrix()

    for row, angle in zip(rows, q, strict=True):
        p, r = p + row.d * r[:, 2], r @ step("z", angle + row.theta)
        p, r = p + row.a * r[:, 0], r @ step("x", row.alpha)
        r = r @ step("y", row.beta or 0.0)
    np.testing.assert_allclose(p + r @ tool_p, wanted, atol=1e-9)
    assert max(abs(row.d) for row in rows) < 1.0  # almost parallel axes do not run away
    assert np.linalg.det(tool_r) == pytest.approx(1.0)


def test_the_command_line_writes_commands(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "poses.csv").write_text("x,y,z\n0,0,0\n50,20,-30\n")
    out = tmp_path / "commands.csv"
    arguments = ["compensate", "orthoglide-revised", str(tmp_path / "poses.csv"), "-o", str(out)]
    assert main([*arguments, "--effect", "length bar x error=0.1mm", "--force", "0,0,-300"]) == 0
    assert "rows without an answer: none" in capsys.readouterr().out
    assert out.read_text().startswith("wanted_x_mm")
    machine = sm.load_machine("orthoglide-revised").with_effect(
        "length", element="bar", legs=["x"], error=1e-4
    )
    found = sm.compensate(machine, tmp_path / "poses.csv", wrench=[0, 0, -300, 0, 0, 0])
    found.write(tmp_path / "own.csv")
    assert (tmp_path / "own.csv").read_text() == out.read_text()
    assert found.ids == ("1", "2")
    table = axis_errors(machine, "x", points=5, zero=0.0)
    assert len(table.position) == 5
    assert np.interp(0.0, table.position, table.positioning[0]) == pytest.approx(0, abs=1e-12)
    assert write_dh("ur10", tmp_path / "dh.csv")
    assert "\nshoulder,180,0,612,0,0\n" in (tmp_path / "dh.csv").read_text()  # no dust of round-off
    assert main(["import", str(tmp_path / "dh.csv"), "-o", str(tmp_path / "arm.yaml")]) == 0
    assert main(["compensate", "linear-delta", "--dh", str(tmp_path / "a.csv")]) == 2
    assert "serial arm" in capsys.readouterr().err
    assert main(["compensate", "linear-delta", "--check", str(tmp_path / "nothing")]) == 2
    assert main(["compensate", "linear-delta"]) == 2
    assert "wanted poses" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("head", "form"),
    [
        ("X,Y,Z,A,B,C", lambda r: r.as_euler("ZYX", degrees=True)),
        ("x [mm],y [mm],z [mm],W [deg],P [deg],R [deg]", lambda r: r.as_euler("xyz", degrees=True)),
        ("x,y,z,qx,qy,qz,qw", lambda r: r.as_quat()),
    ],
)
def test_orientations_of_a_table_are_those_of_every_table_of_poses(
    head: str, form: Callable[[Rotation], np.ndarray], tmp_path: Path
) -> None:
    """The home of this arm is turned by half a turn against its base."""
    machine = sm.load_machine("ur10").with_effect("zero_offset", element="elbow", error=1e-3)
    home, turn = machine.description.home, Rotation.from_rotvec([0.1, 0.05, -0.02])
    wanted = turn * Rotation.from_matrix(home.r)
    rows = {
        head: form(wanted),
        "id,x,y,z,rotx,roty,rotz,approach_x,order": [*turn.as_rotvec(), 1.0, 3.0],
    }
    for name, (top, numbers) in zip(("its.csv", "own.csv"), rows.items(), strict=True):
        cells = [*("a",) * top.startswith("id"), *1e3 * np.array(home.p), *numbers]
        (tmp_path / name).write_text(f"{top}\n{','.join(map(str, cells))}\n")
    its, own = (sm.compensate(machine, tmp_path / name) for name in ("its.csv", "own.csv"))
    by_array = sm.compensate(machine, home.p, wanted.as_matrix())
    assert own.ids == ("a",)
    assert its.turns.startswith("against the base") and own.turns.startswith("from home")
    for found in (its, own):
        assert found.actuators == pytest.approx(by_array.actuators, abs=1e-9)


def test_what_compensation_leaves_of_held_out_readings(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A drive's zero that is known goes, the one that nobody knows stays."""
    machine = sm.load_machine("orthoglide-revised")
    plan = random_plan(machine, "position", poses=8, repeats=1, seed=2)
    both = machine.with_effect("zero_offset", element="actuator", legs=["x"], error=1e-4)
    real = both.with_effect("zero_offset", element="actuator", legs=["z"], error=2e-5)
    data = plan.with_readings(Predictor(real, plan)())
    save_experiment(data, tmp_path / "held_out")
    argument = ["compensate", "orthoglide-revised", "--check", str(tmp_path / "held_out"), "--json"]
    assert main([*argument, "--effect", "zero_offset actuator x error=0.1mm"]) == 0
    said = json.loads(capsys.readouterr().out)
    hidden = Predictor(real, plan)() - Predictor(both, plan)()
    expected = 1e3 * np.sqrt(np.nanmean(hidden[:, :3] ** 2))
    assert said["rms left by compensation, mm"] == pytest.approx(expected, rel=1e-3)
    assert said["rms as measured, mm"] > 4 * expected
    assert said["verdict"] == "better"
    assert main([*argument, "--effect", "zero_offset actuator x error=-0.1mm"]) == 1  # the wrong way
    said = json.loads(capsys.readouterr().out)
    assert said["verdict"].startswith("worse")
    assert said["rms left by compensation, mm"] > 1.9 * said["rms as measured, mm"]
    assert not check_compensation(both, tmp_path / "held_out").worse
    before, after = check_compensation(both, data).whole
    assert (before.n, after.rms * 1e3) == (24, pytest.approx(expected, rel=1e-3))


def test_the_whole_loop_from_the_command_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """docs/planning.md: readings, diagnosis, corrected machine, compensated commands, error after."""
    truth = "length bar x error=0.1mm"
    readings, held_out, result = (str(tmp_path / n) for n in ("readings", "held_out", "result"))
    twin = ["simulate", "orthoglide-revised", "--quantity", "position", "--poses", "30", "--effect", truth]
    assert main([*twin, "-o", readings]) == 0
    assert main([*twin, "--seed", "7", "-o", held_out]) == 0
    assert main(["diagnose", "orthoglide-revised", readings, "-o", result]) == 1  # effects were found
    (tmp_path / "poses.csv").write_text("x,y,z\n50,0,20\n-80,60,0\n")
    capsys.readouterr()
    commands = ["compensate", f"{result}/machine.yaml", str(tmp_path / "poses.csv"), "--check", held_out]
    assert main([*commands, "-o", str(tmp_path / "commands.csv"), "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    sigma = 1e3 * np.nanmean(sm.load_experiment(held_out).sigma)
    assert said["rms left by compensation, mm"] < 1.1 * sigma < 0.3 * said["rms as measured, mm"]

    table = np.genfromtxt(tmp_path / "commands.csv", delimiter=",", names=True)
    commanded = np.column_stack([table[f"pose_{a}_mm"] for a in "xyz"]) / 1e3
    real = sm.load_machine("orthoglide-revised").with_effect("length", element="bar", legs=["x"], error=1e-4)
    wanted = np.array([[0.05, 0.0, 0.02], [-0.08, 0.06, 0.0]])
    error = commanded + real.solve(commanded).displacement[:, :3] - wanted
    assert np.abs(error).max() < 5e-6 < 0.1 * np.abs(real.solve(wanted).displacement[:, :3]).max()


@pytest.mark.parametrize(("rows", "lost"), [("9000,0,0", "1"), ("0,0,0\n9000,0,0\n9100,0,0", "2, 3")])
def test_a_row_without_an_answer_is_a_finding(
    rows: str, lost: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "poses.csv").write_text(f"x,y,z\n{rows}\n")
    assert main(["compensate", "orthoglide-revised", str(tmp_path / "poses.csv")]) == 1
    assert f"rows without an answer: {lost}\n" in capsys.readouterr().out
