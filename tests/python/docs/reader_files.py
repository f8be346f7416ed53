"""Files of the reader's own that pages and ``--help`` speak of."""

from __future__ import annotations

from typing import Any

import numpy as np

ROBOT = """<robot name="arm"><link name="base"/><link name="upper"/><link name="tool"/>
<joint name="q1" type="revolute"><origin xyz="0 0 0.3"/><axis xyz="0 0 1"/><parent link="base"/><child link="upper"/>
<limit lower="-2" upper="2" effort="100" velocity="2"/></joint>
<joint name="q2" type="revolute"><origin xyz="0.4 0 0"/><axis xyz="0 1 0"/><parent link="upper"/><child link="tool"/>
<limit lower="-2" upper="2" effort="80" velocity="2"/></joint></robot>
"""


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
    field = ["case,x,y,z,ux,uy,uz"]
    for case, u in enumerate(a["displacements"]):
        for p, d in zip(a["points"], u, strict=True):
            values = [*(1e3 * p + [310, 0, 0]), *(1e3 * d)]
            field.append(",".join([f"c{case}", *(f"{v:.12g}" for v in values)]))
    cases = ["case,fx,fy,fz,mx,my,mz"]
    for case, w in enumerate(a["wrenches"]):
        cases.append(",".join([f"c{case}", *(f"{v:g}" for v in [*w[:3], *(1e3 * w[3:])])]))
    return "\n".join(field) + "\n", "\n".join(cases) + "\n"
