"""Errors along the drives' travel: what a calibrated machine leaves, as a profile over each drive's own coordinate.

Gears, screws, scales and encoders err with the coordinate of their drive, in a way that no tolerance of a dimension
tells. The zero of each drive becomes a function of its coordinate, straight between knots that have equally many
poses between them; the profiles of all drives are fitted together to what the calibration leaves (docs/theory.md (I4)),
and judged on poses that neither they nor the calibration have seen.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np

from stiffmap.common.plain import plain
from stiffmap.experiment.experiment import Floats, Integers, Mask
from stiffmap.experiment.noise.whitening import Problem
from stiffmap.identification.calibration.statistics import Sums, gain_of

POSES = 10
"""For each knot of a profile."""
FEWEST, MOST = 4, 60
"""Knots."""
SAME = 1e-9
"""Of a coordinate, within which two knots are one."""
BYTES = 2**28
"""That all columns may take; with more readings there are fewer knots."""
TOLD = 0.1
"""Share of the squares that are left, below which profiles are not reported."""
SURE = 2.0
"""Standard errors of the folds' gain, beyond which they are."""
Own = Callable[[Floats, Mask], Floats]
"""Residual (N,), rows held out (N,) -> what these say of unknowns that are theirs alone (N,)."""
Size = Callable[[Floats], float]
"""rms of whitened residuals (N,) in the unit of the report."""


@dataclass(frozen=True)
class Profile:
    """Error of one drive over its coordinate, m or rad: it stands at coordinate plus error."""

    drive: str
    unit: str
    at: tuple[float, ...]
    error: tuple[float, ...]
    sigma: tuple[float, ...]
    share: float
    """Of the squares that are left, on held-out readings, with this drive's profile alone."""


@dataclass(frozen=True)
class Travel:
    """Profiles of all drives, and what they take away from held-out readings."""

    by: str
    before: float
    after: float
    """rms in m (rad where only angles are read)."""
    share: float
    """Of the squares that are left without them."""
    profiles: tuple[Profile, ...]
    hats: Hats = field(repr=False, compare=False)
    """What the profiles are made of."""

    def as_plain(self) -> dict[str, Any]:
        """JSON data."""
        return {n: plain(getattr(self, n)) for n in ("by", "before", "after", "share")} | {
            "profiles": [plain(asdict(p)) for p in self.profiles]
        }


@dataclass(frozen=True, eq=False)
class Hats:
    """Knots of every drive's profile and how large an error at them is expected to be."""

    drives: tuple[Drive, ...]
    at: tuple[Floats, ...]
    scales: tuple[Floats, ...]
    variance: float
    """Of a whitened reading, jointly with the profiles."""

    def knots(
        self, problem: Problem, columns: Floats, linear: Floats, rho: float
    ) -> dict[str, tuple[tuple[float, float], ...]]:
        """(coordinate, error) of each drive by the readings of `problem`.

        columns, linear
            (N, p) and (N,) whitened, of all other unknowns, in the standard uncertainties that hold.
        rho
            Model-form floor.
        """
        parts = [columns] + [
            problem.white(d.zero[..., None] * hats(d.coordinate, at)[:, None, :]) * scale
            for d, at, scale in zip(self.drives, self.at, self.scales, strict=True)
        ]
        wide = np.hstack(parts)
        p = columns.shape[1]
        values = _beside(Sums.of(wide, linear), p, 1.0 + rho).at(np.arange(p, wide.shape[1]), self.variance)
        out, done = {}, 0
        for d, at, scale in zip(self.drives, self.at, self.scales, strict=True):
            errors = values[done : done + len(at)] * scale
            out[d.name] = tuple(zip(map(float, at), map(float, errors), strict=True))
            done += len(at)
        return out


@dataclass(frozen=True, eq=False)
class Drive:
    """A drive whose zero the readings feel."""

    name: str
    unit: str
    zero: Floats
    """(n, c) change of the readings, in SI, per m or rad of its zero."""
    coordinate: Floats
    """(n,) m, rad."""


def travel(
    problem: Problem,
    drives: Sequence[Drive],
    columns: Floats,
    linear: Floats,
    rho: float,
    label: Integers,
    by: str,
    own: Own,
    size: Size,
) -> Travel | None:
    """Profiles of the drives, or None where they do not hold.

    Parameters
    ----------
    columns, linear
        (N, p) and (N,) whitened, of all other unknowns, in the standard uncertainties that hold.
    rho
        Model-form floor.
    label
        (N,) fold of each reading.
    """
    knots = _knots(problem, len(drives), columns.shape[1])
    if rho <= 0.0 or not drives or knots < FEWEST or not label.max():
        return None
    parts, at, scales = [columns], [], []
    for d in drives:
        places = apart(np.quantile(d.coordinate[problem.keep], np.linspace(0.0, 1.0, knots)))
        white = problem.white(d.zero[..., None] * hats(d.coordinate, places)[:, None, :])
        # a knot of typical effect moves the readings about it by as much as is left of them
        scale = np.sqrt(rho / np.maximum(np.mean(white**2, axis=0) * len(places), 1e-300))
        parts.append(white * scale)
        at.append(places)
        scales.append(scale)
    wide = np.hstack(parts)
    ends = np.cumsum([p.shape[1] for p in parts])
    tests = [label == k for k in range(int(label.max()) + 1)]
    folds = [Sums.of(wide[t], linear[t]) for t in tests]
    whole = folds[0]
    for f in folds[1:]:
        whole = whole + f
    p = int(ends[0])
    mine = [np.arange(a, b) for a, b in pairwise(ends)]

    def left(which: Integers, variance: float) -> Floats:
        out = np.zeros(len(linear))
        for test, part in zip(tests, folds, strict=True):
            known = _beside(whole - part, p, 1.0 + rho)
            rest = linear - columns @ known.fixed - wide[:, which] @ known.at(which, variance)
            out[test] = (rest - own(rest, test))[test]
        return out

    before = left(np.arange(0), 1.0 + rho)
    everything = np.arange(p, wide.shape[1])
    variance = float(np.mean(left(everything, 1.0 + rho) ** 2))
    after = left(everything, variance)
    share = _share(before, after)
    gain, error = gain_of(before, after, tests)
    if share < TOLD or gain < SURE * error:
        return None
    found = _beside(whole, p, 1.0 + rho)
    values = found.at(everything, variance)
    gram = found.sums.pick(everything).gram
    spread = np.sqrt(np.diag(np.linalg.inv(np.eye(len(values)) + gram / variance)))
    profiles = []
    for k, d in enumerate(drives):
        here = slice(ends[k] - p, ends[k + 1] - p)
        profiles.append(
            Profile(
                d.name,
                d.unit,
                tuple(map(float, at[k])),
                tuple(map(float, values[here] * scales[k])),
                tuple(map(float, spread[here] * scales[k])),
                _share(before, left(mine[k], 1.0 + rho)),
            )
        )
    made = Hats(tuple(drives), tuple(at), tuple(scales), variance)
    return Travel(by, size(before), size(after), share, tuple(profiles), made)


def apart(places: Floats) -> Floats:
    """Rising places without those that are the next one but for round-off."""
    rising = np.unique(places)
    return np.asarray(rising[np.append(True, np.diff(rising) > SAME * (1.0 + np.abs(rising[1:])))])


def hats(x: Floats, knots: Floats) -> Floats:
    """(n, k) straight between knots (k,): one at its own, zero at the others; level beyond the ends."""
    return np.column_stack([np.interp(x, knots, row) for row in np.eye(len(knots))])


def _knots(problem: Problem, drives: int, others: int) -> int:
    poses = len(np.unique(problem.groups))
    room = int(BYTES / 8 / max(len(problem), 1) - others) // max(drives, 1)
    return min(MOST, poses // POSES, room)


@dataclass(frozen=True, eq=False)
class _Beside:
    """Sums over readings, and what the calibration's own unknowns are by them."""

    sums: Sums
    fixed: Floats

    def at(self, which: Integers, variance: float) -> Floats:
        """Values of columns `which`, the calibration's own unknowns held."""
        gram = self.sums.gram[np.ix_(which, which)]
        right = self.sums.right[which] - self.sums.gram[which, : len(self.fixed)] @ self.fixed
        return np.asarray(np.linalg.solve(np.eye(len(which)) + gram / variance, right / variance))


def _beside(sums: Sums, own: int, variance: float) -> _Beside:
    mine = sums.pick(np.arange(own))
    fixed = np.linalg.solve(np.eye(own) + mine.gram / variance, mine.right / variance)
    return _Beside(sums, np.asarray(fixed))


def _share(before: Floats, after: Floats) -> float:
    return 1.0 - float(after @ after) / float(before @ before)
