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
from os import PathLike
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from stiffmap.common.arguments import checked
from stiffmap.common.broadcasting import Floats, one_of, random_numbers, trailing, whole_number, wrench_array
from stiffmap.common.errors import StiffmapError
from stiffmap.common.short import short_repr
from stiffmap.experiment.calls import Effects, as_experiment, effects_of
from stiffmap.experiment.experiment import PER_ROW, Experiment
from stiffmap.experiment.virtual.plans import load_set, numbered_anew, plan_of_poses, random_poses
from stiffmap.identification.planning.estimate import Estimate, estimate
from stiffmap.identification.planning.information import (
    Information,
    exchange,
    information_of,
    map_weight,
    of_map,
)
from stiffmap.model.files.load import Source
from stiffmap.solve.kinematics import inverse_kinematics
from stiffmap.solve.machine import Machine, as_machine
from stiffmap.solve.status import Flag
from stiffmap.workspace.maps.inputs import magnitude

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

    def lines(self) -> list[str]:
        """In words, with random plans next to it."""
        out = [
            f"{len(self.experiment)} rows chosen; for comparison the median of 20 random plans of the same size"
        ]
        if self.aim == "separate":
            far = f"{self.value:.1f} standard deviations (random {self.random_value:.1f})"
            return [*out, f"  the two explanations differ by {far}"]
        for n, u, s, r in zip(self.names, self.units, self.sigma, self.random_sigma, strict=True):
            out.append(f"  {n}: u = {s:.3g}{'' if u == '1' else f' {u}'} (random {r:.3g})")
        if self.aim == "map":
            out.append(f"  map: u = {1e3 * self.value:.3g} mm rms (random {1e3 * self.random_value:.3g})")
        return out


def plan(
    machine: Machine | Source,
    identify: Effects,
    *,
    rows: int = 12,
    rival: Effects = (),
    aim: str | None = None,
    quantity: str = "deflection",
    poses: int = 60,
    force: float = 400.0,
    candidates: Experiment | str | PathLike[str] | None = None,
    position: ArrayLike | None = None,
    wrench: ArrayLike | None = None,
    frame: str = "known",
    tool: str = "known",
    axes: Sequence[str] = ("dx", "dy", "dz"),
    noise: float | None = None,
    seed: int = 0,
    done: Experiment | str | PathLike[str] | None = None,
) -> Design:
    """Which poses, loads and readings are most informative, before the instrument is booked.

    Parameters
    ----------
    identify
        Effects whose numbers are wanted, at the values given: ``"compliance actuator x scale=1"``, or records.
    rows
        Number of rows to measure.
    rival
        Another explanation, to be distinguished from `identify`; its numbers are fitted away.
    aim
        ``identify`` (D-optimal), ``separate`` (needs `rival`), ``map`` (the map at the workpiece); None: ``separate`` where there
        is a rival, else ``identify``.
    position, wrench
        With the aim ``map``: poses of the workpiece (m, 3) m and the wrench (6,) N, N·m there; None: corners of the
        workspace, `force` along x.
    candidates
        Rows to choose from, each at most once: an experiment, its folder or file; None: `poses` random poses of the workspace, for
        deflections under ± `force` (N) along x, y, z. Rows out of reach or beyond a drive's range are left out.
    frame, tool
        What the instrument leaves unknown, as in an experiment file.
    noise
        One standard deviation of a reading, m; None: 3 µm for deflections, 8 µm for positions.
    done
        Rows that have been measured already, given as `candidates`: their information counts.

    Returns a `Design`: its `experiment` holds the rows, `sigma` (k,) the expected standard uncertainties (SI).
    Raises StiffmapError for bad input.
    """
    machine = as_machine(machine)
    terms = tuple(effects_of(machine, identify, "identify"))
    others = tuple(effects_of(machine, rival, "rival"))
    if not terms:
        raise StiffmapError("identify: expected at least one effect, got none")
    aim = ("separate" if others else "identify") if aim is None else aim
    pool = None if candidates is None else as_experiment(candidates)
    measured = None if done is None else as_experiment(done)
    at = None if position is None else trailing(position, (3,), "position", "positions (m)").reshape(-1, 3)
    load = None if wrench is None else wrench_array(wrench)
    one_of(aim, AIMS, "aim")
    if aim != "map" and not (at is None and load is None):
        raise StiffmapError(f"position and wrench: only with aim 'map', got {aim!r}; see candidates")
    if aim == "separate" and not others:
        raise StiffmapError("rival: separating two explanations needs the other one")
    whole_number(rows, "rows", 1)
    one_of(frame, UNKNOWN, "frame")
    one_of(tool, UNKNOWN, "tool")
    if pool is None:
        where, loads = random_poses(machine, poses, seed), load_set("axes", [magnitude(force, "force", "N")])
        pool = plan_of_poses(machine, quantity, where, loads, axes=axes if len(axes) else ("",), noise=noise)
    both, old = replace(in_limits(machine, pool), frame=frame, tool=tool), 0
    if measured is not None:
        old = len(measured)
        both = numbered_anew(joined(replace(measured, frame=frame, tool=tool), both))
    each = Information(machine, both, terms, others if aim == "separate" else ())
    weight = map_weight(machine, terms, at, load, force) if aim == "map" else None

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
        numbered_anew(both.rows(np.sort(picked).astype(np.intp))),
        aim,
        each.names,
        each.units,
        sigma[0],
        np.median(sigma[1:], axis=0),
        float(natural[0]),
        float(np.median(natural[1:])),
    )


@checked
def follow(
    machine: Machine | Source,
    terms: Effects,
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
    machine, until = as_machine(machine), magnitude(until, "until", "of a typical size")
    now = tuple(effects_of(machine, terms, "terms"))
    while data is None or len(data) < most:
        chosen = plan(machine, now, rows=batch, done=data, seed=seed + len(found), **options)  # type: ignore[arg-type]
        new = as_experiment(measure(chosen.experiment))
        data = new if data is None else numbered_anew(joined(data, new))
        result = estimate(machine, data, now)
        found.append((len(data), result))
        now = result.terms
        if result.worst <= until:
            break
    return found


OFF_LIMITS = Flag.DRIVE_RANGE | Flag.JOINT_LIMIT


def in_limits(machine: Machine, rows: Experiment) -> Experiment:
    """Rows whose pose is within reach and limits."""
    if rows.command is not None:
        return rows
    at = inverse_kinematics(machine, rows.position, rows.rotation)
    good = np.isfinite(at.position).all(axis=1) & ((at.flags & OFF_LIMITS) == 0)
    if not good.any():
        raise StiffmapError(f"{machine.name}: no candidate pose is within the drives' range")
    return rows.rows(np.asarray(good))


def joined(a: Experiment, b: Experiment) -> Experiment:
    """The rows of both; what one of them does not record is recorded by neither. Raises StiffmapError for different readings."""
    one, other = (", ".join((e.quantity, *(c.name for c in e.extra))) for e in (a, b))
    if one != other:
        raise StiffmapError(f"{b.name}: expected the same readings as in {a.name} ({one}), found {other}")

    def both(name: str) -> object:
        one, other = getattr(a, name), getattr(b, name)
        if one is None or other is None:
            return None
        if isinstance(one, tuple):
            return (*one, *other) if len(one) and len(other) else ()
        return np.concatenate([one, other])

    return replace(a, **{name: both(name) for name in PER_ROW}, absolute={})  # type: ignore[arg-type]
