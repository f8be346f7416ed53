"""One block of a map's rows."""

from __future__ import annotations

from typing import Any

import numpy as np

from stiffmap.common.broadcasting import Floats
from stiffmap.solve.kinematics import inverse_kinematics
from stiffmap.solve.validity import Validity
from stiffmap.workspace.maps.direction_sweep import DirectionSweep, even_directions
from stiffmap.workspace.maps.extremes import find_extreme
from stiffmap.workspace.maps.fixed_order_sums import norm
from stiffmap.workspace.maps.limit import force_limit
from stiffmap.workspace.maps.loading import without_failed
from stiffmap.workspace.maps.plan import MapPlan
from stiffmap.workspace.maps.uncertainty_block import load_deviations, worst_deviations
from stiffmap.workspace.maps.variables import BEYOND

ALL = (0, 1, 2)


def solve_block(plan: MapPlan, rows: slice) -> dict[str, Any]:
    """Every variable of some rows, shaped (poses, ...)."""
    position = plan.positions(rows)
    out = _loads(plan, position)
    if plan.validity is not None:
        out[BEYOND] = _beyond(plan, plan.validity, position)
    if plan.uncertain is not None:
        out |= load_deviations(plan, plan.uncertain, position)
    if plan.turning:
        directions = even_directions(plan.loading, position, plan.force, plan.axes, plan.directions)
        out["direction_status"] = directions.status.max(axis=1)
        extremes: dict[str, Floats] = {}
        for suffix, parts in (("", ALL), (f"_{plan.shown_plane}", plan.axes)):
            values, status = _extremes(plan, position, directions, parts, suffix)
            extremes |= values
            out["direction_status"] = np.maximum(out["direction_status"], status)
        # one status for all of them: where the worst is not known, the best is not either
        out |= {n: np.where(out["direction_status"] == 0, v, np.nan) for n, v in extremes.items()}
        if plan.uncertain is not None:
            out |= worst_deviations(plan, plan.uncertain, position, out)
    return out


def _loads(plan: MapPlan, position: Floats) -> dict[str, Any]:
    s = plan.loading.solve(position[:, None], plan.wrenches, stiffness=plan.compliance)
    d = without_failed(s.displacement, s.status)
    out: dict[str, Any] = {
        "displacement": d,
        "deflection": norm(d[..., :3]),
        f"deflection_{plan.shown_plane}": norm(d[..., plan.axes]),
        "status": s.status,
        "flags": s.flags,
    }
    if plan.compliance:
        out["compliance"] = without_failed(s.compliance, s.status)
    return out


def _beyond(plan: MapPlan, covered: Validity, position: Floats) -> Any:
    """(poses, cases)."""
    machine = plan.loading.machine
    r = plan.loading.options.rotation
    turns = None if r is None else np.broadcast_to(np.asarray(r, dtype=float), (len(position), 3, 3))
    at = inverse_kinematics(machine, position, turns).coordinates
    each = [covered.outside(machine, at, np.broadcast_to(w, (len(position), 6))) for w in plan.wrenches]
    return np.stack(each, axis=-1).astype(np.uint8)


def _extremes(
    plan: MapPlan, position: Floats, directions: DirectionSweep, parts: tuple[int, ...], suffix: str
) -> tuple[dict[str, Floats], Any]:
    worst, best = (
        find_extreme(plan.loading, position, plan.force, plan.axes, directions, parts, sign)
        for sign in (1, -1)
    )
    limit = force_limit(plan.loading, position, plan.force, plan.axes, worst, parts, plan.tolerance)
    values = {
        f"worst_deflection{suffix}": worst.value,
        f"worst_direction{suffix}": worst.angle,
        f"best_deflection{suffix}": best.value,
        f"best_direction{suffix}": best.angle,
        f"force_limit{suffix}": np.where(np.isnan(worst.value), np.nan, limit),
    }
    return values, np.maximum(worst.status, best.status)
