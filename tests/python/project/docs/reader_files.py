"""Files of the reader's own that pages and ``--help`` speak of."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

import stiffmap as sm
from stiffmap.machining.process.force import revolution

ROBOT = """<robot name="arm"><link name="base"><visual><geometry><box size="0.1 0.1 0.3"/></geometry></visual></link><link name="upper"/><link name="tool"/>
<joint name="q1" type="revolute"><origin xyz="0 0 0.3"/><axis xyz="0 0 1"/><parent link="base"/><child link="upper"/>
<limit lower="-2" upper="2" effort="100" velocity="2"/></joint>
<joint name="q2" type="revolute"><origin xyz="0.4 0 0"/><axis xyz="0 1 0"/><parent link="upper"/><child link="tool"/>
<limit lower="-2" upper="2" effort="80" velocity="2"/></joint></robot>
"""
FORCES = """feed_per_tooth_mm,Fx_N,Fy_N,Fz_N,teeth,axial_mm
0.025,39.8,63.0,55.7,2,3
0.05,60.1,107.1,70.9,2,3
0.075,71.6,137.7,82.6,2,3
0.1,76.8,171.3,85.2,2,3
0.125,78.5,210.7,83.5,2,3
"""
"""Means of a dynamometer; slots."""


def force_signals() -> str:
    """Signals of the shipped slot at four feeds, with run-out and noise."""
    rng, p = np.random.default_rng(3), sm.load_process("slot")
    rows = ["feed_per_tooth_mm,time_s,Fx_N,Fy_N,Fz_N,teeth,axial_mm,spindle_rpm,diameter_mm,helix_deg"]
    for chip in (0.05, 0.075, 0.1, 0.125):
        cut = replace(p, feed=0.2 * chip, tool=replace(p.tool, runout=12e-6))
        force = np.tile(revolution(cut, 100, 20)[1], (3, 1))
        force += rng.normal(0, 2, force.shape)
        rows += [
            f"{chip},{k / 1e4:g},{','.join(f'{v:.3f}' for v in f)},2,3,6000,25,30"
            for k, f in enumerate(force)
        ]
    return "\n".join(rows) + "\n"


def link_arrays() -> dict[str, Any]:
    """A displacement field with its loads, as a page takes it as given."""
    rng = np.random.default_rng(1)
    points = rng.uniform(-0.03, 0.03, (60, 3))
    compliance = np.diag([1e-8, 3e-6, 2e-6, 1e-4, 2e-4, 3e-4])
    wrenches = np.diag([100.0, 10, 10, 1, 1, 1])
    twists = wrenches @ compliance
    displacements = np.array([t[:3] + np.cross(t[3:], points) for t in twists])
    displacements += 1e-9 * rng.standard_normal(displacements.shape)
    return {"points": points, "displacements": displacements, "wrenches": wrenches,
            "reference": np.zeros(3), "other_point": np.array([0.1, 0, 0])}  # fmt: skip


def link_tables() -> tuple[str, str]:
    """The same as the two tables of `stiffmap link`, mm and N·mm."""
    a = link_arrays()
    each = range(len(a["displacements"]))
    field = [",".join(["x [mm],y [mm],z [mm]", *("ux [mm],uy [mm],uz [mm]" for _ in each)])]
    for i, p in enumerate(a["points"]):
        values = [1e3 * p + [310, 0, 0], *(1e3 * a["displacements"][case][i] for case in each)]
        field.append(",".join(f"{v:.12g}" for three in values for v in three))
    cases = ["fx [N],fy [N],fz [N],mx [N*mm],my [N*mm],mz [N*mm]"]
    cases += [",".join(f"{v:g}" for v in [*w[:3], *(1e3 * w[3:])]) for w in a["wrenches"]]
    return "\n".join(field) + "\n", "\n".join(cases) + "\n"


ARM_DH = "theta [deg],d [mm],a [mm],alpha [deg]\n0,89,0,90\n0,0,-425,0\n0,0,-392,0\n0,109,0,90\n0,95,0,-90\n0,82,0,0\n"


def joint_table(rows: int = 40) -> str:
    """Commanded joints (deg) of the arm of `ARM_DH` and what a tracker saw of a reflector on its flange (mm), by the table's matrices."""
    rng = np.random.default_rng(0)
    table = [tuple(map(float, line.split(","))) for line in ARM_DH.splitlines()[1:]]
    out = ["q1,q2,q3,q4,q5,q6,px [mm],py [mm],pz [mm]"]
    for q in rng.uniform((-90, -120, 40, -140, -120, -90), (90, -40, 130, -40, -40, 90), (rows, 6)):
        pose = np.eye(4)
        for (_, d, a, alpha), angle in zip(table, np.radians(q), strict=True):
            c, s, ca, sa = np.cos(angle), np.sin(angle), np.cos(np.radians(alpha)), np.sin(np.radians(alpha))
            pose = pose @ [
                [c, -s * ca, s * sa, a * c],
                [s, c * ca, -c * sa, a * s],
                [0, sa, ca, d],
                [0, 0, 0, 1],
            ]
        seen = (pose @ [20.0, 30.0, 50.0, 1.0])[:3] + 0.03 * rng.standard_normal(3)
        out.append(",".join(f"{v:.4f}" for v in (*q, *seen)))
    return "\n".join(out) + "\n"
