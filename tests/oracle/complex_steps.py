"""Bodies in Cartesian coordinates under straight lines with a law, springs between frames, weights and loads: an energy and nothing
else. Its gradient is taken by complex steps, its Hessian by differences of that, and the equilibrium by Newton down the energy. No
joint, no closure, no chart."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from scipy.spatial.transform import Rotation

Array = np.ndarray
TINY = 1e-30  # complex step
STEP = 1e-5  # of the Hessian's differences; refined once
LONGEST = 0.1  # m and rad, of a Newton step
EYE = np.eye(3)


def cross_matrix(a: Array) -> Array:
    return np.array([[0, -a[2], a[1]], [a[2], 0, -a[0]], [-a[1], a[0], 0]])


@dataclass(frozen=True)
class At:
    """A frame of a body (None: the base), in the body's own axes and from its origin."""

    body: int | None
    p: Array
    r: Array = field(default_factory=lambda: EYE)

    def now(self, bodies: list[tuple[Array, Array]]) -> tuple[Array, Array]:
        if self.body is None:
            return self.p, self.r
        p, r = bodies[self.body]
        return p + r @ self.p, r @ self.r


@dataclass(frozen=True)
class Line:
    """Energy by the length between two points; complex lengths carry the derivative."""

    start: At
    end: At
    energy: Callable[[complex], complex]

    def value(self, bodies: list[tuple[Array, Array]]) -> complex:
        d = self.end.now(bodies)[0] - self.start.now(bodies)[0]
        return complex(self.energy(np.sqrt(d @ d)))


def arc(y: complex, x: complex) -> complex:
    """atan2 that a complex step goes through."""
    near = np.arctan2(np.real(y), np.real(x))
    c, s = np.cos(near), np.sin(near)
    return complex(near + np.arctan((c * y - s * x) / (c * x + s * y)))


@dataclass(frozen=True)
class Leaf:
    """A spring between two frames: translation, and turns about x, y and z in sequence."""

    start: At
    end: At
    stiffness: Array

    def value(self, bodies: list[tuple[Array, Array]]) -> complex:
        (p, r), (q, o) = self.start.now(bodies), self.end.now(bodies)
        m = r.T @ o
        turns = (
            arc(-m[1, 2], m[2, 2]),
            arc(m[0, 2], np.sqrt(m[0, 0] ** 2 + m[0, 1] ** 2)),
            arc(-m[0, 1], m[0, 0]),
        )
        x = np.array([*(r.T @ (q - p)), *turns])
        return complex(x @ self.stiffness @ x / 2)


@dataclass(frozen=True)
class Force:
    """Dead, at a point of a body; or a weight."""

    at: At
    force: Array

    def value(self, bodies: list[tuple[Array, Array]]) -> complex:
        return complex(-self.force @ self.at.now(bodies)[0])


@dataclass(frozen=True)
class Moment:
    """Semitangential, on a body whose rotation counts from `since`."""

    body: int
    moment: Array
    since: Array

    def value(self, bodies: list[tuple[Array, Array]]) -> complex:
        return complex(-np.sum(cross_matrix(self.moment) * (bodies[self.body][1] @ self.since.T)) / 2)


Part = Line | Leaf | Force | Moment


@dataclass
class Found:
    bodies: list[tuple[Array, Array]]
    force: float
    """Largest generalised force that is out of balance."""
    lowest: float
    """Eigenvalue of the Hessian."""
    hessian: Array

    def moved(self, body: int, p: Array, r: Array) -> Array:
        """(6,): displacement of the body's origin, rotation vector."""
        q, o = self.bodies[body]
        return np.array([*(q - p), *Rotation.from_matrix(o @ r.T).as_rotvec()])

    def compliance(self, body: int) -> Array:
        """(6, 6) of the body's origin, base axes."""
        at = slice(6 * body, 6 * body + 6)
        return np.asarray(np.linalg.inv(self.hessian)[at, at])


class Bodies:
    def __init__(self, start: list[tuple[Array, Array]], parts: list[Part]) -> None:
        self.start, self.parts = start, parts

    def energy(self, bodies: list[tuple[Array, Array]]) -> complex:
        return sum((part.value(bodies) for part in self.parts), 0j)

    def slope(self, bodies: list[tuple[Array, Array]]) -> Array:
        out = np.zeros(6 * len(bodies))
        for i, (p, r) in enumerate(bodies):
            for k in range(6):
                moved = list(bodies)
                if k < 3:
                    moved[i] = (p + 1j * TINY * EYE[k], r)
                else:
                    moved[i] = (p, r + 1j * TINY * cross_matrix(EYE[k - 3]) @ r)
                out[6 * i + k] = self.energy(moved).imag / TINY
        return out

    @staticmethod
    def stepped(bodies: list[tuple[Array, Array]], step: Array) -> list[tuple[Array, Array]]:
        return [
            (p + s[:3], Rotation.from_rotvec(s[3:]).as_matrix() @ r)
            for (p, r), s in zip(bodies, step.reshape(-1, 6), strict=True)
        ]

    def curve(self, bodies: list[tuple[Array, Array]], refined: bool = True) -> Array:
        n = 6 * len(bodies)
        out = np.zeros((n, n))
        for k in range(n):
            e = np.zeros(n)
            e[k] = STEP

            def difference(h: float, e: Array = e) -> Array:
                ahead, behind = (self.slope(self.stepped(bodies, s * h * e)) for s in (1, -1))
                return np.asarray((ahead - behind) / (2 * h * STEP))

            out[:, k] = (4 * difference(1) - difference(2)) / 3 if refined else difference(1)
        return out

    def least(self, start: list[tuple[Array, Array]] | None = None, most: int = 200) -> Found:
        """Down the energy from the start, by Newton's steps made positive."""
        bodies = list(self.start if start is None else start)
        weights = np.tile([1.0, 1.0, 1.0, 3.0, 3.0, 3.0], len(bodies))
        for _ in range(most):
            slope, curve = self.slope(bodies), self.curve(bodies, refined=False)
            scaled = weights[:, None] * (curve + curve.T) / 2 * weights
            values, vectors = np.linalg.eigh(scaled)
            floor = 1e-9 * np.abs(values).max()
            step = -weights * (
                vectors @ ((vectors.T @ (weights * slope)) / np.maximum(np.abs(values), floor))
            )
            size = np.abs(step).max()
            if size < 1e-14:
                break
            step *= min(1.0, LONGEST / size)
            here, share = self.energy(bodies).real, 1.0
            while size > 1e-7 and share > 1e-6:
                if self.energy(self.stepped(bodies, share * step)).real <= here + 1e-4 * share * slope @ step:
                    break
                share /= 2
            bodies = self.stepped(bodies, share * step)
        curve = self.curve(bodies)
        curve = (curve + curve.T) / 2
        return Found(
            bodies, float(np.abs(self.slope(bodies)).max()), float(np.linalg.eigvalsh(curve)[0]), curve
        )
