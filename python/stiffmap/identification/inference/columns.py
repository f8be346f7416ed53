"""What each part of the model adds to the readings, in units of the noise: the only stage that asks the machine.

Readings are taken as (y - f0) / σ, rotated into the space that unknown frames, tools and zeros leave free: what is
integrated out with a flat prior is gone from everything that follows.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.blas import dsyrk

from stiffmap.common.errors import StiffmapError
from stiffmap.experiment.experiment import Experiment, Floats, Integers
from stiffmap.experiment.noise.nuisance import nuisance_columns
from stiffmap.experiment.noise.outliers import GROSS, LEAST_MANY, MANY
from stiffmap.experiment.noise.whitening import basis, fitted, readings_of
from stiffmap.experiment.prediction.predict import Predictor
from stiffmap.identification.candidates.sensitivity import CandidatePlan, Variant
from stiffmap.identification.inference.constants import STANDS_OUT
from stiffmap.identification.inference.kernels import Kernel, ReadingPoints, gaps
from stiffmap.identification.inference.places import NULL, Place, places
from stiffmap.identification.inference.travel import drives_of
from stiffmap.identification.numbers.sensitivity import Sensitivity, sensitivity, zeros_anew
from stiffmap.identification.numbers.unknowns import Unknown

MOST_READINGS = 600
"""Readings that are compared with each other; of more, whole poses are drawn. Effort only: an (N, N) matrix is factorised."""
FEWEST_POSES = 10
"""Poses that are kept where readings are drawn, if there are so many."""


@dataclass(frozen=True, eq=False)
class Columns:
    """All parts of the model; N readings, of which unknown frames leave m."""

    experiment: Experiment
    rows: Integers
    """(N,) row of each reading."""
    channel: Integers
    """(N,) channel of each reading."""
    sigma: Floats
    """(N,) m, rad: declared standard deviation of each reading."""
    free: Floats
    """(N, m) orthonormal directions that averages of repeats and unknown frames, tools and zeros leave free."""
    frames: Floats
    """(N, q) orthonormal directions of unknown frames, tools and zeros."""
    residual: Floats
    """(m,) reading less the declared prediction, in noise."""
    zero: Floats
    """(m, m) covariance of the declared zero that readings of one pose share."""
    unknowns: tuple[Unknown, ...]
    numbers: Floats
    """(m, p) change of the readings per standard uncertainty of each declared number."""
    use: Integers
    """(N,) which of all readings these are, in the order of `readings_of`."""
    gaps: tuple[tuple[str, str, Floats], ...] = ()
    """Kind, name and (m, m) covariance, of mean variance one, of what nobody can name."""
    places: tuple[Place, ...] = ()
    travel: tuple[tuple[str, Floats, float], ...] = ()
    """Name, (m, k) factor F of a covariance F Fᵀ of mean variance one, of errors along the travel of each drive, and their
    standard deviation in m or rad."""
    repeats: tuple[float, float] = (0.0, 0.0)
    """Sum of squares within repeats that were averaged, in noise, and its degrees of freedom."""
    tied: bool = False
    """Whether the lengths of a row share one weight of heavy tails, and the angles, as where an instrument slips; else each reading has
    its own."""

    def of_noise(self, weights: Floats) -> Floats:
        """(m, m) covariance along the free directions of noise of weights (N,), its upper half; zero below the diagonal."""
        return np.asarray(dsyrk(1.0, self.free / np.sqrt(weights)[:, None], trans=1, lower=1).T)

    @property
    def points(self) -> ReadingPoints:
        """The readings, as kernels take them."""
        return ReadingPoints(self.rows, self.channel, self.sigma)

    def scale_of(self, kernel: Kernel) -> float:
        """Variance of a kernel in a part of mean variance one."""
        size = float(np.sum(self.free * (kernel.between(self.points, self.points) @ self.free)))
        return len(self) / size if size > 0.0 else 0.0

    @staticmethod
    def bare(e: Experiment, rows: Integers, channel: Integers, free: Floats, residual: Floats) -> Columns:
        """Of N readings in noise and a residual (m,) in what is free of them: without numbers, gaps and effects."""
        n, m = free.shape
        none, zero = np.zeros((m, 0)), np.zeros((m, m))
        return Columns(
            e, rows, channel, np.ones(n), free, np.zeros((n, 0)), residual, zero, (), none, np.arange(n)
        )

    def without(self, group: str) -> Columns:
        """Without the numbers of a group."""
        kept = [u.group != group for u in self.unknowns]
        some = tuple(u for u in self.unknowns if u.group != group)
        return replace(self, unknowns=some, numbers=self.numbers[:, kept])

    def rotated(self, values: Floats) -> Floats:
        """(m, ...) of the readings' (N, ...), m or rad: in noise, without what frames and zeros could be."""
        return np.asarray(self.free.T @ (values / self.sigma.reshape(-1, *(1,) * (values.ndim - 1))))

    def lines(self, variant: Variant) -> Floats:
        """(N, p) m, rad: columns of a candidate, per scale of its linear parameters."""
        return variant.lines(self.use).T

    def __len__(self) -> int:
        return len(self.residual)

    @cached_property
    def tails(self) -> tuple[Integers, Integers, Integers]:
        """(N,) number of the weight of heavy tails of each reading; how many readings have each weight, and the first of them."""
        own = np.arange(len(self.rows))
        if not self.tied:
            return own, np.ones_like(own), own
        angle = np.array([c.unit == "rad" for c in self.experiment.channels])[self.channel]
        _, first, label, size = np.unique(2 * self.rows + angle, True, True, True)
        return label.reshape(-1), size, first

    @property
    def of_rows(self) -> Columns | None:
        """The same, `tied`; None where that is what it is, or where no row has two readings of a unit."""
        tied = replace(self, tied=True)
        return None if self.tied or len(tied.tails[1]) == len(self.rows) else tied

    @cached_property
    def alone(self) -> NDArray[np.bool_]:
        """(N,) readings far from what frames and declared numbers, robustly fitted, make of all others, with those that share their
        weight; none where there are many: they are structure."""
        values, p, q = self.free @ self.residual, self.numbers.shape[1], self.frames.shape[1]
        prior = np.hstack([np.zeros((p, q)), np.eye(p)])
        whole = np.vstack([np.hstack([self.frames, self.free @ self.numbers]), prior])
        far = fitted(whole, np.append(values, np.zeros(p)))[1][: len(values)] > GROSS
        label, size, _ = self.tails
        out = np.bincount(label, far) > 0.0
        return np.asarray(out[label] & (out.sum() <= max(LEAST_MANY, MANY * len(size))))

    @property
    def groups(self) -> dict[str, Integers]:
        """Numbers of the unknowns of each group and set-up."""
        keys = [f"{u.group}, {u.setup}" if u.setup else u.group for u in self.unknowns]
        return {k: np.flatnonzero([q == k for q in keys]) for k in dict.fromkeys(keys)}


def columns(
    predictor: Predictor, plan: CandidatePlan, sigma: Floats, unknowns: Sequence[Unknown], seed: int = 0
) -> Columns:
    """Columns of everything that the readings of an experiment can hold.

    sigma
        (n, c) standard deviation of each reading, m or rad.

    Raises StiffmapError for noise that is unknown and where unknown frames take up all readings.
    """
    e, base = predictor.experiment, plan.base
    all_rows, all_channels = readings_of(e, base)
    use = drawn(e.groups[all_rows], seed, MOST_READINGS)
    rows, channel = all_rows[use], all_channels[use]
    index = (rows, channel)
    noise = sigma[index]
    if not (noise > 0.0).all():
        raise StiffmapError(
            f"{e.name}: the noise of {e.ids[int(rows[~(noise > 0.0)][0])]} is zero or unknown"
        )
    raw = (e.reading - base)[index] / noise
    mean = _averages(e, rows, channel, noise, raw)
    q = basis(mean.T @ (nuisance_columns(e, base)[index] / noise[:, None]))
    free = mean @ across(q)
    if not free.shape[1]:
        raise StiffmapError(
            f"{e.name}: unknown frames, tools and zeros take up all {len(rows)} readings; read more poses or declare what is known"
        )
    within = raw - mean @ (mean.T @ raw)
    s = zeros_anew(sensitivity(predictor, unknowns), e)
    numbers = free.T @ (s.columns[index] / noise[:, None])
    seen = np.linalg.norm(numbers, axis=0) > NULL
    points = ReadingPoints(rows, channel, noise)
    common = free.T @ zeros(e, points)
    return Columns(
        e,
        rows,
        channel,
        noise,
        free,
        mean @ q,
        free.T @ raw,
        common @ common.T,
        tuple(u for u, k in zip(s.unknowns, seen, strict=True) if k),
        numbers[:, seen],
        use,
        along(gaps(predictor.machine, e, points), points, free),
        places(plan, free, noise, use, predictor.machine.description),
        tuple(_along_travel(predictor, s, index, noise, free)),
        repeated(within, mean),
    )


def along(
    kernels: Iterable[Kernel], points: ReadingPoints, free: Floats
) -> tuple[tuple[str, str, Floats], ...]:
    """Kind, name and covariance along the free directions, of mean variance one, of the kernels that show there."""
    found = ((k.kind, k.name, free.T @ k.between(points, points) @ free) for k in kernels)
    return tuple((kind, name, k * len(k) / np.trace(k)) for kind, name, k in found if np.trace(k) > NULL)


def across(taken: Floats) -> Floats:
    """(M, M - q) orthonormal directions at right angles to orthonormal ones (M, q)."""
    return np.asarray(np.linalg.qr(taken, mode="complete")[0][:, taken.shape[1] :])


def repeated(within: Floats, mean: Floats) -> tuple[float, float]:
    """Sum of squares within repeats (N,) whose averages are `mean` (N, M), and its degrees of freedom; none where most repeats are
    the same number: they are rounded alike, and say nothing of the noise."""
    own = np.abs(within[np.sum(mean**2, axis=1) < 1.0 - NULL])
    if not len(own) or np.median(own) < NULL:
        return 0.0, 0.0
    return float(within @ within), float(len(within) - mean.shape[1])


def _along_travel(
    predictor: Predictor, s: Sensitivity, index: tuple[Integers, Integers], noise: Floats, free: Floats
) -> Iterator[tuple[str, Floats, float]]:
    for drive in drives_of(predictor, s):
        shown = free.T @ (drive.columns(*index) / noise[:, None])
        for name, _ in drive.names():
            factor = shown @ drive.root({name: 1.0})
            size = float(np.linalg.norm(factor) / np.sqrt(len(factor)))
            if size > NULL:
                yield name, factor / size, 1.0 / size


def drawn(pose: Integers, seed: int, most: int) -> Integers:
    """Numbers of the readings in use: all of them; or those of poses drawn at random, evenly many of poses that have so many that
    fewer than `FEWEST_POSES` would be left."""
    if len(pose) <= most:
        return np.arange(len(pose))
    poses = np.unique(pose)
    share = most // min(len(poses), FEWEST_POSES)
    own = [np.flatnonzero(pose == k) for k in np.random.default_rng(seed).permutation(poses)]
    own = [k[np.linspace(0, len(k) - 1, share).astype(np.intp)] if len(k) > share else k for k in own]
    chosen = int(np.sum(np.cumsum([len(k) for k in own]) <= most))
    return np.sort(np.concatenate(own[: max(1, chosen)]))


def _averages(e: Experiment, rows: Integers, channel: Integers, noise: Floats, raw: Floats) -> Floats:
    """(N, k) orthonormal columns that average repeats of one condition; the identity where a reading stands out from its
    repeats, or where loads are held over hours: creep is in the repeats."""
    level = np.unique(noise, return_inverse=True)[1].reshape(-1)  # readings of unlike noise are not averaged
    _, number = np.unique(np.stack([e.conditions[rows], channel, level]), axis=1, return_inverse=True)
    number = number.reshape(-1)
    average = np.zeros((len(rows), int(number.max()) + 1))
    average[np.arange(len(rows)), number] = 1.0 / np.sqrt(np.bincount(number))[number]
    within = raw - average @ (average.T @ raw)
    shares = 1.0 - np.sum(average**2, axis=1)
    own = np.abs(within[shares > 0.0]) / np.sqrt(shares[shares > 0.0])
    typical = 1.4826 * float(np.median(own)) if len(own) else 1.0
    if e.hours is not None or np.any(own > STANDS_OUT * max(typical, 1.0)):
        return np.eye(len(rows))
    return average


def zeros(e: Experiment, points: ReadingPoints) -> Floats:
    """(N, k) factor of the covariance, in noise, of the declared zero that readings of one pose share."""
    if e.quantity != "deflection" or not e.zeros.any():
        return np.zeros((len(points), 0))
    label = e.groups[points.rows] * len(e.channels) + points.channel
    size = e.zeros[points.channel] / points.sigma
    return np.asarray((label[:, None] == np.unique(label)) * size[:, None])
