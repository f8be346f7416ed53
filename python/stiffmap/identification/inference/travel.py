"""Errors along the drives' travel: the zero of each drive as a smooth function of its own coordinate.

Gears, screws, scales and encoders err with the coordinate of their drive, in a way that no tolerance of a dimension says.
Each function is straight between knots with equally many poses between them, and a priori a Gaussian process of two lengths.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import cholesky

from stiffmap.experiment.experiment import Floats, Integers
from stiffmap.experiment.poses.configuration import coordinates_of
from stiffmap.experiment.prediction.predict import Predictor
from stiffmap.identification.inference.kernels import matern
from stiffmap.identification.numbers.sensitivity import Sensitivity
from stiffmap.identification.numbers.unknowns import joint_name
from stiffmap.model.description import Joint
from stiffmap.model.with_errors import Knots

LENGTHS = (0.05, 0.3)
"""Of the travel: a turn of a gear, a bend."""
POSES = 10
"""For each knot."""
FEWEST, MOST = 4, 60
"""Knots."""
SAME = 1e-9
"""Of a coordinate, within which two knots are one."""
TURNS = 2
"""At which the errors of a turning drive are repeated, at most, to either side."""


@dataclass(frozen=True, eq=False)
class DriveErrors:
    """A drive whose zero the readings show."""

    name: str
    unit: str
    """``m`` or ``rad``."""
    zero: Floats
    """(n, c) change of the readings, m or rad, per unit of the drive's zero."""
    coordinate: Floats
    """(n,) m, rad."""
    knots: Floats
    """(k,) m, rad."""

    def columns(self, rows: Integers, channel: Integers) -> Floats:
        """(N, k) change of some readings per unit of the error at each knot."""
        return np.asarray(self.zero[rows, channel][:, None] * hats(self.coordinate[rows], self.knots))

    def names(self) -> list[tuple[str, float]]:
        """Of its part of each length, and the length."""
        return [(f"{self.name} along its travel, {length:g}", length) for length in LENGTHS]

    def root(self, variance: Mapping[str, float]) -> Floats:
        """(k, k) L of the covariance L Lᵀ of the errors at the knots, m² or rad², with the variance of each part; without a mean and
        a slope, which are the drive's zero and gain."""
        apart = np.abs(self.knots[:, None] - self.knots) / np.ptp(self.knots)
        k = np.zeros_like(apart)
        for name, length in self.names():
            k += variance.get(name, 0.0) * matern(apart / length)
        root = cholesky(k + 1e-9 * np.trace(k) * np.eye(len(k)) / len(k), lower=True)
        line = np.linalg.qr(np.column_stack([np.ones(len(k)), self.knots]))[0]
        return np.asarray(root - line @ (line.T @ root))


def drives_of(predictor: Predictor, s: Sensitivity) -> list[DriveErrors]:
    """The drives of a machine where positions were read at enough poses; none otherwise."""
    e, machine = predictor.experiment, predictor.machine
    knots = min(MOST, len(np.unique(e.groups)) // POSES)
    zeros = [i for i, u in enumerate(s.unknowns) if u.group == "zeros" and not u.setup]
    if e.quantity != "position" or knots < FEWEST or not zeros:
        return []
    q = coordinates_of(machine, e)
    out = []
    for i in zeros:
        u = s.unknowns[i]
        name = u.moves[0][0][0]
        at = q[:, machine.compiled.names.joints[joint_name(name)]]
        places = apart(np.nanquantile(at, np.linspace(0.0, 1.0, knots)))
        if len(places) >= FEWEST:
            out.append(DriveErrors(name, u.unit, s.columns[..., i] / u.u, at, places))
    return out


def apart(places: Floats) -> Floats:
    """Rising places without those that are the next one but for round-off."""
    rising = np.unique(places)
    return np.asarray(rising[np.append(True, np.diff(rising) > SAME * (1.0 + np.abs(rising[1:])))])


def hats(x: Floats, knots: Floats) -> Floats:
    """(n, k) straight between knots (k,): one at its own, zero at the others; level beyond the ends."""
    return np.column_stack([np.interp(x, knots, row) for row in np.eye(len(knots))])


@dataclass(frozen=True, eq=False)
class Profile:
    """Error of one drive over its coordinate, m or rad: it stands at coordinate plus error."""

    drive: str
    unit: str
    at: Floats
    """(k,)."""
    error: Floats
    """(k,)."""
    sigma: Floats
    """(k,) standard uncertainty of the error."""


def knots_of(joint: Joint, p: Profile) -> Knots:
    """The errors at the knots; of a drive that turns repeated at each turn of its range that they do not reach, since gears and
    encoders return to where they were."""
    knots = tuple(zip(map(float, p.at), map(float, p.error), strict=True))
    ends = joint.drive.range if joint.drive and joint.drive.range else None
    turn = 2.0 * math.pi
    if joint.kind != "revolute" or ends is None or knots[-1][0] - knots[0][0] >= turn:
        return knots
    out = list(knots)
    for _ in range(TURNS):
        if out[0][0] > ends[0]:
            out = [(u - turn, e) for u, e in out[: len(knots)]] + out
        if out[-1][0] < ends[1]:
            out = out + [(u + turn, e) for u, e in out[-len(knots) :]]
    return tuple(out)


def profiles(
    drives: Sequence[tuple[DriveErrors, Floats]], values: Floats, covariance: Floats
) -> tuple[Profile, ...]:
    """Of drives with roots (k, k), by values (K,) of all their directions, one drive after the other, and their covariance (K, K)."""
    out, done = [], 0
    for d, root in drives:
        mine = slice(done, done + root.shape[1])
        sd = np.sqrt(np.maximum(np.sum((root @ covariance[mine, mine]) * root, axis=1), 0.0))
        out.append(Profile(d.name, d.unit, d.knots, root @ values[mine], sd))
        done += root.shape[1]
    return tuple(out)
