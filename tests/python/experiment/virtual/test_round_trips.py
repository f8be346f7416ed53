"""A twin of every sort of reading: with its effect the residual is the noise, without it is not."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest
from tests.python.experiment.conftest import Twin

import stiffmap as sm
from stiffmap.experiment import Predictor, residual
from stiffmap.experiment.calls import placed
from stiffmap.experiment.virtual.plans import grid_poses

POSITION = ("--quantity", "position", "--poses", "12")
FEW = ("--poses", "6", "--loads", "6")
YIELD = "compliance actuator z scale=1.5"
GROWN = "length bar x error=0.1mm"
MORE = "length bar x error=0.8mm"


@dataclass(frozen=True)
class Case:
    effect: str
    arguments: tuple[str, ...]


CASES = {
    "one axis": Case(YIELD, (*FEW, "--read", "dz")),
    "rotations": Case("compliance bar x scale=2", (*FEW, "--read", "rx,ry,rz", "--angle-noise", "0.001")),
    "six-dimensional poses": Case("compliance bar x scale=4", (*FEW, "--read", "dx,dy,dz,rx,ry,rz")),
    "distances": Case(MORE, (*POSITION, "--distances")),
    "load side": Case("compliance actuator x scale=1.5", (*FEW, "--read", "none", "--joint", "x.actuator")),
    "motor side": Case(
        "servo_share actuator x share=0.3", (*FEW, "--read", "none", "--joint", "x.actuator:motor")
    ),
    "passive joint": Case(GROWN, (*POSITION, "--read", "none", "--joint", "x.proximal")),
    "commanded actuators": Case(GROWN, (*POSITION, "--command")),
    "unknown frame per set-up": Case(
        MORE, (*POSITION, "--frame", "unknown", "--setups", "2", "--repeats", "4")
    ),
    "unknown point on the tool": Case(
        "lead_error actuator x slope=0.5mm/m", (*POSITION, "--tool", "offset_unknown")
    ),
    "unknown zero of a pose": Case(YIELD, (*FEW, "--unloaded", "unknown")),
    "shared zero": Case(YIELD, (*FEW, "--zero-noise", "0.01")),
    "side of the approach": Case(
        "dead_zone actuator y half_width=20um", (*FEW, "--approach", "--unloaded", "approach")
    ),
    "approached positions": Case("dead_zone actuator y half_width=20um", (*POSITION, "--approach")),
    "temperature": Case(
        "thermal_growth bar all coefficient=12e-6 1/K", (*POSITION, "--temperature", "20,26", "--shuffle")
    ),
    "branch": Case("friction actuator y force=60N", (*FEW, "--branches")),
    "order": Case("drift sensor x=2um", (*POSITION, "--shuffle")),
    "weight": Case("payload platform mass=8kg", (*POSITION, "--gravity", "0,0,-9.81")),
    "grid": Case(YIELD, ("--plan", "grid:3x2x1", "--loads", "6")),
    "all checks": Case(YIELD, ("--poses", "3", "--loads", "full")),
}


@pytest.mark.parametrize("name", CASES)
def test_residual_of_a_twin(name: str, twin: Twin, orthoglide: sm.Machine) -> None:
    case = CASES[name]
    e = twin("--effect", case.effect, "--seed", "3", *case.arguments)
    term = placed(orthoglide, case.effect)
    known, declared = residual(orthoglide, e, [term]), residual(orthoglide, e)
    assert known.lack_of_fit > 1e-3
    assert known.summary.ratio < 1.2 or e.zero_sigma.any()  # a shared zero stays in the readings
    assert declared.lack_of_fit < 1e-6
    assert not known.noise.contradictions()


@pytest.mark.parametrize(
    "words", [("--frame", "unknown"), ("--unloaded", "unknown"), ("--tool", "offset_unknown")]
)
def test_what_is_unknown_is_not_blamed_on_the_machine(
    words: tuple[str, str], twin: Twin, orthoglide: sm.Machine
) -> None:
    plan = FEW if words[0] == "--unloaded" else POSITION
    free = twin(*plan, *words)
    assert residual(orthoglide, free).lack_of_fit > 1e-3
    key = words[0][2:]
    bound = replace(free, **{key: "centre" if key == "unloaded" else "known"})
    assert residual(orthoglide, bound).lack_of_fit < 1e-6


def test_a_shared_zero_is_correlated_noise(twin: Twin, orthoglide: sm.Machine) -> None:
    e = twin("--poses", "12", "--loads", "6", "--zero-noise", "0.01")
    assert e.zero_sigma[:3] == pytest.approx(1e-5)
    assert residual(orthoglide, e).lack_of_fit > 1e-3
    ignored = replace(e, zero_sigma=np.zeros(6))
    assert residual(orthoglide, ignored).lack_of_fit < 1e-6


def test_an_approach_from_the_other_side_is_another_reading(twin: Twin, orthoglide: sm.Machine) -> None:
    effect = "dead_zone actuator y half_width=20um"
    e = twin("--effect", effect, *POSITION, "--approach")
    assert e.approach is not None
    turned = replace(e, approach=-e.approach)
    assert residual(orthoglide, turned, [placed(orthoglide, effect)]).lack_of_fit < 1e-6
    here, there = (Predictor(orthoglide, x)([placed(orthoglide, effect)]) for x in (e, turned))
    np.testing.assert_allclose(here, -there, atol=2e-7)  # the lag is small beside the machine


def test_play_is_half_its_width_to_each_side(twin: Twin, orthoglide: sm.Machine) -> None:
    e = twin(*POSITION, "--approach", "--joint", "y.actuator")
    found = Predictor(orthoglide, e)([placed(orthoglide, "dead_zone actuator y half_width=20um")])[:, 6]
    assert e.approach is not None
    along = e.approach[:, 1] != 0
    np.testing.assert_allclose(found[along], -2e-5 * np.sign(e.approach[along, 1]), rtol=1e-9)


def test_a_distance_does_not_know_the_frame(twin: Twin, orthoglide: sm.Machine) -> None:
    e = twin(*POSITION, "--distances", "--frame", "unknown")
    fitted = residual(orthoglide, e)
    assert fitted.nuisances == 0
    assert fitted.lack_of_fit > 1e-3


def test_distance_of_moved_points(twin: Twin, orthoglide: sm.Machine) -> None:
    e = twin("--effect", GROWN, *POSITION, "--distances", "--repeats", "1", "--noise", "1e-9")
    moved = orthoglide.with_effect("length", element="bar", legs=["x"], error=1e-4)
    assert e.other is not None
    ends = [p + moved.solve(p).displacement[:, :3] for p in (e.position, e.other)]
    stretch = np.linalg.norm(ends[1] - ends[0], axis=1) - np.linalg.norm(e.other - e.position, axis=1)
    np.testing.assert_allclose(e.reading[:, 6], stretch, atol=1e-11)


def test_encoders_read_the_drive(twin: Twin, orthoglide: sm.Machine) -> None:
    sides = ("--joint", "x.actuator", "--joint", "x.actuator:motor")
    e = twin(*FEW, *sides, "--noise", "1e-9", "--effect", "servo_share actuator x share=0.25")
    effort = orthoglide.solve(e.position, e.wrench).actuator_effort[:, 0]
    np.testing.assert_allclose(e.reading[:, 6], -1.4e-7 * effort, atol=1e-11)
    np.testing.assert_allclose(e.reading[:, 7], -0.25 * 1.4e-7 * effort, atol=1e-11)


def test_commanded_coordinates_are_the_poses(twin: Twin, orthoglide: sm.Machine) -> None:
    plain = twin(*POSITION, folder="plain")
    e = twin(*POSITION, "--command")
    assert np.isnan(e.position).all()
    located = residual(orthoglide, e).experiment
    np.testing.assert_allclose(located.position, plain.position, atol=1e-10)
    assert located.rotation is None


def test_a_grid_fills_the_workspace_but_for_its_border() -> None:
    machine = sm.load_machine("orthoglide-revised")
    low, high = machine.workspace
    p = grid_poses(machine, [3, 2, 1])
    assert p.shape == (6, 3)
    for axis, places in enumerate(([0.02, 0.5, 0.98], [0.02, 0.98], [0.5])):
        wanted = low[axis] + np.array(places) * (high[axis] - low[axis])
        assert np.unique(p[:, axis]) == pytest.approx(wanted, abs=1e-6)
