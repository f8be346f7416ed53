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

from stiffmap.broadcasting import Floats
from stiffmap.description import AppliedEffect
from stiffmap.errors import StiffmapError
from stiffmap.experiment.experiment import Experiment, Integers
from stiffmap.experiment.noise.nuisance import nuisance_columns
from stiffmap.experiment.prediction.predict import Predictor
from stiffmap.experiment.virtual.plans import load_set, plan_of_poses, random_poses
from stiffmap.kinematics import inverse_kinematics
from stiffmap.machine import Machine
from stiffmap.planning.estimate import Estimate, estimate, fitted, slopes
from stiffmap.status import Flag

AIMS = ("identify", "separate", "map")
RIDGE = 1e-9
"""Information of a parameter per typical size that no row has to bring: makes the first rows comparable."""
PASSES = 3
RANDOM = 20
"""Random plans beside the chosen one."""
OFF_LIMITS = Flag.DRIVE_RANGE | Flag.JOINT_LIMIT
Value = Callable[[Floats], Floats]


@dataclass(frozen=True, eq=False)
class Design:
    """Chosen rows, and how they compare."""

    experiment: Experiment
    """The rows, without readings."""
    aim: str
    names: tuple[str, ...]
    units: tuple[str, ...]
    sigma: Floats
    """(k,) expected standard uncertainty of each parameter, SI; inf where the rows do not tell it."""
    random_sigma: Floats
    """(k,) median of random plans of the same size."""
    value: float
    """``identify``: log det; ``separate``: standard deviations between the rivals; ``map``: m, rms."""
    random_value: float


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
    """The `rows` candidate rows that tell most of the numbers in `terms`.

    Parameters
    ----------
    terms, rival
        Effects with the values at which they are to be told; the rival's numbers are fitted away.
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

    Raises StiffmapError for bad input.
    """
    _check(aim, rival, rows)
    if candidates is None:
        candidates = _candidates(machine, quantity, poses, force, axes, noise, seed)
    pool = replace(_in_limits(machine, candidates), frame=frame, tool=tool)
    given = tuple(rival if aim == "separate" else terms)
    old = 0 if done is None else len(done)
    both = pool if done is None else _joined(replace(done, frame=frame, tool=tool), pool)
    information = _Information(machine, both, given)
    count = len(information.names)
    value: Value = information.identify
    if aim == "separate":
        information.add_signal(tuple(terms))
        value = information.separate
    elif aim == "map":
        value = information.map_of(_map_weight(machine, given, at, load, force))
    start = information.matrices[:old].sum(axis=0)
    free = np.arange(old, len(both), dtype=np.intp)
    if rows > len(free):
        raise StiffmapError(
            f"rows: expected at most the {len(free)} candidates that can be reached, got {rows}"
        )
    picked = _exchange(information.matrices, start, free, rows, value)
    rng = np.random.default_rng(seed)
    random = [
        start + information.matrices[rng.choice(free, rows, replace=False)].sum(axis=0) for _ in range(RANDOM)
    ]
    total = start + information.matrices[picked].sum(axis=0)
    scores = value(np.stack([total, *random]))
    chosen = both.rows(np.sort(picked).astype(np.intp))
    n = len(chosen)
    chosen = replace(chosen, ids=tuple(str(i + 1) for i in range(n)), order=np.arange(1, n + 1, dtype=float))
    return Design(
        chosen,
        aim,
        information.names,
        information.units,
        information.sigma(total)[:count],
        np.median([information.sigma(m)[:count] for m in random], axis=0),
        information.shown(aim, scores[0]),
        information.shown(aim, float(np.median(scores[1:]))),
    )


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
        data = new if data is None else _joined(data, new)
        result = estimate(machine, data, now)
        found.append((len(data), result))
        now = result.terms
        scale = np.array([p.scale for _, p in fitted(machine.description, now)])
        if (result.sigma * result.misfit / scale).max() <= until:
            break
    return found


def _check(aim: str, rival: Sequence[AppliedEffect], rows: int) -> None:
    if aim not in AIMS:
        raise StiffmapError(f"aim: expected {', '.join(AIMS)}, got {aim!r}")
    if aim == "separate" and not rival:
        raise StiffmapError("rival: separating two explanations needs the other one")
    if rows < 1:
        raise StiffmapError(f"rows: expected 1 or more, got {rows}")


def _candidates(
    machine: Machine,
    quantity: str,
    poses: int,
    force: float,
    axes: Sequence[str],
    noise: float | None,
    seed: int,
) -> Experiment:
    where = random_poses(machine, poses, seed)
    return plan_of_poses(machine, quantity, where, load_set("axes", [force]), axes=axes, noise=noise)


def _in_limits(machine: Machine, plan: Experiment) -> Experiment:
    """Rows whose pose is within reach and limits."""
    if plan.command is not None:
        return plan
    at = inverse_kinematics(machine, plan.position, plan.rotation)
    good = np.isfinite(at.position).all(axis=1) & ((at.flags & OFF_LIMITS) == 0)
    if not good.any():
        raise StiffmapError(f"{machine.name}: no candidate pose is within the drives' range")
    return plan.rows(np.asarray(good))


def _joined(a: Experiment, b: Experiment) -> Experiment:
    """Rows of one after the other; fields that only one has are left out."""
    whole = [len(a), len(b)]

    def both(x: object, y: object) -> object:
        if isinstance(x, np.ndarray) and isinstance(y, np.ndarray):
            return np.concatenate([x, y])
        if isinstance(x, tuple) and isinstance(y, tuple) and [len(x), len(y)] == whole:
            return x + y
        return x

    fields = (
        "position",
        "wrench",
        "reading",
        "sigma",
        "rotation",
        "approach",
        "branch",
        "setup",
        "temperature",
    )
    joined: dict[str, Any] = {name: both(getattr(a, name), getattr(b, name)) for name in fields}
    n = sum(whole)
    return replace(
        a,
        **joined,
        ids=tuple(str(i + 1) for i in range(n)),
        order=np.arange(1.0, n + 1),
        repeat=None,
    )


def _map_weight(
    machine: Machine, terms: tuple[AppliedEffect, ...], at: Floats | None, load: Floats | None, force: float
) -> Floats:
    """(k, k) mean over the map of the squared change of the tool's position per parameter (typical sizes)."""
    if at is None:
        low, high = machine.workspace
        inside = np.stack([low + 0.02 * (high - low), high - 0.02 * (high - low)])
        at = np.array(np.meshgrid(*inside.T, indexing="ij")).reshape(3, -1).T
    wrench = np.array([force, 0, 0, 0, 0, 0]) if load is None else load
    plan = plan_of_poses(machine, "deflection", at, wrench[None])
    predictor = Predictor(machine, plan)
    parameters = fitted(machine.description, terms)
    columns = [
        c[:, :3] * p.scale for c, (_, p) in zip(slopes(predictor, terms, parameters), parameters, strict=True)
    ]
    stacked = np.stack(columns, axis=-1)
    return np.asarray(np.einsum("nak,nal->kl", stacked, stacked) / len(stacked))


class _Information:
    """Information matrices of all candidate rows: parameters in typical sizes, then nuisances, then a signal."""

    def __init__(self, machine: Machine, plan: Experiment, terms: tuple[AppliedEffect, ...]) -> None:
        self.predictor, self.terms, self.signal = Predictor(machine, plan), terms, False
        if len(self.predictor.experiment) != len(plan):
            raise StiffmapError(f"plan: {self.predictor.experiment.out_of_reach[0]}")
        parameters = fitted(machine.description, terms)
        if not parameters:
            raise StiffmapError("plan: the effects have no number that could be fitted")
        self.names = tuple(
            f"{terms[i].kind} of {terms[i].element} {' '.join(terms[i].legs)}: {p.name}"
            for i, p in parameters
        )
        self.units = tuple(p.unit for _, p in parameters)
        self.scale = np.array([p.scale for _, p in parameters])
        columns = [
            c * p.scale
            for c, (_, p) in zip(slopes(self.predictor, terms, parameters), parameters, strict=True)
        ]
        base = self.predictor()
        nuisances = nuisance_columns(self.predictor.experiment, base)
        self.columns = np.concatenate([np.stack(columns, axis=-1), nuisances], axis=-1)
        self.matrices = self._products()

    def _products(self) -> Floats:
        sigma = np.where(self.predictor.experiment.read, self.predictor.experiment.sigma, np.inf)
        x = np.nan_to_num(self.columns / sigma[..., None])
        norm = np.linalg.norm(x.reshape(-1, x.shape[-1]), axis=0)
        k = len(self.names)
        norm[:k] = 1.0
        norm[-1] = 1.0 if self.signal else norm[-1]
        x = x / np.where(norm > 0, norm, 1.0)
        return np.asarray(np.einsum("nca,ncb->nab", x, x))

    def add_signal(self, terms: tuple[AppliedEffect, ...]) -> None:
        """The first explanation's signal as a last column."""
        signal = self.predictor(terms) - self.predictor(self.terms)
        self.columns = np.concatenate([self.columns, signal[..., None]], axis=-1)
        self.signal = True
        self.matrices = self._products()

    def _regular(self, m: Floats) -> Floats:
        return np.asarray(m + RIDGE * np.eye(m.shape[-1]))

    def identify(self, m: Floats) -> Floats:
        """log det of the parameters' information, nuisances unknown."""
        k = len(self.names)
        r = self._regular(m)
        whole = np.linalg.slogdet(r)[1]
        return np.asarray(whole - np.linalg.slogdet(r[..., k:, k:])[1])

    def separate(self, m: Floats) -> Floats:
        """Squared standard deviations that the rival's best fit leaves of the signal."""
        g, b, d = m[..., :-1, :-1], m[..., :-1, -1], m[..., -1, -1]
        size = np.maximum(np.einsum("...ii->...i", g), 1e-300) ** -0.5
        scaled = g * size[..., :, None] * size[..., None, :] + RIDGE * np.eye(g.shape[-1])
        found = np.linalg.solve(scaled, (b * size)[..., None])[..., 0]
        return np.asarray(d - np.einsum("...i,...i->...", b * size, found))

    def map_of(self, weight: Floats) -> Value:
        """Minus the mean variance of the map."""
        k = len(self.names)

        def value(m: Floats) -> Floats:
            covariance = np.linalg.inv(self._regular(m))[..., :k, :k]
            return np.asarray(-np.einsum("...kl,lk->...", covariance, weight))

        return value

    def sigma(self, m: Floats) -> Floats:
        """(k,) standard uncertainties, SI; inf where the rows do not tell a parameter."""
        k = len(self.names)
        m = m[:-1, :-1] if self.signal else m
        values, vectors = np.linalg.eigh(self._regular(m))
        weak = values < 1e3 * RIDGE * max(1.0, values[-1] * 1e-6)
        spread = (vectors**2 / values).sum(axis=1)[:k]
        lost = (vectors[:k, weak] ** 2).sum(axis=1) > 1e-6
        return np.asarray(np.where(lost, np.inf, np.sqrt(spread) * self.scale))

    def shown(self, aim: str, score: float) -> float:
        """The score in its natural unit."""
        return float(score) if aim == "identify" else float(np.sqrt(abs(score)))


def _exchange(matrices: Floats, start: Floats, free: Integers, rows: int, value: Value) -> Integers:
    """Indices of the rows chosen: greedily, then exchanged while that gains."""
    left = [int(i) for i in free]
    picked: list[int] = []
    total = start.copy()
    for _ in range(rows):
        best = left[int(np.argmax(value(total + matrices[left])))]
        picked.append(best)
        left.remove(best)
        total = total + matrices[best]
    for _ in range(PASSES):
        changed = False
        for place, old in enumerate(picked):
            bare = total - matrices[old]
            options = [old, *left]
            scores = value(bare + matrices[options])
            k = int(np.argmax(scores))
            if k and scores[k] > scores[0] + 1e-9 * (1 + abs(scores[0])):
                new = options[k]
                picked[place] = new
                left.remove(new)
                left.append(old)
                total, changed = bare + matrices[new], True
        if not changed:
            break
    return np.array(picked, dtype=np.intp)
