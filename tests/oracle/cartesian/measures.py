"""Numbers measured between two frames, of their relative pose z (12): linear ones, angles about an axis, and sines.
Each with its slope (12) and what its second derivative adds."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

Array = np.ndarray
LINEAR, ANGLE, SINE = 0, 1, 2


@dataclass(frozen=True)
class Measure:
    """LINEAR: one . z - level; ANGLE: atan2(one . z, two . z); SINE: asin(one . z)."""

    kind: int
    one: Array
    two: Array
    level: float = 0.0


def rows(turn: Array | None = None, shift: Array | None = None) -> Array:
    """(12,) weights of Q (3, 3) and t (3,)."""
    out = np.zeros(12)
    if turn is not None:
        out[:9] = turn.ravel()
    if shift is not None:
        out[9:] = shift
    return out


def linear(turn: Array | None = None, shift: Array | None = None, level: float = 0.0) -> Measure:
    return Measure(LINEAR, rows(turn, shift), np.zeros(12), level)


def angle(sine: Array, cosine: Array) -> Measure:
    return Measure(ANGLE, rows(sine), rows(cosine))


def unit(i: int, j: int, value: float = 1.0) -> Array:
    out = np.zeros((3, 3))
    out[i, j] = value
    return out


def across(axis: Array) -> tuple[Array, Array]:
    """Two unit vectors that make a right-handed frame with the axis, as third."""
    least = np.eye(3)[np.abs(axis).argmin()]
    one = np.cross(axis, least)
    one /= np.linalg.norm(one)
    return one, np.cross(axis, one)


def hinge(axis: Array) -> tuple[list[Measure], Measure]:
    """What a revolute joint keeps at zero, and its angle."""
    e, f = across(axis)
    kept = [linear(shift=v) for v in np.eye(3)] + [linear(np.outer(v, axis)) for v in (e, f)]
    return kept, angle(np.outer(f, e), np.outer(e, e))


def slide(axis: Array) -> tuple[list[Measure], Measure]:
    kept = [linear(unit(j, k, 0.5) - unit(k, j, 0.5)) for j, k in ((2, 1), (0, 2), (1, 0))]
    return kept + [linear(shift=v) for v in across(axis)], linear(shift=axis)


def cardan(first: Array, second: Array) -> list[Measure]:
    return [linear(shift=v) for v in np.eye(3)] + [
        linear(np.outer(first, second), level=float(first @ second))
    ]


def ball() -> list[Measure]:
    return [linear(shift=v) for v in np.eye(3)]


def weld() -> list[Measure]:
    turn = [linear(unit(j, k, 0.5) - unit(k, j, 0.5)) for j, k in ((2, 1), (0, 2), (1, 0))]
    return turn + ball()


def spring() -> list[Measure]:
    """(t, phi): Q = Rx(phi1) Ry(phi2) Rz(phi3)."""
    return [
        *ball(),
        angle(unit(1, 2, -1.0), unit(2, 2)),
        Measure(SINE, rows(unit(0, 2)), np.zeros(12)),
        angle(unit(0, 1, -1.0), unit(0, 0)),
    ]


class Measures:
    """Many at once; `pair` (k,) says between which frames."""

    def __init__(self, measures: list[Measure], pair: list[int], sine_of: list[int]) -> None:
        """`sine_of`: for each measure the number of the SINE of its spring, or -1."""
        self.kind = np.array([m.kind for m in measures], dtype=int)
        self.one = np.array([m.one for m in measures]).reshape(-1, 12)
        self.two = np.array([m.two for m in measures]).reshape(-1, 12)
        self.level = np.array([m.level for m in measures])
        self.pair = np.array(pair, dtype=int)
        self.angles, self.sines = (np.flatnonzero(self.kind == k) for k in (ANGLE, SINE))
        self.bent = np.flatnonzero(self.kind != LINEAR)
        self.sine_of = np.array(sine_of, dtype=int)

    def __len__(self) -> int:
        return len(self.kind)

    def at(self, z: Array, near: Array) -> tuple[Array, Array, Array]:
        """Values (k,), the turns nearest to `near` (k,); slopes (k, 12); second derivatives (bent, 12, 12)."""
        mine = z[self.pair]
        s = np.einsum("ij,ij->i", self.one, mine)
        value, slope, second = s - self.level, self.one.copy(), np.zeros((len(self.kind), 12, 12))
        i = self.angles
        one, two, sin = self.one[i], self.two[i], s[i]
        cos = np.einsum("ij,ij->i", two, mine[i])
        # beyond a right angle of the middle rotation the other two change sign together
        beyond = np.where(self.sine_of[i] >= 0, np.cos(near[self.sine_of[i]]) < 0, False)
        raw = np.arctan2(np.where(beyond, -sin, sin), np.where(beyond, -cos, cos))
        value[i] = raw + 2 * np.pi * np.round((near[i] - raw) / (2 * np.pi))
        r2 = sin**2 + cos**2
        slope[i] = (cos[:, None] * one - sin[:, None] * two) / r2[:, None]
        a, b = 2 * sin * cos / r2**2, (sin**2 - cos**2) / r2**2
        mixed = one[:, :, None] * two[:, None, :]
        second[i] = a[:, None, None] * (
            two[:, :, None] * two[:, None, :] - one[:, :, None] * one[:, None, :]
        ) + b[:, None, None] * (mixed + np.swapaxes(mixed, 1, 2))
        i = self.sines
        sin, one = np.clip(s[i], -1 + 1e-15, 1 - 1e-15), self.one[i]
        side = np.where(np.cos(near[i]) < 0, -1.0, 1.0)
        raw = np.where(side > 0, np.arcsin(sin), np.pi - np.arcsin(sin))
        value[i] = raw + 2 * np.pi * np.round((near[i] - raw) / (2 * np.pi))
        cos = side * np.sqrt(1 - sin**2)
        slope[i] = one / cos[:, None]
        second[i] = (sin / cos**3)[:, None, None] * one[:, :, None] * one[:, None, :]
        return value, slope, second[self.bent]
