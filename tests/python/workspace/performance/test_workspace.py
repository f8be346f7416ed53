"""Volumes of workspaces against closed forms, and against counts by closed-form kinematics."""

from __future__ import annotations

import numpy as np
import pytest

import stiffmap as sm
from stiffmap.ui.plot.box import workspace_figure
from stiffmap.ui.plot.measures import measure_figures
from stiffmap.workspace.performance.registry import get_measure

L, R = 0.775, 0.0775  # of the revised Orthoglide
LOW, HIGH = -1.06, -0.39  # of its drives


def near(found, exact):
    return abs(found.volume - exact) <= 3.5 * found.error


def grid(low, high, n):
    axes = [np.linspace(a, b, n, endpoint=False) + (b - a) / (2 * n) for a, b in zip(low, high, strict=True)]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(axes))


def count(good, low, high):
    return float(good.mean() * np.prod(np.subtract(high, low)))


def inverse_jacobian(p):
    """Rows [1, y/s, z/s] and cyclic of the Orthoglide."""
    out, root = np.empty((len(p), 3, 3)), np.empty((len(p), 3))
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        root[:, i] = np.sqrt(np.maximum(L**2 - p[:, j] ** 2 - p[:, k] ** 2, 0))
        out[:, i, i] = 1
        with np.errstate(divide="ignore", invalid="ignore"):
            out[:, i, j], out[:, i, k] = p[:, j] / root[:, i], p[:, k] / root[:, i]
    return out, root


def home_side(inverse, root):
    """Within the three cylinders, and not beyond a singularity."""
    good = (root > 0).all(axis=1)
    good[good] = np.linalg.det(inverse[good]) > 0
    return good


def test_three_cylinders_of_the_orthoglide():
    """Without drive ranges and singularities, each leg reaches a cylinder: Steinmetz's solid of three."""
    machine = sm.load_machine("orthoglide-revised")
    w = sm.workspace_volume(machine, ranges=False, singularity=None, cells=12)
    assert near(w, (16 - 8 * np.sqrt(2)) * L**3)
    assert 0 < w.error < 0.02 * w.volume and not w.cut and w.dimension == 3
    assert w.limited_by[0][0] == "reach"


def test_drive_ranges_transmission_and_singularities_by_closed_form_kinematics():
    machine = sm.load_machine("orthoglide-revised")
    low, high = [-0.6] * 3, [0.7] * 3
    p = grid(low, high, 120)
    inverse, root = inverse_jacobian(p)
    rho = p - R - root
    reach = home_side(inverse, root)
    ranges = reach & ((rho >= LOW) & (rho <= HIGH)).all(axis=1)
    w = sm.workspace_volume(machine, cells=10)
    assert near(w, count(ranges, low, high))
    assert "range of x.actuator" in dict(w.limited_by)
    s = np.linalg.svd(inverse[ranges], compute_uv=False)
    bounded = ranges.copy()
    bounded[ranges] = (s[:, 0] <= 2) & (s[:, -1] >= 0.5)
    w = sm.workspace_volume(machine, transmission=(0.5, 2.0), cells=10)
    assert near(w, count(bounded, low, high))


def test_what_lies_beyond_a_singularity_does_not_count():
    """Without ranges the Orthoglide's determinant changes its sign inside of the three cylinders."""
    low, high = [-L] * 3, [L] * 3
    p = grid(low, high, 100)
    inverse, root = inverse_jacobian(p)
    w = sm.workspace_volume(sm.load_machine("orthoglide-revised"), ranges=False, cells=12)
    assert near(w, count(home_side(inverse, root), low, high))
    assert w.volume < (16 - 8 * np.sqrt(2)) * L**3 * 0.95


def five_bar(p):
    """Reached by both arms (elbows outside), and which side of the line of the elbows the tool is on."""
    elbows, reached = [], np.ones(len(p), bool)
    for base, side in ((-0.15, 1), (0.15, -1)):
        d = p - [base, 0]
        r = np.linalg.norm(d, axis=1)
        reached &= (r <= 0.674) & (r >= 0.074)
        cosine = np.clip((0.3**2 + r**2 - 0.374**2) / (0.6 * r), -1, 1)
        angle = np.arctan2(d[:, 1], d[:, 0]) + side * np.arccos(cosine)
        elbows.append([base, 0] + 0.3 * np.stack([np.cos(angle), np.sin(angle)], axis=1))
    a, b = elbows
    u, v = p - a, b - p
    return reached, u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]


def test_the_plane_of_a_five_bar():
    """Two discs with a hole each overlap in a lens; its workspace ends where its forearms are in line."""
    machine = sm.load_machine("five-bar")
    w = sm.workspace_volume(machine, singularity=None)
    lens = 2 * 0.674**2 * np.arccos(0.15 / 0.674) - 0.15 * np.sqrt(4 * 0.674**2 - 0.09)
    assert near(w, lens - 2 * np.pi * 0.074**2) and w.dimension == 2
    low, high = [-0.7, -0.7], [0.7, 0.7]
    p = grid(low, high, 1000)
    reached, turn = five_bar(p)
    home = five_bar(np.array([[0.0, 0.416]]))[1][0]
    w = sm.workspace_volume(machine)
    assert near(w, count(reached & (turn * home > 0), low, high))
    assert dict(w.limited_by)["singularity"] > 0.02


def test_the_box_of_a_machine_with_a_drive_for_each_axis(tmp_path):
    """A gantry's workspace is the product of its strokes."""
    text = """
name: gantry
units: {length: m, force: N, angle: rad}
workspace: {x: [-0.1, 0.1], y: [-0.1, 0.1], z: [-0.1, 0.1]}
task: [x, y, z]
legs:
  one:
    elements:
      - {actuator: a, kind: prismatic, axis: x, rigid: true, range: [-0.3, 0.2]}
      - {actuator: b, kind: prismatic, axis: y, rigid: true, range: [-0.1, 0.15]}
      - {actuator: c, kind: prismatic, axis: z, rigid: true, range: [-0.2, 0.25]}
"""
    path = tmp_path / "gantry.yaml"
    path.write_text(text, encoding="utf-8")
    machine = sm.load_machine(path)
    w = sm.workspace_volume(machine, transmission=(0.5, 2.0), cells=12, prove=4000)
    exact = 0.5 * 0.25 * 0.45
    assert near(w, exact)
    assert np.isnan(w.proven) or 0.5 * exact < w.proven <= exact


def test_the_error_is_that_of_many_draws():
    machine = sm.load_machine("five-bar")
    found = [sm.workspace_volume(machine, singularity=None, cells=40, seed=i) for i in range(6)]
    spread = np.std([w.volume for w in found], ddof=1)
    told = np.mean([w.error for w in found])
    assert 0.4 * told < spread < 2.0 * told


def test_a_proof_is_a_lower_bound():
    w = sm.workspace_volume(
        sm.load_machine("orthoglide-revised"), transmission=(0.5, 2.0), cells=6, prove=6000
    )
    assert 0.3 * w.volume < w.proven <= w.volume + 3.5 * w.error


def test_a_deflection_takes_its_part():
    machine = sm.load_machine("orthoglide-revised")
    whole = sm.workspace_volume(machine, cells=8)
    stiff = sm.workspace_volume(machine, cells=5, deflection=(300.0, "xy", 4e-4))
    assert 0 < stiff.volume < whole.volume and "deflection" in dict(stiff.limited_by)
    d = sm.worst_deflection(machine, stiff.drawn.position[stiff.drawn.inside], force=300.0, turns=0)
    assert np.nanmax(d.values) <= 4e-4


def test_clearance_of_bars_takes_its_part():
    """The Orthoglide's bars of two legs end at the flange, always 77.5 mm apart."""
    machine = sm.load_machine("orthoglide-revised")
    kept, none = (
        sm.workspace_volume(machine, cells=4, clearance=c, region=[[-0.2] * 3, [0.3] * 3])
        for c in (0.077, 0.078)
    )
    assert kept.volume > 0.9 * 0.125 and none.volume == 0
    assert none.drawn.causes()["clearance of bars"].all()


def test_both_ends_of_a_range_are_told():
    """Beside the workspace that the drives' ranges leave, nothing is out of reach."""
    w = sm.workspace_volume(sm.load_machine("orthoglide-revised"), cells=4, region=[[-0.4] * 3, [0.5] * 3])
    causes, p = w.drawn.causes(), w.drawn.position
    _inverse, root = inverse_jacobian(p)
    beyond = (p - R - root > HIGH)[:, 0] & w.drawn.closed
    short = (p - R - root < LOW)[:, 0] & w.drawn.closed
    assert beyond.any() and short.any() and causes["range of x.actuator"][beyond | short].all()
    assert not causes["reach"][w.drawn.closed].any()


def test_the_measure_and_its_picture():
    table = sm.measures(sm.load_machine("orthoglide-revised"), only=["workspace"], nodes=3, coarse=2)
    w = table["workspace"].found.extra["workspace"]
    assert table["workspace"].found.worst == w.volume and "±" in table["workspace"].found.note
    assert len(workspace_figure(table.machine, w, nodes=12).axes) == 3
    assert "map-workspace" in measure_figures(table)
    flat = sm.measures(sm.load_machine("five-bar"), only=["workspace"], nodes=3, coarse=2)
    assert "flat" in flat["workspace"].reason
    assert get_measure("workspace").unit == "m^3"


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"singularity": 2.0}, "singularity"),
        ({"cells": 1}, "cells"),
        ({"region": [[0, 0, 0], [0, 1, 1]]}, "region"),
        ({"clearance": -1.0}, "clearance"),
        ({"transmission": (2.0, 0.5)}, "transmission"),
    ],
)
def test_bad_input(options, words):
    with pytest.raises(sm.StiffmapError, match=words):
        sm.workspace_volume(sm.load_machine("orthoglide-revised"), **options)
