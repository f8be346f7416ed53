"""One block of a map's rows, and who solves all of them: this process block by block, or the workers of a cluster tile by tile."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from stiffmap.common.broadcasting import Floats, whole_number
from stiffmap.common.tasks import workers
from stiffmap.solve.kinematics import inverse_kinematics
from stiffmap.solve.solution import Solution
from stiffmap.solve.validity import Validity
from stiffmap.workspace.maps.extremes import ALL, TurningForce, direction, even_angles
from stiffmap.workspace.maps.loading import Loading, deflections, norm, without_failed
from stiffmap.workspace.maps.plan import BEYOND, MapPlan, blocks_of
from stiffmap.workspace.maps.uncertainty import Uncertain


def solve_block(plan: MapPlan, rows: slice) -> dict[str, np.ndarray]:
    """Every variable of some rows, shaped (poses, ...)."""
    position = plan.positions(rows)
    out = _loads(plan, position)
    if plan.validity is not None:
        out[BEYOND] = _beyond(plan, plan.validity, position)
    if plan.uncertain is not None:
        out |= load_deviations(plan, plan.uncertain, position)
    if plan.turning:
        angle = np.broadcast_to(even_angles(plan.directions), (len(position), plan.directions))
        force = TurningForce(plan.loading, position, plan.force, plan.axes)
        directions = force.solve(angle)
        out["direction_status"] = directions.status.max(axis=1)
        extremes: dict[str, Floats] = {}
        for suffix, parts, worst, best in force.extremes(directions, plan.shown_plane):
            limit = force.limit(worst, parts, plan.tolerance)
            extremes |= {
                f"worst_deflection{suffix}": worst.value,
                f"worst_direction{suffix}": worst.angle,
                f"best_deflection{suffix}": best.value,
                f"best_direction{suffix}": best.angle,
                f"force_limit{suffix}": np.where(np.isnan(worst.value), np.nan, limit),
            }
            for one in (worst, best):
                out["direction_status"] = np.maximum(out["direction_status"], one.status)
        # one status for all of them: where the worst is not known, the best is not either
        out |= {n: np.where(out["direction_status"] == 0, v, np.nan) for n, v in extremes.items()}
        if plan.uncertain is not None:
            out |= worst_deviations(plan, plan.uncertain, position, out)
    return out


def _loads(plan: MapPlan, position: Floats) -> dict[str, np.ndarray]:
    s = plan.loading.solve(position[:, None], plan.wrenches, stiffness=plan.compliance)
    out: dict[str, np.ndarray] = {
        **deflections(without_failed(s.displacement, s.status), plan.shown_plane),
        "status": s.status,
        "flags": s.flags,
    }
    if plan.compliance:
        out["compliance"] = without_failed(s.compliance, s.status)
    return out


def _beyond(plan: MapPlan, covered: Validity, position: Floats) -> NDArray[np.uint8]:
    """(poses, cases)."""
    machine = plan.loading.machine
    r = plan.loading.options.rotation
    turns = None if r is None else np.broadcast_to(np.asarray(r, dtype=float), (len(position), 3, 3))
    at = inverse_kinematics(machine, position, turns).coordinates
    each = [covered.outside(machine, at, np.broadcast_to(w, (len(position), 6))) for w in plan.wrenches]
    return np.stack(each, axis=-1).astype(np.uint8)


def load_deviations(plan: MapPlan, uncertain: Uncertain, position: Floats) -> dict[str, np.ndarray]:
    """Standard deviations under the load cases, at positions (poses, 3)."""
    s, j = sensitivities(plan.loading, uncertain, position[:, None], plan.wrenches)
    d = without_failed(s.displacement, s.status)
    std, parts = deviation(j, d, ALL, uncertain.covariance)
    variance = np.einsum("...pk,pq,...qk->...k", j, uncertain.covariance, j)
    with np.errstate(invalid="ignore", divide="ignore"):
        share = parts / (std**2)[..., None]
    return {
        "displacement_std": np.sqrt(np.maximum(variance, 0.0)),
        "deflection_std": std,
        f"deflection_{plan.shown_plane}_std": deviation(j, d, plan.axes, uncertain.covariance)[0],
        "variance_share": share,
    }


def worst_deviations(
    plan: MapPlan, uncertain: Uncertain, position: Floats, extremes: dict[str, np.ndarray]
) -> dict[str, np.ndarray]:
    """Standard deviation of the deflection in the worst direction.

    The direction itself moves with the numbers, but that adds nothing to first order: it is an extremum.
    """
    out = {}
    for suffix, parts in (("", ALL), (f"_{plan.shown_plane}", plan.axes)):
        along = direction(np.nan_to_num(extremes[f"worst_direction{suffix}"]), plan.axes)
        wrench = np.concatenate([plan.force * along, np.zeros_like(along)], axis=-1)
        s, j = sensitivities(plan.loading, uncertain, position, wrench)
        std = deviation(j, without_failed(s.displacement, s.status), parts, uncertain.covariance)[0]
        failed = np.isnan(extremes[f"worst_deflection{suffix}"])
        out[f"worst_deflection{suffix}_std"] = np.where(failed, np.nan, std)
    return out


def sensitivities(
    loading: Loading, uncertain: Uncertain, position: Floats, wrench: Floats
) -> tuple[Solution, Floats]:
    """Equilibria (...) and the derivatives (..., P, 6) of their displacement; NaN where a pose failed."""
    s, varied = loading.solve_varied(position, wrench, uncertain.machines)
    slope = (varied[..., 1::2, :] - varied[..., 0::2, :]) / (2 * uncertain.steps[:, None])
    return s, without_failed(slope, s.status)


def deviation(j: Floats, d: Floats, parts: tuple[int, ...], covariance: Floats) -> tuple[Floats, Floats]:
    """Standard deviation (...) of the norm of the components `parts`, and its variance by number (..., P).

    A number's part is its own variance and half of what it shares with each correlated one. NaN where the
    deflection is zero and uncertain: its norm has no slope there.
    """
    size = norm(d[..., parts])
    with np.errstate(invalid="ignore", divide="ignore"):
        unit = d[..., parts] / size[..., None]
    slope = np.einsum("...pk,...k->...p", j[..., parts], unit)
    still = (size == 0) & ~np.any(j[..., parts], axis=(-2, -1))
    slope = np.where(still[..., None], 0.0, slope)
    shares = slope * np.einsum("pq,...q->...p", covariance, slope)
    return np.sqrt(np.maximum(shares.sum(axis=-1), 0.0)), shares


POSES_AT_ONCE = 1024
PART = 8192  # poses at least that are kept at once, which a power cut may cost


def solve_rows(plan: MapPlan, rows: slice, poses: int = POSES_AT_ONCE) -> dict[str, np.ndarray]:
    """Every variable (rows, x, ...) of some rows, solved block by block."""
    parts = [solve_block(plan, block) for block in blocks_of(rows, plan.x.size, poses)]
    shape = (rows.stop - rows.start, plan.x.size)
    return {
        v.name: np.concatenate([p[v.name] for p in parts]).reshape(shape + plan.tail(v))
        for v in plan.variables
    }


@dataclass(frozen=True)
class Work:
    """Who solves a map: this process, about so many poses at once, or the workers of a cluster."""

    poses: int
    scheduler: object = None  # address of a dask scheduler, or a `distributed.Client`

    def parts(self, plan: MapPlan) -> list[slice]:
        """All rows, in parts that are kept as soon as they are solved."""
        if self.scheduler is None:
            return blocks_of(slice(0, plan.rows), plan.x.size, max(self.poses, PART))
        return plan.tiles

    def solved(self, plan: MapPlan, parts: Sequence[slice]) -> Iterator[tuple[int, dict[str, np.ndarray]]]:
        """Number and values of each part: in order here, as they come from a cluster."""
        if self.scheduler is None:
            yield from ((i, solve_rows(plan, rows, self.poses)) for i, rows in enumerate(parts))
            return
        with workers(solve_rows, plan, scheduler=self.scheduler) as cluster:
            yield from cluster.as_done(parts)


def work_of(chunk: int | None, scheduler: object) -> Work:
    """By the arguments `chunk` and `scheduler` of `stiffmap.error_map`."""
    return Work(POSES_AT_ONCE if chunk is None else whole_number(chunk, "chunk", 1), scheduler)
