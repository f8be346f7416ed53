"""The largest box against the Orthoglide's closed form, and proofs that can fail."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

import stiffmap as sm
from stiffmap.model.files.shipped import find
from stiffmap.workspace.performance.box.box import best_orientation
from stiffmap.workspace.performance.box.box_search import BoxSearch
from stiffmap.workspace.performance.box.proof import enclose, judge_cells, sample, shrink
from stiffmap.workspace.performance.limits.bars import segment_distance
from stiffmap.workspace.performance.limits.limits import Bounds, Limit
from stiffmap.workspace.performance.motion.closing import drive_kinematics

EDGE = 1 / np.sqrt(18) + 1 / np.sqrt(6)  # of the cube within 0.5…2, times L


@pytest.mark.parametrize(("name", "length"), [("orthoglide-revised", 0.775), ("orthoglide-original", 0.31)])
def test_bounds_hold_the_closed_form(name, length):
    b = sm.largest_box(sm.load_machine(name))
    assert b.edge <= EDGE * length <= b.edge_upper
    assert b.gap <= 1.01e-4 and b.proven and not b.exhausted
    np.testing.assert_allclose(b.centre, (1 / np.sqrt(6) - 1 / np.sqrt(18)) / 2 * length, atol=2e-2 * length)
    p = np.random.default_rng(0).uniform(*b.corners, (2000, 3))
    v = sm.velocity_transmission(sm.load_machine(name), p)
    assert v.sphere_min.min() >= 0.5 and v.sphere_max.max() <= 2


def turned(rng):
    q, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    return q * np.sign(np.linalg.det(q))


@pytest.mark.parametrize("name", ["orthoglide-revised", "linear-delta", "rotary-delta", "hexapod", "ur10"])
def test_poses_of_an_enclosed_cell_lie_within_its_radii(name):
    """Against closure and the inverse of the Jacobian, at corners and inside of cells turned anyhow."""
    rng = np.random.default_rng(1)
    machine = sm.load_machine(name)
    low, high = machine.workspace
    drives, six = list(machine.compiled.drives), len(machine.actuators) == 6
    axes, n = turned(rng), 12
    centre = rng.uniform(low + 0.1 * (high - low), high - 0.1 * (high - low), (n, 3))
    half = 0.008 * float((high - low).max()) * rng.uniform(0.3, 1, (n, 3))
    e = machine.compiled.core.enclose(
        centre,
        half,
        axes,
        machine.compiled.home_rotation,
        start=None,
        slopes=6 if six else 3,
        watched=(),
        threads=1,
    )
    assert e["enclosed"].all()
    d = rng.uniform(-1, 1, (n, 16, 3))
    d[:, :8] = np.sign(d[:, :8])
    d = d * half[:, None]
    k = drive_kinematics(
        machine, centre[:, None] + d @ axes.T, start=np.repeat(e["coordinates"][:, None], 16, axis=1)
    )
    off = k.coordinates - e["coordinates"][:, None] - np.einsum("njk,nsk->nsj", e["slope"][..., :3], d)
    assert (np.abs(off) <= e["radius"][:, None]).all()
    assert e["radius"].max() < 30 * np.abs(off).max()  # and not by being useless
    frame = np.eye(6)
    frame[:3, :3] = axes
    inverse = np.linalg.inv(k.jacobian) @ frame if six else np.linalg.inv(k.jacobian[..., :3, :]) @ axes
    linear = e["slope"][:, None, drives] + np.einsum("nkab,nsk->nsab", e["change"][:, :, drives], d)
    assert (np.abs(inverse - linear) <= e["slack"][:, None, drives]).all()


def test_a_cell_across_the_border_of_the_reach_is_not_enclosed():
    machine = sm.load_machine("linear-delta")
    x = np.linspace(0, 1, 41)[:, None] * [[0.6, 0, 0]] + machine.workspace.mean(axis=0)
    reached = drive_kinematics(machine, x, patient=False).status == sm.Status.CONVERGED
    last = x[int(np.argmin(reached)) - 1]
    assert reached[0] and not reached.all()
    e = machine.compiled.core.enclose(
        last[None],
        np.full((1, 3), 0.02),
        np.eye(3),
        machine.compiled.home_rotation,
        start=None,
        slopes=3,
        watched=(),
        threads=1,
    )
    assert not e["enclosed"].any()


def test_cells_that_stick_out_are_cut_off():
    bounds = Bounds(sm.load_machine("orthoglide-revised"), transmission=(0.5, 2.0))
    low = -0.775 / np.sqrt(18)
    centre = np.full(3, low + 0.05)
    kept = shrink(judge_cells(bounds), np.eye(3), np.ones(3), centre, 0.104, 0.0, 1e-4, 20000)
    assert 0.099 <= kept.edge <= 0.1 and len(kept.broken)
    assert "transmission above 2" in kept.names
    whole = shrink(judge_cells(bounds), np.eye(3), np.ones(3), centre, 0.0999, 0.0, 1e-4, 20000)
    assert whole.edge == 0.0999 and not len(whole.broken)


def test_linear_delta_with_and_without_transmission_ends_within_its_work():
    machine = sm.load_machine("linear-delta")
    b = sm.largest_box(machine, tolerance=1e-3)
    assert b.proven and b.gap <= 1e-3
    free = sm.largest_box(machine, transmission=None, tolerance=5e-3, max_evaluations=20_000)
    assert free.poses <= 2 * 20_000 and free.edge > b.edge and free.edge_upper > free.edge
    p = np.random.default_rng(0).uniform(*free.corners, (500, 3))
    k = drive_kinematics(machine, p, patient=False)
    low, high = np.array([machine.compiled.core.limits[i] for i in machine.compiled.drives]).T
    assert (k.status == sm.Status.CONVERGED).all()
    assert ((k.actuators >= low) & (k.actuators <= high)).all()


def test_cube_factors_as_limits():
    """At the isotropic point the farthest vertex is sqrt(3) away, so that 1.7 holds nowhere near it."""
    bounds = Bounds(sm.load_machine("orthoglide-revised"), transmission=(0.5, 2.5), norm="cube")
    rng = np.random.default_rng(2)
    centre, half = rng.uniform(-0.1, 0.1, (20, 3)), np.full((20, 3), 2e-3)
    cells = enclose(bounds, centre, half, np.eye(3))
    v = sm.velocity_transmission(bounds.machine, centre)
    good = (v.cube_max <= 2.5) & (v.cube_min >= 0.5)
    assert cells.inside.any() and (good | ~cells.inside).all() and (cells.inside | ~good).mean() > 0.7
    tight = Bounds(bounds.machine, transmission=(0.1, 1.7), norm="cube")
    assert enclose(tight, np.zeros((1, 3)), np.full((1, 3), 1e-4), np.eye(3)).broken.all()


def test_distance_of_segments_and_clearance_of_bars():
    a = np.array([[0.0, 0, 0], [0, 0, 0], [0, 0, 0]])
    b = np.array([[1.0, 0, 0], [1, 0, 0], [1, 0, 0]])
    c = np.array([[0.5, -1, 2], [3, 4, 0], [0.2, 0, 1]])
    d = np.array([[0.5, 1, 2], [5, 4, 0], [0.9, 0, 3]])
    np.testing.assert_allclose(segment_distance(a, b, c, d), [2, np.hypot(2, 4), 1])
    machine = sm.load_machine("orthoglide-revised")
    bounds = Bounds(machine, clearance=0.07)
    rng = np.random.default_rng(3)
    p = rng.uniform(*machine.workspace, (30, 3))
    half = np.full((30, 3), 5e-4)
    cells = enclose(bounds, p, half, np.eye(3))
    k = drive_kinematics(
        machine, (p[:, None] + rng.uniform(-1, 1, (30, 20, 3)) * half[:, None]).reshape(-1, 3)
    )
    least = bounds.bars.least_distance(k.coordinates).reshape(30, 20).min(axis=1)
    assert cells.inside.any() and (least[cells.inside] >= 0.07).all()


def test_a_deflection_as_limit_is_sampled_and_says_so():
    machine = sm.load_machine("orthoglide-revised")
    b = sm.largest_box(
        machine,
        transmission=None,
        ranges=False,
        joints=False,
        deflection=(300.0, "xy", 4e-4),
        tolerance=0.02,
        max_evaluations=6000,
        region=[[-0.1, -0.1, -0.1], [0.2, 0.2, 0.2]],
    )
    assert b.guarantee.startswith("sampled: a deflection") and not b.proven
    if b.edge > 0:
        d = sm.worst_deflection(machine, box=b.corners, force=300.0, nodes=4, refine=False, turns=0)
        assert d.value <= 4e-4 * 1.001


@dataclass(frozen=True)
class Prism(Bounds):
    """A workspace in the machine's place: |x + y| and |x - y| at most 0.1 sqrt(2), |z| at most 0.1."""

    def at(self, position):
        self.counter[0] += len(position)
        x, y, z = position.T
        size = 0.1 * np.sqrt(2)
        rows = [(x + y, size), (-x - y, size), (x - y, size), (y - x, size), (z, 0.1), (-z, 0.1)]
        one = np.ones((len(position), 1))
        return np.ones(len(position), bool), [Limit("side", v, most, v[:, None], one) for v, most in rows]


def test_a_box_is_turned_to_where_it_fits():
    """The prism is a cube of edge 0.2 turned by 45 degrees; upright only 0.2 / sqrt(2) x 0.2 fits."""
    prism = Prism(sm.load_machine("five-bar"))
    region = np.array([[-0.3] * 3, [0.3] * 3])
    upright = BoxSearch(prism, np.ones(3), np.eye(3), region, 1e-3, 10**6).estimate()[1]
    axes = best_orientation(prism, np.ones(3), region, 1e-3)
    free = BoxSearch(prism, np.ones(3), axes, region, 1e-3, 10**6).estimate()[1]
    assert upright == pytest.approx(0.1414, abs=2e-3)
    assert free > 0.17


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"proportions": (1, 0, 1)}, "proportions"),
        ({"transmission": (2.0, 0.5)}, "transmission"),
        ({"tolerance": 0.0}, "tolerance"),
        ({"clearance": -1.0}, "clearance"),
        ({"norm": "ball"}, "norm: expected one of sphere, cube"),
        ({"orientation": "best"}, "orientation: expected 'search'"),
        ({"deflection": (300.0, "xy", 0.0)}, "deflection"),
        ({"region": [[0, 0, 0], [0, 1, 1]]}, "region"),
    ],
)
def test_bad_input(options, words):
    with pytest.raises(sm.StiffmapError, match=words):
        sm.largest_box(sm.load_machine("orthoglide-revised"), **options)


def test_what_is_proven_of_bars_depends_on_no_thread():
    machine = sm.load_machine("orthoglide-revised")
    bars = Bounds(machine, clearance=0.07).bars
    p = np.random.default_rng(3).uniform(*machine.workspace, (30, 3))
    one, *more = (
        machine.compiled.core.enclose(
            p,
            np.full((30, 3), 5e-4),
            np.eye(3),
            np.eye(3),
            start=None,
            slopes=3,
            watched=bars.nodes,
            threads=n,
        )["moved"]
        for n in (1, 2, 2, 2, 2)
    )
    assert np.isfinite(one).all()
    for other in more:
        np.testing.assert_allclose(other, one, rtol=1e-6)


def test_bounds_and_volumes_depend_on_no_thread():
    machine = sm.load_machine("orthoglide-original")
    boxes = [sm.largest_box(machine, tolerance=1e-2, threads=n) for n in (1, 2)]
    assert boxes[0].edge == boxes[1].edge
    assert boxes[0].edge_upper == boxes[1].edge_upper
    assert boxes[0].poses == boxes[1].poses
    volumes = [sm.workspace_volume(machine, cells=4, threads=n).volume for n in (1, 2)]
    assert volumes[0] == volumes[1]


def test_a_drive_whose_range_ends_in_the_middle_of_a_face(tmp_path):
    """A leg of the Orthoglide is stretched most between the corners; by its closed form a cube from -a to b fits."""
    text = find("orthoglide-revised").read_text(encoding="utf-8").replace("[-1060, -390]", "[-1040, -390]")
    (tmp_path / "short.yaml").write_text(text, encoding="utf-8")
    length, r, low, high = 0.775, 0.0775, 1.040, 0.390
    a = -(r + length - low)
    c = high - r  # b + c = sqrt(L^2 - 2 b^2)
    b = (-2 * c + np.sqrt(4 * c**2 + 12 * (length**2 - c**2))) / 6
    box = sm.largest_box(tmp_path / "short.yaml", transmission=None, tolerance=3e-3)
    assert box.proven
    assert box.edge > b + a - 4e-3
    assert box.edge_upper >= b + a


@dataclass
class Peak:
    """A limit 0 whose value, at most `top`, is largest between two nodes of a cell of half a metre's width."""

    top: float

    def at(self, position: np.ndarray) -> tuple[np.ndarray, list[Limit]]:
        value = self.top - 16.0 * (position[:, 0] - 0.125) ** 2
        return np.ones(len(position), dtype=bool), [Limit("peak", value, 0.0, value[:, None], value[:, None])]


@pytest.mark.parametrize(("top", "inside"), [(0.2, False), (-0.6, True)])
def test_what_a_sampled_limit_may_reach_between_the_nodes_counts(top: float, inside: bool) -> None:
    """At the nodes it is at most top - 0.25: with 0.2 it keeps the limit there, and not between them."""
    found = sample(Peak(top), np.zeros((1, 3)), np.full((1, 3), 0.25), np.eye(3))
    assert found.inside.tolist() == [inside] and not found.broken.any()
