"""Motions as files, the efforts command, and motions through singularities."""

from __future__ import annotations

import json
from collections.abc import Callable

import numpy as np
import pytest

import stiffmap as sm
from stiffmap.ui.cli import main
from stiffmap.ui.plot.forces import efforts_figure
from stiffmap.workspace.performance import circle, drive_efforts, line, load_motion, timed
from stiffmap.workspace.performance.motion.trajectory import Path, Trajectory, at_feed, through

CUT = """
name: cut
line: {start: [-100 mm, 0 mm, 0 mm], end: [200 mm, 100 mm, -100 mm]}
samples: 101
speed: 60 m/min
force: [100 N, 0 N, 0 N]
"""
ROWS = "t [s],x [mm],y [cm],z [m],fx [kN]\n" + "".join(
    f"{0.1 * i},{5 * i},{i * i / 10},{i**3 / 1e4},0.1\n" for i in range(9)
)


def write(folder, text, name="cut.yaml"):
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def test_a_described_line_runs_as_fast_as_it_may(tmp_path):
    machine = sm.load_machine("orthoglide-revised")
    t = load_motion(write(tmp_path, CUT)).trajectory(machine)
    speed = np.linalg.norm(t.velocity, axis=1)
    assert speed.max() == pytest.approx(1.0, rel=1e-9) and speed[0] == speed[-1] == 0
    np.testing.assert_allclose(t.position[[0, -1]], [[-0.1, 0, 0], [0.2, 0.1, -0.1]], atol=1e-15)
    np.testing.assert_allclose(t.force, np.broadcast_to([100.0, 0, 0], t.force.shape))
    d = drive_efforts(machine, t)
    assert (d.effort_margin > 0).all() and (d.speed_margin > 0).all()
    slow = load_motion(write(tmp_path, CUT)).trajectory(machine, duration=2.0)
    assert slow.time[-1] == 2.0


@pytest.mark.parametrize("name", ["t [s]", "time [s]", "Time (s)", "time_s"])
def test_a_table_over_time_has_the_derivatives_of_its_motion(name, tmp_path):
    """A cubic in time is in the spline exactly."""
    rows = write(tmp_path, ROWS.replace("t [s]", name), "rows.csv")
    t = load_motion(rows).trajectory(sm.load_machine("orthoglide-revised"))
    i = t.time / 0.1
    np.testing.assert_allclose(t.position, np.stack([5e-3 * i, 1e-3 * i**2, 1e-4 * i**3], axis=1), atol=1e-15)
    np.testing.assert_allclose(
        t.velocity, np.stack([0.05 + 0 * i, 0.02 * i, 3e-3 * i**2], axis=1), atol=1e-12
    )
    np.testing.assert_allclose(t.acceleration[:, 2], 6e-2 * i, atol=1e-10)
    np.testing.assert_allclose(t.force[:, 0], 100.0)


def test_a_table_without_times_is_a_path_through_its_points(tmp_path):
    text = "x [mm],y [mm],z [mm]\n0,0,0\n50,20,0\n100,0,30\n"
    motion = load_motion(write(tmp_path, text, "points.csv"))
    assert motion.timed is None and motion.path is not None
    for p in ([0, 0, 0], [0.05, 0.02, 0], [0.1, 0, 0.03]):
        assert np.linalg.norm(motion.path.position - p, axis=1).min() < 1e-3


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("60 m/min", "60", r"line 5: speed: the unit is missing"),
        ("-100 mm,", "-100,", r"line 3: line.start\[0\]: the unit is missing"),
        ("speed: 60 m/min", "speed: 60 m/min\nduration: 1 s", "duration or speed, not both"),
        ("line:", "lime:", r"unknown key 'lime' \(did you mean 'line'\?\)"),
        ("end: [200 mm, 100 mm, -100 mm]", "end: [-100 mm, 0 mm, 0 mm]", "two different points"),
        ("speed: 60 m/min", "speed: -1 m/min", "positive speed"),
        ("samples: 101", "points: [[0 mm, 0 mm, 0 mm]]", "found line and points"),
    ],
)
def test_bad_motion_files_name_the_key(tmp_path, old, new, words):
    with pytest.raises(sm.StiffmapError, match=words):
        load_motion(write(tmp_path, CUT.replace(old, new)))


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("x [mm]", "x", r"line 1: x: the unit is missing: write x \[mm\]"),
        ("x [mm]", "x [kg]", "line 1: .*: expected a unit such as"),
        ("x [mm]", "w [mm]", r"unknown column 'w .*known: x \[mm\]"),
        ("y [cm]", "x [cm]", "twice"),
        ("0.2,10", "0.05,10", r"line 4: t .*: times must increase; 0.05 s follows 0.1 s"),
        ("0.2,10", "0.2,ten", r"line 4: column 'x .*': expected a number; found 'ten'"),
        ("0.2,10", "0.2,nan", "expected a finite number"),
        ("z [m]", "fz [N]", "no column z"),
        (ROWS, "x [mm],y [mm],z [mm],A,B,C\n0,0,0,0,0,0\n1,0,0,0,0,0\n", "line 1: expected no orientations"),
    ],
)
def test_bad_tables_name_the_line(tmp_path, old, new, words):
    assert old in ROWS
    with pytest.raises(sm.StiffmapError, match=words):
        load_motion(write(tmp_path, ROWS.replace(old, new), "rows.csv"))


def test_a_feed_is_in_place_of_the_duration_of_the_file(tmp_path):
    """100 mm at 100 mm/s take a second, whatever the file says."""
    machine = sm.load_machine("orthoglide-revised")
    text = "name: cut\nline: {start: [0 mm, 0 mm, 0 mm], end: [100 mm, 0 mm, 0 mm]}\nduration: 2 s\n"
    motion = load_motion(write(tmp_path, text))
    assert motion.trajectory(machine).time[-1] == pytest.approx(2)
    assert motion.trajectory(machine, feed=0.1).time[-1] == pytest.approx(1, rel=1e-3)
    with pytest.raises(sm.StiffmapError, match="a duration or a feed, not both"):
        motion.trajectory(machine, feed=0.1, duration=1.0)


@pytest.mark.parametrize(("name", "value"), [("mz [N*m]", 5), ("rx [deg]", 0.5)])
def test_moments_and_turns_in_a_table_are_not_dropped(tmp_path, name, value):
    """They were read and counted as zero."""
    text = f"x [mm],y [mm],z [mm],{name}\n0,0,0,0\n50,0,0,0\n100,0,0,{{}}\n"
    assert load_motion(write(tmp_path, text.format(0), "still.csv")).path is not None
    with pytest.raises(sm.StiffmapError, match=rf"line 4: {name[:2]} .*expected 0.*found {value}"):
        load_motion(write(tmp_path, text.format(value), "turned.csv"))


@pytest.mark.parametrize("samples", [21, 101, 401])
def test_a_parallel_singularity_is_found_where_the_closed_form_has_it(samples):
    """The five-bar on its axis: the two forearms (374 mm) in one line, elbows 300 mm from the motors at ±150 mm."""
    y = np.sqrt(0.3**2 - (0.374 - 0.15) ** 2)
    t = timed(line([0, 0.45, 0], [0, -0.3, 0], samples), 1.0)
    with pytest.raises(
        sm.StiffmapError, match=rf"passes a singularity at \(.*, {1e3 * y:.1f}, 0.0\) mm, t = 0\.42\d"
    ):
        drive_efforts(sm.load_machine("five-bar"), t)


@pytest.mark.parametrize("samples", [101, 401])
def test_a_serial_singularity_is_not_stepped_over(samples):
    t = timed(line([-0.7, 0.3, 0.3], [0.7, 0.3, 0.3], samples), 1.0)
    with pytest.raises(sm.StiffmapError, match=r"singularity at \(396\..*\) mm, t = 0\.6"):
        drive_efforts(sm.load_machine("ur10"), t)


def test_reach_is_found_between_the_samples():
    found = []
    for samples in (21, 201):
        with pytest.raises(sm.StiffmapError, match="leaves the reach") as error:
            drive_efforts(
                sm.load_machine("orthoglide-revised"), timed(line([0, 0, 0], [0.9, 0, 0], samples), 1.0)
            )
        found.append(float(str(error.value).split("(")[1].split(",")[0]))
    assert found[0] == pytest.approx(found[1], abs=0.2)


def test_no_false_alarm_on_a_circle():
    t = timed(circle([0.05, 0.05, 0.05], 0.1), 1.0)
    assert drive_efforts(sm.load_machine("orthoglide-revised"), t).peak_effort.max() > 0


def test_the_command_prints_writes_and_judges(tmp_path, capsys):
    file = str(write(tmp_path, CUT))
    assert main(["efforts", "orthoglide-revised", file, "-o", str(tmp_path), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["drives"] == ["x.actuator", "y.actuator", "z.actuator"]
    assert 0 < found["peak_effort"][0] < 2000 and (tmp_path / "efforts.png").stat().st_size > 10_000
    assert main(["efforts", "orthoglide-revised", file, "--duration", "0.1"]) == 1
    rows = [r.rstrip() for r in capsys.readouterr().out.splitlines() if "actuator" in r]
    assert rows[0].endswith("over") and max(map(len, rows)) <= 80
    assert main(["efforts", "tripteron", file, "--duration", "1"]) == 2
    assert "needs masses" in capsys.readouterr().err


def test_the_picture_has_all_drives_and_their_limits():
    d = drive_efforts(sm.load_machine("hexapod"), timed(line([0, 0, 0.68], [0.05, 0, 0.7], 21), 0.5))
    panels = efforts_figure(d).axes
    assert len(panels) == 3 and all(len(a.lines) >= 6 for a in panels)


@pytest.mark.parametrize("run", [lambda p: timed(p, 0.9), lambda p: at_feed(p, 0.4)])
def test_velocity_and_acceleration_are_the_differences_of_the_position(
    run: Callable[[Path], Trajectory],
) -> None:
    """Along a spline, whose speed in its parameter changes: central differences of half and whole steps in time."""
    bent = through([[0, 0, 0], [0.05, 0.02, 0.1], [0.3, 0, 0.1], [0.35, 0.2, 0]], 4001)
    t = run(bent)
    gaps = []
    for k in (40, 20):
        inside = slice(200, -200)
        step = (t.time[2 * k :] - t.time[: -2 * k])[:, None]
        velocity = ((t.position[2 * k :] - t.position[: -2 * k]) / step)[inside]
        acceleration = ((t.velocity[2 * k :] - t.velocity[: -2 * k]) / step)[inside]
        here = slice(200 + k, -200 - k)
        gaps.append(
            [np.abs(velocity - t.velocity[here]).max(), np.abs(acceleration - t.acceleration[here]).max()]
        )
    assert (np.array(gaps[1]) < [2e-3, 0.1]).all()
    assert (np.array(gaps[1]) < 0.55 * np.array(gaps[0])).all()
