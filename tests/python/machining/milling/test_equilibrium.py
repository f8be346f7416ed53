"""Cut and deflection together: closed forms on a gantry, an oracle of root finding on a parallel machine."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.optimize import brentq, fsolve
from tests.python.machining.milling.gantry import gantry

import stiffmap as sm
from stiffmap.machining.milling import mill_job
from stiffmap.machining.process.description import Cut, EndMill, mean_force, widened
from stiffmap.machining.toolpath import outline, path_of
from stiffmap.solve.status import Status

LINE = path_of([[-0.05, 0, 0], [0.05, 0, 0]])


def lifting(kz: float, pull: float) -> tuple[float, float]:
    """A slot whose axial force is `pull` N/m of depth, on a drive of kz N/m: error along the tool and the gain."""
    process = sm.load_process("slot")
    law = EndMill(0.0, 0.0, 0.0, 0.0, 0.0, pull * 2 / process.tool.teeth)
    found = mill_job(gantry(z=1e3 / kz), LINE, replace(process, law=law), at=(0, 0, 0))
    return float(found.dataset.error_axial[3]), float(found.dataset.gain[3])


@pytest.mark.parametrize("pull", [2e3, -3e4, 2e4])
def test_depth_that_follows_the_deflection(pull: float) -> None:
    """e = F0/(k + kp): a tool that is pulled in (kp < 0) goes deeper, one that is pushed out less."""
    k, a = 1e5, 3e-3
    force = -pull * a  # along the tool to its holder
    kp = -pull  # -dF/de: lifting reduces the pull
    e, gain = lifting(k, pull)
    assert e == pytest.approx(force / (k + kp), rel=1e-9)
    assert gain == pytest.approx(kp / k, rel=1e-6)


def test_static_instability_is_said() -> None:
    process = sm.load_process("slot")
    law = EndMill(0.0, 0.0, 0.0, 0.0, 0.0, 1.2e5)
    found = mill_job(gantry(z=1e-2), LINE, replace(process, law=law), at=(0, 0, 0))
    assert (found.dataset.status.values == Status.UNSTABLE).all()
    assert np.isnan(found.dataset.error.values).all()
    assert found.dataset.gain.values.max() < -1
    from stiffmap.machining.milling import verdict

    assert "runs away" in verdict(found.dataset)


@pytest.mark.parametrize("side", ["climb", "conventional"])
def test_width_that_follows_the_deflection(side: str) -> None:
    """The scalar equation e = c F(a_e - e), by bracketing."""
    process = sm.load_process("trimming")
    process = replace(process, cut=replace(process.cut, side=side))
    c = 3e-7
    found = mill_job(gantry(y=1e3 * c), LINE, process, at=(0, 0, 0))
    off = 1.0 if side == "climb" else -1.0

    def rest(e: float) -> float:
        return e - c * off * float(mean_force(process, 4e-3 - e, 8e-3)[1])

    e = brentq(rest, -1e-3, 1e-3, xtol=1e-16)
    assert found.dataset.error_normal.values == pytest.approx(
        np.full(found.dataset.sizes["point"], e), rel=1e-9
    )
    slope = (mean_force(process, 4e-3 - e + 1e-7, 8e-3) - mean_force(process, 4e-3 - e - 1e-7, 8e-3))[
        1
    ] / 2e-7
    assert found.dataset.gain.values[0] == pytest.approx(c * off * slope, rel=1e-5)


def test_the_tools_own_bending() -> None:
    stiff = sm.load_process("trimming")
    tool = replace(stiff.tool, modulus=6e11)
    assert tool.compliance == pytest.approx(
        stiff.tool.stick_out**3 / (3 * 6e11 * np.pi * stiff.tool.diameter**4 / 64)
    )
    c = 3e-7
    a = mill_job(
        gantry(y=1e3 * (c + tool.compliance), x=1e3 * tool.compliance), LINE, stiff, at=(0, 0, 0)
    ).dataset
    b = mill_job(gantry(y=1e3 * c, x=1e-12), LINE, replace(stiff, tool=tool), at=(0, 0, 0)).dataset
    assert b.error_normal.values == pytest.approx(a.error_normal.values, rel=1e-9)


def test_a_parallel_machine_against_root_finding() -> None:
    """All three components and the reference path, one point at a time."""
    machine, process, path = (
        sm.load_machine("orthoglide-revised"),
        sm.load_process("trimming"),
        outline("circle"),
    )
    process = replace(process, cut=Cut("climb", 4e-3, 8e-3, through=False))
    found = mill_job(machine, path, process, at=(0.05, 0.05, 0.02), turn=0.3, step=0.02)
    job = found.job
    for k in (0, 7, 20):

        def rest(e: np.ndarray, k: int = k) -> np.ndarray:
            n, z = job.off[k], job.tool[k]
            w = widened(process, process.cut.radial - e @ n, job.engaged.curvature[k])
            local = mean_force(process, w, process.cut.axial - e @ z, job.faster[k])
            f = local @ np.array([job.tangent[k], n, -z])
            s = machine.solve(job.position[k], [*f, 0, 0, 0], method="reference")
            return 1e6 * (e - s.displacement[:3])

        e = fsolve(rest, np.zeros(3), xtol=1e-13)
        assert found.dataset.error.values[k] == pytest.approx(e, abs=1e-11)


def test_passes_spring_back() -> None:
    """A spring pass cuts what the last pass left: e' = c F(e - e')."""
    process, c = sm.load_process("trimming"), 1e-6
    ds = mill_job(gantry(y=1e3 * c), LINE, process, at=(0, 0, 0), passes=3).dataset
    left = ds.error_normal_passes.values[:, 5]
    for before, after in pairwise(left):
        e = brentq(lambda e, b=before: e - c * float(mean_force(process, max(b - e, 0), 8e-3)[1]), 0, before)
        assert after == pytest.approx(e, rel=1e-6)
    assert (np.diff(left) < 0).all()
