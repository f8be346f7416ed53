"""Requirement files and the table of measures: verdicts, and every bad input in one line."""

from __future__ import annotations

import numpy as np
import pytest

import stiffmap as sm
from stiffmap.workspace.performance import load_requirements, worst_deflection
from stiffmap.workspace.performance.registry import all_measures

FILE = """
name: task
box: {x: 300 mm, y: 300 mm, z: 300 mm}
force: 200 N
requirements:
  velocity: {at_least: 60 m/min}
  deflection: {at_most: 2 mm}
"""


def load(tmp_path, text):
    path = tmp_path / "task.yaml"
    path.write_text(text, encoding="utf-8")
    return load_requirements(path)


def test_shipped_requirements_are_those_of_the_paper():
    task = load_requirements("trimming")
    assert task.box == (0.5, 0.5, 0.5) and task.force == 300 and task.plane == "xy"
    assert task.bound("velocity").at_least == pytest.approx(1.0)
    assert task.bound("deflection").at_most == 0.25e-3
    assert (task.bound("transmission_min").at_least, task.bound("transmission_max").at_most) == (0.5, 2)
    assert load_requirements("trimming.yaml") == task


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("60 m/min", "60", r"velocity.at_least: the unit is missing"),
        ("60 m/min", "60 kg", r"velocity.at_least: expected a unit such as"),
        ("velocity", "speed", r"unknown measure 'speed'; known: .*velocity"),
        ("{at_most: 2 mm}", "{}", r"deflection: give at_least or at_most"),
        ("{at_most: 2 mm}", "{at_most: 2 mm, at_least: 3 mm}", r"at_least \(3 mm\) is above at_most"),
        ("x: 300 mm", "x: 300", r"box.x: the unit is missing"),
        ("force: 200 N", "limits: {clearance: 20}", r"limits.clearance: the unit is missing"),
        ("force: 200 N", "limits: {deflection: -1 mm}", r"limits.deflection: expected a positive length"),
        ("force: 200 N", "forse: 200 N", r"unknown key 'forse' \(did you mean 'force'\?\)"),
        ("force: 200 N", "force: -200 N", r"line 4: force: expected a positive force, found -200 N"),
        ("{x: 300 mm, y", "{x: 0 mm, y", r"box.x: expected a positive length, found 0 mm"),
        (
            "{x: 300 mm, y: 300",
            "{x: 300 mm, y: -300",
            r"box.y: expected a positive length or 0, found -300 mm",
        ),
    ],
)
def test_bad_requirements_name_the_key(tmp_path, old, new, words):
    with pytest.raises(sm.StiffmapError, match=words):
        load(tmp_path, FILE.replace(old, new))


def test_no_such_file():
    with pytest.raises(sm.StiffmapError, match="trimming"):
        load_requirements("nothing.yaml")


def test_verdicts_and_margins(tmp_path):
    machine = sm.load_machine("orthoglide-revised")
    table = sm.measures(
        machine, requirements=load(tmp_path, FILE), only=["velocity", "deflection", "mass"], nodes=5, coarse=3
    )
    assert table.passed
    low, high = table.case.low, table.case.high
    np.testing.assert_allclose((low, high), ([-0.1] * 3, [0.2] * 3), atol=1e-12)
    d = worst_deflection(machine, box=[low, high], force=200.0, nodes=3)
    assert table["deflection"].margin == pytest.approx(2e-3 - d.value)
    assert table["mass"].verdict == ""
    tight = load(tmp_path, FILE.replace("2 mm", "0.01 mm"))
    table = sm.measures(machine, requirements=tight, only=["deflection"], nodes=3, coarse=3)
    assert not table.passed and table["deflection"].verdict == "fail"


def test_a_box_outside_the_reach_is_said_and_replaced():
    table = sm.measures(
        sm.load_machine("orthoglide-original"), requirements="trimming", only=["velocity"], nodes=3
    )
    assert any("not within reach" in n for n in table.notes)
    np.testing.assert_allclose((table.case.low, table.case.high), ([-0.08] * 3, [0.12] * 3))


def test_the_reach_of_a_box_is_that_of_the_orientation():
    """A six-axis arm reaches this box with its tool turned by a quarter of a turn, and not as at home."""
    p, turn = np.array([-1.05, -0.31, 0.72]), np.array([[0, 0, -1], [0, 1, 0], [1, 0, 0]])
    call = {"box": [p - 1e-3, p + 1e-3], "nodes": 2, "coarse": 2}
    table = sm.measures("ur10", only=["condition", "path_effort"], toolpath="trim", rotation=turn, **call)
    assert not table.notes and np.isfinite(table["condition"].found.worst)
    assert "turned as at home" in table["path_effort"].reason
    with pytest.raises(sm.StiffmapError, match="125 of 125 nodes"):
        sm.measures("ur10", only=["condition"], **call)


def test_a_measure_without_its_data_says_what_is_missing():
    table = sm.measures(
        sm.load_machine("tripteron"),
        box=[[0.3] * 3, [0.4] * 3],
        only=["frequency", "velocity"],
        nodes=2,
        coarse=2,
    )
    assert "needs masses" in table["frequency"].reason
    assert "no speed declared" in table["velocity"].reason


def test_worst_direction_against_all_directions():
    machine = sm.load_machine("orthoglide-revised")
    p = np.array([0.2, 0.3, -0.1])
    d = worst_deflection(machine, p, force=300.0)
    angle = np.linspace(0, 2 * np.pi, 721)
    w = np.zeros((721, 6))
    w[:, 0], w[:, 1] = 300 * np.cos(angle), 300 * np.sin(angle)
    all_of = np.linalg.norm(machine.solve(p, w).displacement[:, :2], axis=1)
    assert all_of.max() <= d.value * (1 + 1e-12)
    assert d.value == pytest.approx(all_of.max(), rel=1e-4)
    space = worst_deflection(machine, p, force=300.0, plane=None)
    unit = np.random.default_rng(3).normal(size=(2000, 3))
    unit /= np.linalg.norm(unit, axis=1, keepdims=True)
    w = np.hstack([300 * unit, np.zeros((2000, 3))])
    tried = np.linalg.norm(machine.solve(p, w).displacement[:, :3], axis=1)
    assert tried.max() <= space.value * (1 + 1e-9) and tried.max() > 0.98 * space.value


def test_each_measure_is_one_file_with_a_unit_and_a_side():
    names = [m.name for m in all_measures()]
    assert len(names) == len(set(names)) >= 12
    assert all(m.better in ("high", "low") and m.title for m in all_measures())


def test_a_picture_of_nothing_and_of_one_value():
    from stiffmap.workspace.performance.table import levels

    for grid in ([np.nan, np.inf], [3.0, 3.0], [1.0, 1.0 + 1e-16], [-2.0, np.nan, 5.0], [0.0, 0.0]):
        assert (np.diff(levels(np.array(grid))) > 0).all()


def test_limits_of_the_workspace_from_a_file(tmp_path):
    """As `largest_box` takes them; a deflection takes its part of the volume, bars that meet near home all of it."""
    machine = sm.load_machine("orthoglide-revised")
    task = load(tmp_path, FILE + "limits: {clearance: 20 mm, deflection: 0.6 mm}\n")
    assert (task.clearance, task.deflection) == (0.02, pytest.approx(6e-4))
    asked = {"only": ["workspace"], "nodes": 3, "coarse": 2}
    table = sm.measures(machine, requirements=task, **asked)
    free = sm.measures(machine, **asked)
    assert table.case.limits["deflection"] == (200.0, "xy", task.deflection)
    assert 0 < table["workspace"].found.worst < free["workspace"].found.worst
    assert dict(table["workspace"].found.extra["workspace"].limited_by)["deflection"] > 0
    same = sm.measures(machine, force=200.0, clearance=0.02, deflection=6e-4, **asked)
    assert same["workspace"].found.worst == table["workspace"].found.worst
    none = sm.measures(machine, only=["largest_box"], clearance=0.08, box_tolerance=0.02, nodes=3)[
        "largest_box"
    ].found
    assert none.worst == 0 and none.extra["box"].guarantee == "none"
    with pytest.raises(sm.StiffmapError, match="clearance: expected a positive"):
        sm.measures(machine, clearance=-0.1)


@pytest.mark.parametrize(("leg", "spring"), [("x", "foot"), ("y", "actuator")])
def test_the_largest_deflection_names_the_spring_that_yields_most(leg, spring):
    machine = sm.load_machine("orthoglide-revised")
    weak = machine.with_effect("compliance", element=spring, legs=[leg], scale=50)
    note = sm.measures(weak, only=["deflection"], nodes=3, coarse=2)["deflection"].found.note
    assert f"% from {leg}.{spring}," in note and int(note.split("; ")[1].split(" %")[0]) > 50, note


def test_shares_of_the_largest_deflection_are_those_under_its_force():
    found = sm.measures("hexapod", only=["deflection"], nodes=3, coarse=2)["deflection"].found
    wrench = [*(100.0 * found.extra["direction"]), 0.0, 0.0, 0.0]
    name, _, share = sm.deflection_budget("hexapod", found.worst_at, wrench).ranked()[0]
    assert f"; {100 * share:.0f} % from {name}, " in found.note


def test_a_machine_that_has_play_without_its_weight_keeps_its_largest_deflection():
    machine = sm.load_machine("orthoglide-revised").with_effect(
        "dead_zone", element="actuator", legs=["z"], half_width=2e-5
    )
    row = sm.measures(machine, only=["deflection"], nodes=3, coarse=2, gravity=[0, 0, -9.81])["deflection"]
    assert 4e-4 < row.found.worst < 5e-4 and row.found.note.startswith("under 100 N along")


def test_what_no_pose_keeps_is_named_with_its_bound():
    machine = sm.load_machine("hexapod")
    table = sm.measures(machine, only=["largest_box", "workspace"], nodes=3, coarse=2)
    for name in ("largest_box", "workspace"):
        row = table[name].found
        assert row.worst == 0 and "transmission above 2" in row.note and "no pose" in row.note
    assert sm.largest_box("orthoglide-revised", region=[[5, 5, 5], [6, 6, 6]]).limited_by == ("reach",)


def test_a_failed_pose_has_no_direction_of_the_worst_force():
    """In the answer's position and direction too, which belong together; found between the nodes of a box as well."""
    machine = sm.load_machine("orthoglide-revised")
    d = worst_deflection(machine, [[0, 0, 0], [9, 0, 0], [0.2, 0.3, -0.1]], force=300.0)
    assert list(np.isnan(d.directions[:, 0])) == [False, True, False] == list(np.isnan(d.values))
    assert np.isnan(d.value) and list(d.position) == [9, 0, 0] and np.isnan(d.direction).all()
    whole = worst_deflection(machine, d.positions[[0, 2]], force=300.0)
    assert whole.value == d.values[2] and list(whole.direction) == list(d.directions[2])
    arm = sm.load_machine("ur10")
    around = np.array([[-0.5, -0.5, 0.3], [0.5, 0.5, 0.4]])  # the arm does not reach its own axis
    nodes = worst_deflection(arm, box=around, force=10.0, nodes=2, refine=False)
    assert np.isfinite(nodes.values).all()
    refined = worst_deflection(arm, box=around, force=10.0, nodes=2)
    assert np.isnan(refined.value) and np.isnan(refined.direction).all()
    assert np.abs(refined.position[:2]).max() < 0.2
    with pytest.raises(sm.StiffmapError, match="position: expected at least one"):
        worst_deflection(machine, np.zeros((0, 3)), force=1.0)


@pytest.mark.parametrize(
    ("only", "found"),
    [([], "none"), ({}, "none"), ((), "none"), (["mass", "stroke", "mass"], "'mass' twice")],
)
def test_measures_are_named_once_and_one_at_least(only, found):
    with pytest.raises(sm.StiffmapError, match=f"^only: expected different names, got {found}$"):
        sm.measures("five-bar", only=only)
