"""Stability along a path: where it chatters, which speeds are offered, and where it cannot be judged."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.python.machining.milling.gantry import gantry

import stiffmap as sm
from stiffmap.machining.milling import mill_job, verdict
from stiffmap.machining.milling.equilibrium import Plant, equilibrium
from stiffmap.machining.milling.job import ripple
from stiffmap.machining.milling.setting import setting
from stiffmap.machining.process.force import revolution
from stiffmap.machining.toolpath import path_of, sampled
from stiffmap.model.description import Body
from stiffmap.solve.status import Status
from stiffmap.ui.report.milling import summary

MASS, RATIO = 20.0, 0.02


def massive():
    d = gantry(2e-4, 1e-4, 1e-5).description
    return sm.Machine(replace(d, platform=(*d.platform, Body("spindle", MASS)), modal_damping=(RATIO,)))


def milled(depth):
    p = sm.load_process("slot")
    p = replace(p, cut=replace(p.cut, axial=depth))
    return mill_job(massive(), path_of([[-0.05, 0, 0], [0.05, 0, 0]]), p, step=10e-3)


def test_a_path_that_chatters_is_a_warning_with_speeds_that_are_stable():
    found = milled(1e-3)
    s = found.stability
    rows = [
        (np.sqrt(k / MASS) / (2 * np.pi), RATIO, MASS, way) for k, way in ((5e6, "x"), (1e7, "y"), (1e8, "z"))
    ]
    p = found.job.process
    by_rows = sm.floquet_multiplier(rows, p, p.spindle, 1e-3, intervals=80)
    np.testing.assert_allclose(s.multiplier, by_rows, rtol=1e-3)
    assert by_rows > 1 and s.unstable == len(s.way) and s.offered.size
    for w in s.offered:
        assert sm.floquet_multiplier(rows, p, float(w), 1e-3, intervals=80) < 1
    (said,) = [w for w in found.warnings if w.name == "chatter"]
    assert said.points.all() and "rpm" in said.text and said.finding
    first = summary(found)["verdict"].split(". ")[0]
    assert first.startswith("The cut chatters at") and found.stability.damping in first


@pytest.mark.parametrize("worst", ["NOT_CONVERGED", "UNSTABLE", "chatter", "drive effort"])
def test_the_headline_is_the_worst_verdict(worst):
    ds = milled(1e-6).dataset.copy(deep=True)
    ds.attrs["tolerance"] = 1.0
    assert verdict(ds).startswith("The part is off") and "within it compensated" in verdict(ds)
    if worst in Status.__members__:
        ds.status[0] = Status[worst]
        assert "equilibrium" in verdict(ds) or "runs away" in verdict(ds)
        assert "within" not in verdict(ds)
    elif worst == "chatter":
        ds.multiplier[0] = 1.1
        ds.multiplier.attrs["said"] = "The cut chatters at 1 of 3 places."
        assert verdict(ds).startswith("The cut chatters at 1 of 3 places.")
    else:
        ds.warnings.attrs["names"] = [worst]
        assert verdict(ds).startswith(f"Limits are broken: {worst}.")


def test_a_shallow_cut_is_stable_and_said_so():
    found = milled(1e-6)
    assert "stable at" in summary(found)["stability"]["sentence"]
    assert not any(w.name == "chatter" for w in found.warnings)


def test_without_masses_it_is_not_judged():
    found = mill_job(gantry(), path_of([[-0.05, 0, 0], [0.05, 0, 0]]), sm.load_process("slot"), step=20e-3)
    assert "Stability is not judged" in found.stability and "masses" in found.stability


def test_no_stable_speed_asks_for_less_depth():
    from stiffmap.machining.milling.speed import PathStability

    s = PathStability(np.zeros(2), np.array([1.2, 0.9]), np.linspace(50, 150, 5), np.full(5, 1.3), "")
    assert not s.offered.size and "take less depth" in s.sentence(100.0)
    s = PathStability(
        np.zeros(2), np.array([1.2, 0.9]), np.linspace(50, 150, 5), np.array([1.3, 0.9, 1.2, 0.8, 0.9]), ""
    )
    assert list(s.offered) == [75.0, 125.0, 150.0] and "1 of 2 places" in s.sentence(100.0)


@pytest.mark.parametrize("side", ["climb", "conventional"])
@pytest.mark.parametrize("turn", [0.0, 0.5, np.pi / 4, 2.2, -1.0])
def test_ripple_is_what_the_force_of_a_revolution_moves_across_the_wall(side, turn):
    """Slides of two stiffnesses, moved step by step through a revolution; a sine of the teeth's passing fitted to the way."""
    d = gantry(2e-4, 1e-4, 1e-5).description
    light = sm.Machine(replace(d, platform=(*d.platform, Body("spindle", 0.05))))
    p = sm.load_process("slot")
    p = replace(p, spindle=p.spindle / 4, feed=p.feed / 4, cut=replace(p.cut, side=side, radial=6e-3))
    path = path_of([[-0.05, 0, 0], [0.05, 0, 0]])
    job = setting(light, path, p, sampled(path, 5e-2), path.placed((0, 0, 0), turn))
    feed = np.array([np.cos(turn), np.sin(turn), 0.0])
    left = np.array([-np.sin(turn), np.cos(turn), 0.0])
    angle, force = revolution(p)
    in_base = force[:, :1] * feed + force[:, 1:2] * left - force[:, 2:] * [0, 0, 1]
    across = in_base * [2e-7, 1e-7, 1e-8] @ left
    phase = p.tool.teeth * angle
    wave = np.linalg.lstsq(np.stack([np.cos(phase), np.sin(phase), 1 + 0 * phase], axis=1), across)[0]
    found = ripple(job, equilibrium(Plant(job), job.position))
    assert found == pytest.approx(np.full(len(job), np.hypot(*wave[:2])), rel=1e-6)
