"""Several wrenches at once, of different kinds, and springs outside."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.python.solve import builders as b

import stiffmap as sm
from stiffmap.model.description import Body, ExternalSpring, Law, Point, Pose
from stiffmap.model.files.shipped import starter_text

DRIVE = 2e3


def lever() -> sm.Machine:
    """A motor about z with an arm of 0.5 m, a point half-way, a body of 3 kg at the tip."""
    return b.serial(
        b.motor("drive", law=Law(DRIVE)),
        b.shift("half", (0.25, 0, 0)),
        Point("middle"),
        b.shift("rest", (0.25, 0, 0)),
        Body("weight", 3.0),
        home=Pose.of((0.5, 0, 0)),
    )


def turned(s: sm.Solution) -> float:
    return float(s.displacement[5])


def test_dead_beside_follower() -> None:
    machine = lever()
    middle = next(n for n in machine.points if n.endswith("middle"))
    force, pull = [0, 300.0, 0, 0, 0, 0], [-200.0, 0, 0, 0, 0, 0]
    s = machine.solve((0.5, 0, 0), pull, wrenches={middle: force}, load_type={middle: "follower"})
    a = turned(s)  # k a = 0.25 F (the follower stays across the arm) + 0.5 P sin a (dead)
    assert DRIVE * a == pytest.approx(0.25 * 300 + 0.5 * 200 * np.sin(a), rel=1e-9)
    dead = turned(machine.solve((0.5, 0, 0), pull, wrenches={middle: force}))
    assert DRIVE * dead == pytest.approx(0.25 * 300 * np.cos(dead) + 0.5 * 200 * np.sin(dead), rel=1e-9)


def test_weight_and_readings() -> None:
    machine = lever()
    middle = next(n for n in machine.points if n.endswith("middle"))
    s = machine.solve((0.5, 0, 0), gravity=[0, -10, 0], read_points=[middle])
    a = turned(s)
    assert DRIVE * a == pytest.approx(-30 * 0.5 * np.cos(a), rel=1e-9)
    np.testing.assert_allclose(s.readings[1, :3], 0.25 * np.array([np.cos(a) - 1, np.sin(a), 0]), atol=1e-12)


def test_spring_outside_with_a_free_length() -> None:
    machine = lever()
    middle = next(n for n in machine.points if n.endswith("middle"))
    hose = ExternalSpring("hose", middle, (0.25, 0.4, 0.0), 500.0, 0.3)
    pulled = sm.Machine(replace(machine.description, external_springs=(hose,)))
    a = turned(pulled.solve((0.5, 0, 0)))
    at = 0.25 * np.array([np.cos(a), np.sin(a)])
    way = np.array([0.25, 0.4]) - at
    f = 500.0 * (np.linalg.norm(way) - 0.3) * way / np.linalg.norm(way)
    assert pytest.approx(at[0] * f[1] - at[1] * f[0], rel=1e-9) == DRIVE * a


def test_bad_load_types() -> None:
    machine = lever()
    with pytest.raises(sm.StiffmapError, match="load_type: expected one of dead"):
        machine.solve((0.5, 0, 0), np.zeros(6), load_type={"tcp": "stiff"})
    with pytest.raises(sm.StiffmapError, match="load_type: no wrench acts at 'nose'"):
        machine.solve((0.5, 0, 0), np.zeros(6), load_type={"nose": "dead"})


def test_points_are_named_as_in_the_file(tmp_path: Path) -> None:
    """By their full names, wherever they are; an unknown one is answered with those that exist."""
    file = tmp_path / "machine.yaml"
    file.write_text(starter_text("mine"))
    machine = sm.load_machine(file)
    assert machine.points == ("tcp", "left.wrist", "right.wrist", "middle.wrist", "platform.probe")
    p = machine.description.home.p
    s = machine.solve(p, [0, 0, -9, 0, 0, 0], point="platform.probe", read_points=["left.wrist", "tcp"])
    assert s.ok and np.isfinite(s.readings).all()
    known = "expected one of tcp, left.wrist, right.wrist, middle.wrist, platform.probe, got 'probe'"
    for call in (
        lambda: machine.solve(p, point="probe"),
        lambda: machine.wrench(p, np.zeros(6), point="probe"),
        lambda: sm.sweep(machine, p, [0, 0, 1], limit=10.0, point="probe"),
    ):
        with pytest.raises(sm.StiffmapError, match=known):
            call()
