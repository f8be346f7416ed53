"""Moves that begin, end or pass along the tool: nothing is cut across there, and the rest is as without them."""

from __future__ import annotations

import numpy as np
import pytest
from tests.python.machining.milling.gantry import gantry

from stiffmap.machining.milling import mill_job
from stiffmap.machining.toolpath.gcode.load import load_gcode

HEAD = "G21 G90 G17 G94 S18000 M3\nG0 X0 Y0 Z5\nG1 Z1 F400\n"
REST = "G1 X30 F6000\nG0 Z5\nM5\nM30"
LEADS = {
    "down into the cut": ("G18 G2 X1 Z0 I1 K0 F600\nG17\n", ""),
    "the other way": ("G18 G3 X-1 Z0 I-1 K0 F600\nG17\n", None),
    "in the other plane": ("G0 X1 Y-1\nG19 G3 Y0 Z0 J1 K0 F600\nG17\n", ""),
    "two quarters": ("G18 G2 X0.5 Z0.5 I0.5 K0 F600\nG3 X1 Z0 I0 K-0.5\nG17\n", None),
    "half a circle over": ("G0 X-1 Z0\nG18 G2 X1 Z0 I1 K0 F600\nG17\n", ""),
}


@pytest.mark.parametrize("name", LEADS)
def test_a_lead_in_along_the_tool(name: str) -> None:
    lead, same = LEADS[name]
    path = load_gcode((HEAD + lead + REST).splitlines(), name="p")
    found = mill_job(gantry(x=4e-4, y=1e-3), path, "trimming", at=(0, 0, 0))
    ds, points = found.dataset, found.job.points
    assert np.isfinite(ds.error_normal.values).all()
    assert (ds.force.values[points.along] == 0).all()
    assert points.along.any()
    if same is not None:
        bare = load_gcode((HEAD.replace("X0", "X1").replace("Z1", "Z0") + REST).splitlines(), name="q")
        want = mill_job(gantry(x=4e-4, y=1e-3), bare, "trimming", at=(0, 0, 0)).dataset
        mine = ds.error_normal.values[points.move == np.flatnonzero(path.cuts)[-1]]
        assert mine[3:] == pytest.approx(want.error_normal.values[3:], rel=1e-9)


@pytest.mark.parametrize("turns", ["G2 X20 Y0 I10 J0 P2", "G3 X20 Y0 Z-2 I10 J0 P3", "G2 X0 Y0 I10 J0 P2"])
def test_every_turn_of_an_arc_is_written(turns: str) -> None:
    path = load_gcode(("G21 G90 G17 S18000 M3 F6000\nG0 X0 Y0 Z0\n" + turns + "\nM2").splitlines(), name="p")
    found = mill_job(gantry(x=4e-5, y=1e-4), path, "trimming", at=(0, 0, 0))
    p = found.program.path
    assert p.length[p.cuts].sum() == pytest.approx(path.length[path.cuts].sum(), rel=0.02)
