"""Compliance of the loaded machine along the force of a given toolpath (§6: stiffness in the working direction)."""

from __future__ import annotations

import numpy as np

from stiffmap.common.errors import StiffmapError
from stiffmap.solve.status import Status
from stiffmap.workspace.performance.registry import Case, Found, Measure, over_poses

MOST, QUICK = 201, 25


def compute(case: Case) -> Found:
    """Along the path, at the equilibrium under the path's own force: u'Cu, u the direction of the force."""
    position, force = case.path(QUICK if case.quick else MOST)
    size = np.linalg.norm(force, axis=1)
    if not (size > 0).any():
        raise StiffmapError("needs a force along the toolpath: give force in the motion file")
    position, force, unit = position[size > 0], force[size > 0], force[size > 0] / size[size > 0, None]
    s = case.machine.solve(
        position, np.hstack([force, np.zeros_like(force)]), rotation=case.rotation, gravity=case.gravity,
        threads=case.threads,
    )  # fmt: skip
    along = np.einsum("ni,nij,nj->n", unit, s.compliance[:, :3, :3], unit)
    return over_poses(position, np.where(s.status == Status.CONVERGED, along, np.nan), "low")


MEASURE = Measure(
    "path_compliance",
    "compliance along the force of the toolpath",
    "m/N",
    "low",
    compute,
    "µm/N",
    1e6,
    order=31,
)
