"""The engaged arc against a model that knows nothing of it: the tool's circle and the stock as it was left; outside corners."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import stiffmap as sm
from stiffmap.machining.milling import mill_job
from stiffmap.machining.process import load_process
from stiffmap.machining.process.description import widened
from stiffmap.machining.toolpath import engagement, load_path, path_of, sampled
from stiffmap.machining.toolpath.path import Toolpath


def _transition(radius: float, turn: float, way: Path) -> Toolpath:
    """A line of 20 mm, an arc of a quarter turn about (0, turn * radius), a line; m."""
    e, g = turn * radius * 1e3, "G3" if turn > 0 else "G2"
    r = radius * 1e3
    text = f"G21 G90 G17 F1000 S10000 M3\nG0 X-20 Y0 Z0\nG1 X0 Y0\n{g} X{r} Y{e} I0 J{e}\nG1 X{r} Y{e + turn * 20}\n"
    way.write_text(text)
    return load_path(way)


def _arc_of_circle(p: Toolpath, s: float, width: float, r: float, side: float) -> float:
    """rad: arc of the circle at way s that stands in stock: between wall and edge, and not where the tool was before."""
    q = sampled(p, 2e-5)
    normal = side * np.cross(q.tool, q.tangent)  # to the part
    at = int(np.argmin(np.abs(q.way - s)))
    angle = np.linspace(0, np.pi, 20001)  # from the part's side forwards to the other
    rim = q.position[at] + r * (np.cos(angle)[:, None] * normal[at] + np.sin(angle)[:, None] * q.tangent[at])
    edge = q.position + (r - width) * normal  # of the stock, away from the part
    # the first crossing of the rim with the edge ahead ends the arc
    ahead = edge[at : at + 1500]
    inside = np.linalg.norm(ahead - q.position[at], axis=1) < r
    k = int(np.argmin(inside))
    return float(angle[np.argmin(np.linalg.norm(rim - ahead[k], axis=1))])


@pytest.mark.parametrize("turn", [1.0, -1.0])
@pytest.mark.parametrize(("radius", "width"), [(0.04, 1e-3), (0.04, 4e-3), (0.1, 2e-3), (0.1, 8e-3)])
def test_from_line_to_arc_and_back(radius: float, width: float, turn: float, tmp_path: Path) -> None:
    cut = load_process("trimming")
    cut = replace(cut, cut=replace(cut.cut, radial=width))
    r = cut.tool.diameter / 2
    p = _transition(radius, turn, tmp_path / "path.ngc")
    q = sampled(p, 2.5e-4)
    e = engagement(q, p, cut)
    change = abs(width / radius * (r - width / 2))
    reach = r * np.sin(cut.arc)
    joints = (0.02, 0.02 + np.pi / 2 * radius)
    for joint in joints:
        for share in (-0.75, -0.5, -0.25, 0.5):
            s = joint + share * reach
            k = int(np.argmin(np.abs(q.way - s)))
            arc = _arc_of_circle(p, q.way[k], width, r, -1.0)
            found = widened(cut, width, e.curvature[k])
            assert abs(found - r * (1 - np.cos(arc))) < 0.12 * change, (joint, share)


SQUARE = [[-40, -40, 0], [-40, 40, 0], [40, 40, 0], [40, -40, 0], [-40, -40, 0]]
TRIANGLE = [[-40, -40, 0], [0, 40, 0], [40, -40, 0], [-40, -40, 0]]


@pytest.mark.parametrize(
    ("corners", "count"), [(SQUARE, 3), (TRIANGLE, 2), (SQUARE[::-1], 0), (SQUARE[:3], 1)]
)
def test_beside_an_outside_corner_there_is_no_wall(corners: list[list[float]], count: int) -> None:
    """A climb cut has the part on its right: clockwise outlines go around it, the others within."""
    p = path_of(1e-3 * np.array(corners))
    cut = load_process("trimming")
    r = cut.tool.diameter / 2
    q = sampled(p, 1e-3)
    wall = engagement(q, p, cut).wall
    joint = np.cumsum(p.length)[:-1]
    t = p.at(np.arange(len(p)), np.full(len(p), 0.5))[1]
    turn = np.arccos((t[1:] * t[:-1]).sum(axis=1))
    gap = np.abs(q.way[:, None] - joint) < (1 - 1e-6) * r * np.tan(turn / 2)
    np.testing.assert_array_equal(wall, ~gap.any(axis=1) if count else np.ones(len(q), bool))
    found = mill_job(sm.load_machine("linear-delta"), p, cut, at=(0.05, 0.05, 0.3), step=2e-3)
    ds = found.dataset
    if count:
        assert np.abs(ds.error_normal_after).max() < 0.01 * np.abs(ds.error_normal).max()
    assert [w.name for w in found.warnings if w.name == "outside corner"] == ["outside corner"] * bool(count)
