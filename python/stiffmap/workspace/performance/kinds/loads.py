"""Under load: the deflection in a plane, force in its worst direction there; what a given toolpath asks of the machine (§6: stiffness in
the working direction; equation (4))."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from stiffmap.common.errors import StiffmapError
from stiffmap.common.number_text import vector_text
from stiffmap.solve.budget import budget_where_stable, in_shares
from stiffmap.solve.status import Status
from stiffmap.workspace.performance.limits.deflection import TURNS, worst_deflection
from stiffmap.workspace.performance.motion.closing import drive_values
from stiffmap.workspace.performance.motion.efforts import drive_efforts
from stiffmap.workspace.performance.registry import Case, Found, Measure, over_poses


def deflection(case: Case) -> Found:
    """Over the box: a coarse grid of equilibria, then a search about its worst node; among designs the grid alone, each force
    along the direction in which the unloaded machine is weakest."""
    d = worst_deflection(
        case.machine, box=np.stack([case.low, case.high]), force=case.force, plane=case.plane,
        nodes=case.coarse, turns=0 if case.quick else TURNS, refine=not case.quick, rotation=case.rotation,
        gravity=case.gravity, threads=case.threads,
    )  # fmt: skip
    note = f"under {case.force:.4g} N"
    if np.isfinite(d.value) and not case.quick:
        note += f" along {vector_text(d.direction, 3)}"
        wrench = np.append(case.force * d.direction, np.zeros(3))
        budget = budget_where_stable(
            case.machine, d.position, wrench, rotation=case.rotation, gravity=case.gravity
        )
        note += f"; {in_shares({n: s for n, _, s in budget.ranked()})}" if budget is not None else ""
    found = over_poses(d.positions, d.values, "low", note, direction=d.direction)
    return replace(found, worst=d.value, worst_at=d.position)


MOST, QUICK = 201, 25  # samples of a toolpath


def path_compliance(case: Case) -> Found:
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


def path_effort(case: Case) -> Found:
    """Inverse dynamics along the motion, forces on the tool included."""
    motion = case.motion
    if case.rotation is not None:
        raise StiffmapError("along a motion the tool is turned as at home: leave rotation out")
    most = drive_values(case.machine, "force", None, "N or N·m")
    run = motion.trajectory(case.machine, gravity=case.gravity)
    e = drive_efforts(case.machine, run, gravity=case.gravity)
    share = np.abs(e["effort"].values) / most
    when, drive = np.unravel_index(int(np.argmax(share)), share.shape)
    note = f"{case.machine.actuators[drive]}: {abs(float(e['effort'].values[when, drive])):.4g} at {run.time[when]:.3g} s"
    return Found(
        float(share.max()), run.position[when], note=note, positions=run.position, values=share.max(axis=1),
        extra={"share": share, "drives": case.machine.actuators, "time": run.time},
    )  # fmt: skip


MEASURES = (
    Measure("deflection", "deflection in the plane", "m", "low", deflection, "mm", 1e3, order=30),
    Measure("path_compliance", "compliance along the force of the toolpath", "m/N", "low", path_compliance, "µm/N", 1e6, order=31),
    Measure("path_effort", "share of the drives' efforts along the toolpath", "", "low", path_effort, order=44),
)  # fmt: skip
