"""Rows chosen for their information, by exchange.

Every candidate row adds the matrix XᵀX of its whitened sensitivities X (parameters, then nuisances) to the
information M. ``identify``: largest log det M less that of the nuisances alone (D_s-optimality). ``separate``:
largest length of the first explanation's signal that the rival's best fit leaves (T-optimality; A. C. Atkinson,
V. V. Fedorov, Biometrika 62, 1975). ``map``: smallest mean variance of what the machine is predicted to do at
given poses (I-optimality). Rows are taken one after the other, then exchanged while that gains
(V. V. Fedorov, Theory of Optimal Experiments, 1972).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from stiffmap.common.broadcasting import Floats, one_of, random_numbers, whole_number
from stiffmap.common.errors import StiffmapError
from stiffmap.common.short import short_repr
from stiffmap.experiment.experiment import PER_ROW, Experiment
from stiffmap.experiment.virtual.plans import load_set, plan_of_poses, random_poses
from stiffmap.identification.planning.estimate import Estimate, estimate, fitted
from stiffmap.identification.planning.information import (
    Information,
    exchange,
    information_of,
    map_weight,
    of_map,
)
from stiffmap.model.description import AppliedEffect
from stiffmap.solve.kinematics import inverse_kinematics
from stiffmap.solve.machine import Machine
from stiffmap.solve.status import Flag

AIMS = ("identify", "separate", "map")
UNKNOWN = ("known", "offset_unknown", "unknown")
RANDOM = 20
"""Random plans for comparison with the chosen one."""


@short_repr
@dataclass(frozen=True, eq=False)
class Design:
    """Chosen rows, and how they compare."""

    experiment: Experiment
    """The rows, without readings."""
    aim: str
    names: tuple[str, ...]
    units: tuple[str, ...]
    sigma: Floats
    """(k,) expected standard uncertainty of each parameter, SI; inf where the rows do not determine it."""
    random_sigma: Floats
    """(k,) median of random plans of the same size."""
    value: float
    """``identify``: log det; ``separate``: standard deviations between the rivals; ``map``: m, rms."""
    random_value: float

    def as_plain(self) -> dict[str, Any]:
        """Data of JSON, SI."""
        each = zip(self.names, self.units, self.sigma, self.random_sigma, strict=True)
        return {
            "aim": self.aim,
            "rows": len(self.experiment),
            "parameters": [{"name": n, "unit": u, "u": s, "u_random": r} for n, u, s, r in each],
            "value": self.value,
            "value_random": self.random_value,
        }


def design(
    machine: Machine,
    terms: Sequence[AppliedEffect],
    *,
    rows: int,
    aim: str = "identify",
    rival: Sequence[AppliedEffect] = (),
    quantity: str = "deflection",
    poses: int = 60,
    force: float = 400.0,
    candidates: Experiment | None = None,
    at: Floats | None = None,
    load: Floats | None = None,
    frame: str = "known",
    tool: str = "known",
    axes: Sequence[str] = ("dx", "dy", "dz"),
    noise: float | None = None,
    seed: int = 0,
    done: Experiment | None = None,
) -> Design:
    """The `rows` candidate rows that are most informative on the numbers in `terms`.

    Parameters
    ----------
    terms, rival
        Effects with the values at which they are to be identified; the rival's numbers are fitted away.
    aim
        ``identify``, ``separate`` (needs `rival`) or ``map`` (at the poses `at` (m, 3) under the wrench `load`
        (6,); None: the workspace's corners, under `force` along x).
    candidates
        Rows to choose from, each at most once; None: `poses` random poses of the workspace, for deflections
        under ± `force` along x, y, z. Rows out of reach or beyond a drive's range are left out.
    frame, tool
        What the instrument leaves unknown, as in an experiment file.
    noise
        One standard deviation of a reading, m; None: 3 µm for deflections, 8 µm for positions.
    done
        Rows that have been measured already: their information counts.

    Raises
    ------
    StiffmapError
        For bad input.
    """
    one_of(aim, AIMS, "aim")
    if aim == "separate" and not rival:
        raise StiffmapError("rival: separating two explanations needs the other one")
    whole_number(rows, "rows", 1)
    one_of(frame, UNKNOWN, "frame")
    one_of(tool, UNKNOWN, "tool")
    if candidates is None:
        where, loads = random_poses(machine, poses, seed), load_set("axes", [force])
        candidates = plan_of_poses(machine, quantity, where, loads, axes=axes, noise=noise)
    pool = replace(in_limits(machine, candidates), frame=frame, tool=tool)
    old = 0 if done is None else len(done)
    both = pool if done is None else _numbered(joined(replace(done, frame=frame, tool=tool), pool))
    each = Information(machine, both, tuple(terms), tuple(rival) if aim == "separate" else ())
    weight = map_weight(machine, tuple(terms), at, load, force) if aim == "map" else None

    def value(m: Floats) -> Floats:
        return information_of(m, each.wanted) if weight is None else of_map(m, weight)

    start = each.matrices[:old].sum(axis=0)
    free = np.arange(old, len(both), dtype=np.intp)
    if rows > len(free):
        raise StiffmapError(
            f"rows: expected at most the {len(free)} candidates that can be reached, got {rows}"
        )
    picked = exchange(each.matrices, start, free, rows, value)
    rng = random_numbers(seed)
    plans = [picked, *(rng.choice(free, rows, replace=False) for _ in range(RANDOM))]
    sigma = [each.sigma(np.append(np.arange(old, dtype=np.intp), p)) for p in plans]
    scores = value(np.stack([start + each.matrices[p].sum(axis=0) for p in plans]))
    natural = scores if aim == "identify" else np.exp(scores / 2) if weight is None else np.sqrt(-scores)
    return Design(
        _numbered(both.rows(np.sort(picked).astype(np.intp))),
        aim,
        each.names,
        each.units,
        sigma[0],
        np.median(sigma[1:], axis=0),
        float(natural[0]),
        float(np.median(natural[1:])),
    )


def _numbered(rows: Experiment) -> Experiment:
    """With names and order from 1 on."""
    number = np.arange(1, len(rows) + 1)
    return replace(rows, ids=tuple(map(str, number)), order=number.astype(float))


def follow(
    machine: Machine,
    terms: Sequence[AppliedEffect],
    measure: Callable[[Experiment], Experiment],
    *,
    until: float,
    batch: int = 6,
    most: int = 120,
    seed: int = 0,
    **options: object,
) -> list[tuple[int, Estimate]]:
    """Measure in batches, each planned at the values found so far, until every number is known well enough.

    measure
        Gives the rows of a plan their readings: a person, or `simulate` for a twin.
    until
        Standard uncertainty of every parameter over its typical size at which to stop.

    Number of rows and the estimate after each batch; the last one meets `until`, or `most` rows are used.
    """
    found: list[tuple[int, Estimate]] = []
    data: Experiment | None = None
    now = tuple(terms)
    while data is None or len(data) < most:
        plan = design(machine, now, rows=batch, done=data, seed=seed + len(found), **options)  # type: ignore[arg-type]
        new = measure(plan.experiment)
        data = new if data is None else _numbered(joined(data, new))
        result = estimate(machine, data, now)
        found.append((len(data), result))
        now = result.terms
        scale = np.array([p.scale for _, p in fitted(machine.description, now)])
        if (result.sigma * result.misfit / scale).max() <= until:
            break
    return found


OFF_LIMITS = Flag.DRIVE_RANGE | Flag.JOINT_LIMIT


def in_limits(machine: Machine, plan: Experiment) -> Experiment:
    """Rows whose pose is within reach and limits."""
    if plan.command is not None:
        return plan
    at = inverse_kinematics(machine, plan.position, plan.rotation)
    good = np.isfinite(at.position).all(axis=1) & ((at.flags & OFF_LIMITS) == 0)
    if not good.any():
        raise StiffmapError(f"{machine.name}: no candidate pose is within the drives' range")
    return plan.rows(np.asarray(good))


def joined(a: Experiment, b: Experiment) -> Experiment:
    """The rows of both; what one of them does not record is recorded by neither."""

    def both(name: str) -> object:
        one, other = getattr(a, name), getattr(b, name)
        if one is None or other is None:
            return None
        if isinstance(one, tuple):
            return (*one, *other) if len(one) and len(other) else ()
        return np.concatenate([one, other])

    return replace(a, **{name: both(name) for name in PER_ROW}, absolute={})  # type: ignore[arg-type]
