"""What may be chosen: placement, feed, side, the turn of an arm's tool."""

from __future__ import annotations

from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from tests.python.machining.milling.gantry import gantry

import stiffmap as sm
from stiffmap.common.errors import StiffmapError
from stiffmap.machining.milling import mill, mill_job
from stiffmap.machining.milling.choices import choices, other_side, part_lies
from stiffmap.machining.milling.equilibrium import Plant, equilibrium
from stiffmap.machining.milling.limits import drive_speeds, fastest
from stiffmap.machining.milling.placement import PlacementSearch, placements
from stiffmap.machining.milling.redundancy import Steps, best_sequence, redundancy
from stiffmap.machining.milling.setting import Setting, setting
from stiffmap.machining.milling.speed import FASTEST, best_feeds
from stiffmap.machining.toolpath import outline, path_of, sampled
from stiffmap.machining.toolpath.outlines import turned_round
from stiffmap.solve.kinematics import forward_kinematics, inverse_kinematics
from stiffmap.solve.machine import Machine

ARM = Path(__file__).parents[4] / "examples/ur10-spindle.yaml"
PROCESS = sm.load_process("trimming")


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("largest", [True, False])
def test_dynamic_programming_is_exhaustive_search(seed: int, largest: bool) -> None:
    rng = np.random.default_rng(seed)
    m, a, n = 5, 6, 3
    stage = rng.uniform(0, 1, (m, a))
    stage[rng.uniform(size=(m, a)) < 0.15] = np.inf
    joints = np.cumsum(rng.normal(0, 0.2, (m, a, n)), axis=0)
    grid = -np.pi + 2 * np.pi * np.arange(a) / a
    steps = Steps(joints, np.full(m - 1, 0.1), np.array([3.0, 4.0, np.inf]), grid, 25.0)
    allowed = [steps.allowed(k) for k in range(m - 1)]

    def cost(path: tuple[int, ...]) -> float:
        if not all(allowed[k][path[k], path[k + 1]] for k in range(m - 1)):
            return np.inf
        values = [stage[k, i] for k, i in enumerate(path)]
        return float(max(values) if largest else sum(values))

    best = min(cost(p) for p in product(range(a), repeat=m))
    found = best_sequence(stage, steps, largest=largest)
    if not np.isfinite(best):
        assert found is None
    else:
        assert found is not None
        assert cost(tuple(found)) == pytest.approx(best)


@pytest.mark.parametrize("turn", [0.0, 2.0])
@pytest.mark.parametrize("reverse", [True, False])
@pytest.mark.parametrize(
    ("name", "way", "other", "climb"), [("circle", "clockwise", "counter-clockwise", "inside"), ("pocket", "counter-clockwise", "clockwise", "outside")]
)  # fmt: skip
def test_where_the_part_lies_is_said(
    name: str, way: str, other: str, climb: str, reverse: bool, turn: float
) -> None:
    places = {"inside", "outside"}
    for process in (PROCESS, other_side(PROCESS)):
        c = choices(
            gantry(), name, process, turn=turn, reverse=reverse, step=0.01, thickness=None, threads=1
        )  # fmt: skip
        job = c.job
        said = part_lies(job)
        assert said is not None
        assert f"is travelled {other if reverse else way}; in a {job.process.cut.side} cut" in said
        (here,) = {climb} if process is PROCESS else places - {climb}
        assert f"the part lies {here} it. If it lies {(places - {here}).pop()}, exchange" in said
        reach = np.linalg.norm((job.position - job.off)[:, :2] - job.place.at[:2], axis=1).min()
        assert (reach < 1) == (here == "inside")  # from the path a metre to the part


def test_of_other_paths_no_side_is_said() -> None:
    for path, process in ((path_of([[0, 0, 0], [0.1, 0, 0]]), "trimming"), (outline("circle"), "slot")):
        cut = sm.load_process(process)
        job = setting(gantry(), path, cut, sampled(path, 0.01), path.placed())
        assert part_lies(job) is None


def arm_job(step: float = 0.02) -> Setting:
    path = outline("washbasin")
    return setting(sm.load_machine(ARM), path, PROCESS, sampled(path, step), path.placed((-0.75, -0.1, 0.3)))


def test_an_arm_turns_about_its_tool() -> None:
    job = arm_job()
    found = redundancy(job, 24, fastest=None)
    error = np.abs(found.error).max()
    assert error <= found.fixed.min() * (1 + 1e-9)
    e = equilibrium(Plant(job), job.position)
    home = np.abs((e.error * job.off).sum(axis=1)).max()
    assert error < 0.9 * home
    # at those turns, solved anew
    turned = setting(job.machine, job.path, PROCESS, job.points, job.place, angle=found.angle)
    again = equilibrium(Plant(turned), job.position)
    assert (again.error * job.off).sum(axis=1) == pytest.approx(found.error, abs=1e-9)
    assert np.einsum("mij,j->mi", turned.rotation, job.machine.description.home.r.T[:, 2]) == pytest.approx(
        job.tool
    )
    with pytest.raises(StiffmapError, match="no free turn"):
        redundancy(setting(sm.load_machine("linear-delta"), job.path, PROCESS, job.points, job.place))
    far = setting(job.machine, job.path, PROCESS, job.points, job.path.placed((-3.0, 0, 0.3)))
    with pytest.raises(StiffmapError, match="no turn of the tool holds the path"):
        redundancy(far, 4)


def test_a_spindle_in_line_with_the_last_joint_stays_as_at_home() -> None:
    machine, path = sm.load_machine("ur10"), outline("circle", (0.06,))
    found = redundancy(
        setting(machine, path, PROCESS, sampled(path, 0.02), path.placed((-0.8, -0.05, 0.3))), 9 * 2
    )
    assert found.idle
    assert found.angle == pytest.approx(0.0, abs=1e-12)
    assert not redundancy(arm_job(0.1), 8, fastest=None).idle


def test_placement_beats_the_naive_one_and_holds_the_path() -> None:
    machine, path = sm.load_machine("orthoglide-revised"), outline("rectangle")
    found = placements(machine, path, PROCESS, count=64, points=60)
    assert found.best_error <= min(found.naive_error, found.largest.min() * 1.05)
    assert found.gain > 1.1
    assert found.largest[np.isfinite(found.largest)].max() > 1.4 * found.best_error
    ds = mill(machine, path, PROCESS, at=found.best.at, turn=found.best.turn, step=0.01)
    assert (ds.status.values == 0).all()
    assert float(np.abs(ds.error_normal).max()) == pytest.approx(found.best_error, rel=0.05)
    assert "the best leaves" in found.words(1.0)
    assert "No placement" not in found.words(1.0)
    short = found.words(1e-6)
    assert short.startswith(
        "No placement of 64 reaches the tolerance of 0.001 mm without compensation: the best leaves"
    )
    assert found.limits in short
    assert found.naive_along.max() == pytest.approx(found.naive_error)
    assert np.abs(found.best_along).max() == pytest.approx(found.best_error)
    assert found.three_times == pytest.approx((found.largest > 3 * found.best_error).mean())
    # the many are judged as one by one
    search = PlacementSearch(machine, path, PROCESS, 60, None)
    from stiffmap.machining.toolpath import Placement

    exact = [search.exact(Placement(found.at[k], float(found.turn[k]))) for k in range(5)]
    assert found.largest[:5] == pytest.approx(exact, rel=0.01)


def test_no_placement() -> None:
    with pytest.raises(StiffmapError, match="no placement of 16 holds the path on linear-delta"):
        placements(
            sm.load_machine("linear-delta"), outline("washbasin", (0.9, 0.7)), PROCESS, count=16, points=40
        )


def straight(machine: Machine) -> Setting:
    path = path_of([[-0.05, 0, 0], [0.05, 0, 0]])
    return setting(machine, path, PROCESS, sampled(path), path.placed((0, 0, 0)))


def test_feed_up_to_the_tolerance() -> None:
    job = straight(gantry(y=1e-3))
    found = best_feeds(job, 1.5e-4)
    assert found.held.all()
    share = found.feed[0] / PROCESS.feed
    faster = replace(job, faster=job.faster * share)
    e = equilibrium(Plant(faster), job.position)
    assert np.abs((e.error * job.off).sum(axis=1)).max() == pytest.approx(1.5e-4, rel=1e-4)
    assert found.time == pytest.approx(found.before / share)
    assert best_feeds(job, 1e-2).feed == pytest.approx([FASTEST * PROCESS.feed])
    assert not best_feeds(job, 1e-7).held.any()
    with pytest.raises(StiffmapError, match="tolerance: expected"):
        best_feeds(job, 0.0)


def test_feed_up_to_the_drives_efforts() -> None:
    machine, path = sm.load_machine("linear-delta"), outline("circle", (0.06,))
    job = setting(machine, path, PROCESS, sampled(path, 4e-3), path.placed((0.05, 0.05, 0.3)))
    found = best_feeds(job, 1e-3)
    share = found.feed[job.points.move] / job.feed
    for more, broken in ((1.0, False), (1.01, True)):
        faster = replace(job, faster=job.faster * share * more)
        force = faster.force(np.zeros((len(job), 2)))
        effort = Plant(faster).stand(job.position, force, full=True).effort
        assert (np.abs(effort).max() > 150.0) is np.bool_(broken)  # N, from the machine's file


def test_a_drive_declared_to_stand_still_has_no_feed() -> None:
    machine, path = sm.load_machine("orthoglide-revised"), outline("circle", (0.06,))
    still = machine.with_numbers({"x.actuator/speed": 0.0})
    job = setting(still, path, PROCESS, sampled(path, 4e-3), path.placed((0.0, 0.0, 0.0)))
    assert fastest(still)[0] < 1e-9
    with pytest.raises(StiffmapError, match="declared to stand still"):
        best_feeds(job, 1e-3)


def test_the_other_way_round() -> None:
    path = outline("washbasin")
    back = turned_round(path)
    a, b = sampled(path, 1e-3), sampled(back, 1e-3)
    assert b.position == pytest.approx(a.position[::-1], abs=1e-12)
    assert b.tangent == pytest.approx(-a.tangent[::-1], abs=1e-9)
    assert other_side(PROCESS).cut.side == "conventional"
    assert other_side(other_side(PROCESS)) == PROCESS
    # the wall stays on the same side of the part
    one = setting(sm.load_machine("orthoglide-revised"), path, PROCESS, a, path.placed((0.05, 0.05, 0)))
    two = setting(one.machine, back, other_side(PROCESS), b, one.place)
    assert two.off == pytest.approx(one.off[::-1], abs=1e-9)
    assert two.width(np.zeros(len(two)))[100:-100] == pytest.approx(
        one.width(np.zeros(len(one)))[::-1][100:-100], rel=0.2
    )


@pytest.mark.parametrize("name", ["slot", "trimming"])
def test_a_built_in_outline_is_run_at_the_speeds_of_its_process(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("stiffmap.machining.milling.job.path_stability", lambda _: "not asked here")
    process = sm.load_process(name)
    found = mill_job(sm.load_machine("orthoglide-revised"), "circle", process, at=(0.05, 0.05, 0), step=0.05)
    assert found.job.faster == pytest.approx(1.0)
    assert found.job.path.spindle[-1] == pytest.approx(process.spindle)
    assert found.job.feed == pytest.approx(process.feed)


def test_drives_run_as_the_inverse_jacobian_says() -> None:
    """Slides at right angles run as the tool does, per axis; an arm as its Jacobian has it, whose rows are what one drive moves."""
    path = outline("washbasin")
    slides = setting(gantry(), path, PROCESS, sampled(path, 5e-3), path.placed((0, 0, 0), 0.4))
    assert drive_speeds(slides) == pytest.approx(slides.feed[:, None] * slides.tangent, abs=1e-9)
    job = arm_job(0.1)
    joints = inverse_kinematics(job.machine, job.position, job.rotation).actuators
    found, h = drive_speeds(job), 1e-6
    for k in range(len(job)):
        at = [forward_kinematics(job.machine, joints[k] + s * h * found[k]).position for s in (-1, 1)]
        assert np.ravel(at[1] - at[0]) / (2 * h) == pytest.approx(job.feed[k] * job.tangent[k], abs=1e-6)
