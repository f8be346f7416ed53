"""Energy, closures and loads of a structure at a state: gradient, exact Hessian, constraints with their slopes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from stiffmap.model.description import ExternalSpring, Joint, Spring

from ..energy import Loads
from .cables import Winch
from .closure import spread
from .relative import BOTH, CROSS, Array, Relative, State, crossed
from .structure import At, Structure, Unsupported, law_at


@dataclass(frozen=True)
class Tangent:
    """At one state; forces that the motions of the bodies (6 n,) feel, signs as of a gradient of energy."""

    slope: Array
    """Without the loads' and the constraints' share."""
    load: Array
    """Of the whole load."""
    curve: Array
    """With the constraints' share, with that of the loads."""
    gap: Array
    rows: Array
    value: Array
    """Of all measures."""
    pushes: Array
    """(pairs, 12) gradient of each pair's energy and constraints in its own motions."""
    force: Array
    """Of all measures: of laws, springs, constraints."""
    pieces: tuple[int, ...]
    """Which pieces of laws are at work."""
    tensions: dict[str, float]
    """Of cables."""


class System:
    """`target`: coordinates at which laws and rigid drives stand (measures,), `soft`: factor on compliances of laws."""

    def __init__(
        self, s: Structure, target: Array, soft: Array, loads: Loads, kind: str, turned: Array
    ) -> None:
        self.s, self.target, self.soft, self.loads, self.kind = s, target, soft, loads, kind
        self.turned = turned  # commanded rotation of the TCP
        self.winches: list[Winch] = []
        self.weighs = False  # its weight is there from the start
        self.laws: list[tuple[int, Any]] = []
        groups: list[tuple[int, Array]] = []
        kept = s.where("keep")
        number = 0
        for p in s.pairs:
            if isinstance(p.element, Joint) and p.roles[-1] == "joint":
                i = number + len(p.roles) - 1
                law = p.element.laws[p.axis]
                if law is not None:
                    self.laws.append((i, law))
                elif p.element.actuated:
                    kept.append(i)
            elif isinstance(p.element, Spring) and p.roles[0] == "spring":
                matrix, rigid, laws = springs(p.element)
                kept += [number + k for k in rigid]
                groups.append((number, matrix))
                self.laws += [(number + k, law) for k, law in laws]
            number += len(p.roles)
        self.kept = np.array(sorted(kept), dtype=int)
        self.at = np.array([[i + k for k in range(6)] for i, _ in groups], dtype=int).reshape(-1, 6)
        self.matrices = np.array([k for _, k in groups]).reshape(-1, 6, 6)
        a, b = (f.body for f in s.frames)
        dofs = np.concatenate(
            [6 * a[:, None] + np.arange(6), 6 * b[:, None] + np.arange(6)], axis=1
        )  # (pairs, 12); those of the base come last
        self.dofs = dofs
        wide = 6 * s.size + 6
        self.flat = (dofs[:, :, None] * wide + dofs[:, None, :]).ravel()
        self.bent = np.full(len(s.names), -1)
        self.bent[s.measures.bent] = np.arange(len(s.measures.bent))
        self.lifts = self._lifts()

    @property
    def closures(self) -> int:
        return len(self.kept)

    def _lifts(self) -> list[tuple[At, Array, Array, str]]:
        """Forces that keep their base axes: where, of the machine's own, of gravity and named points."""
        out = [(m.at.behind(np.eye(3), np.array(m.body.com)), m.body.mass * self.loads.gravity, m.leg)
               for m in self.s.masses]  # fmt: skip
        for name, force in self.loads.at_points.items():
            leg, at = self.s.points[plain(name)]
            out.append((at, force, leg))
        return [(at, force, np.outer(force, at.p), leg) for at, force, leg in out]

    def at_state(self, at: State, multipliers: Array, near: Array, share: float) -> Tangent:
        s, n6 = self.s, 6 * self.s.size
        rel = Relative.of(at, *s.frames)
        value, slope, second = s.measures.at(rel.z, near)
        force, stiff = np.zeros(len(value)), np.zeros(len(value))
        pieces = []
        off = value - self.target
        for i, law in self.laws:
            force[i], stiff[i] = law_at(law, off[i], self.soft[i])
            pieces += [int(np.searchsorted([x for x, _ in law.knots], off[i]))] if law.knots else []
        if len(self.at):
            np.add.at(force, self.at, np.einsum("sij,sj->si", self.matrices, off[self.at]))
        force[self.kept] += multipliers
        # in the relative poses: weights w (pairs, 12) and second derivatives (pairs, 12, 12)
        m = s.measures
        w, b = np.zeros((len(s.pairs), 12)), np.zeros((len(s.pairs), 12, 12))
        np.add.at(w, m.pair, force[:, None] * slope)
        np.add.at(b, m.pair[m.bent], force[m.bent, None, None] * second)
        for i, _ in self.laws:
            b[m.pair[i]] += stiff[i] * np.outer(slope[i], slope[i])
        if len(self.at):
            own = slope[self.at]
            np.add.at(b, m.pair[self.at[:, 0]], np.swapaxes(own, 1, 2) @ self.matrices @ own)
        pushes = np.einsum("mi,mij->mj", w, rel.slope)
        blocks = np.swapaxes(rel.slope, 1, 2) @ b @ rel.slope + rel.curve(w)
        wide = n6 + 6
        curve = np.bincount(self.flat, blocks.ravel(), wide * wide).astype(float)
        curve = curve.reshape(wide, wide)[:n6, :n6]
        gradient = np.bincount(self.dofs.ravel(), pushes.ravel(), wide)[:n6].astype(float)
        load = np.zeros(n6)
        self._pull(at, gradient, curve, pieces)
        tensions = {}
        for c in self.winches:
            tensions[c.name], own, k, _ = c.pull(at)
            pieces.append(int(k.any()))
            i = slice(6 * c.at.body, 6 * c.at.body + 6)
            gradient[i] += own
            curve[i, i] += k
        self._load(at, load, gradient, curve, share)
        rows = spread(np.einsum("ij,ijk->ik", slope[self.kept], rel.slope[m.pair[self.kept]]), s, self.kept)
        return Tangent(
            gradient, load, curve, off[self.kept], rows, value, pushes, force, tuple(pieces), tensions
        )

    def _pull(self, at: State, gradient: Array, curve: Array, pieces: list[int]) -> None:
        """Straight springs between a point and an anchor."""
        for e in self.s.d.external_springs:
            point = self.s.points[plain(e.point)][1]
            if point.body == self.s.size:
                continue
            arm = at.r[point.body] @ point.p
            line = at.p[point.body] + arm - np.array(e.anchor)
            length = float(np.linalg.norm(line))
            pull = pull_of(e, length)
            pieces.append(int(pull != 0))
            if pull == 0 and e.tension_only:
                continue
            u = line / length
            k = e.stiffness * np.outer(u, u) + pull / length * (np.eye(3) - np.outer(u, u))
            way = np.hstack([np.eye(3), -crossed(arm[None])[0]])
            i = slice(6 * point.body, 6 * point.body + 6)
            gradient[i] += way.T @ (pull * u)
            curve[i, i] += way.T @ k @ way
            turn = slice(6 * point.body + 3, 6 * point.body + 6)
            curve[turn, turn] += np.einsum("klim,i,m->kl", BOTH, pull * u, arm)

    def _load(self, at: State, load: Array, gradient: Array, curve: Array, share: float) -> None:
        """The whole load's gradient, and its share of the Hessian."""
        for number, (where, force, weights, _) in enumerate(self.lifts):
            if where.body == self.s.size:
                continue
            i, steady = 6 * where.body, self.weighs and number < len(self.s.masses)
            to = gradient if steady else load
            to[i : i + 3] -= force
            turned(to, curve, i + 3, -(weights @ at.r[where.body].T), 1.0 if steady else share)
        i, turn = 6 * self.s.tip, at.r[self.s.tip] @ self.turned.T
        force, moment = self.loads.force, self.loads.moment
        if self.kind == "follower":
            force, moment = turn @ force, turn @ moment
            curve[i : i + 3, i + 3 : i + 6] += share * crossed(force[None])[0]
        load[i : i + 3] -= force
        if self.kind == "semitangential":
            weights = crossed(moment[None])[0] @ self.turned  # energy -tr(S(m)^T R Rc^T) / 2
            turned(load, curve, i + 3, -weights @ at.r[self.s.tip].T / 2, share)
        else:
            load[i + 3 : i + 6] -= moment
            half = crossed(moment[None])[0] / 2
            curve[i + 3 : i + 6, i + 3 : i + 6] += share * (half if self.kind == "follower" else -half)


def turned(load: Array, curve: Array, i: int, weights: Array, share: float) -> None:
    """Adds the energy sum(weights * exp(w)) of a rotation, weights (3, 3) at w = 0."""
    load[i : i + 3] += np.einsum("kab,ab->k", CROSS, weights)
    curve[i : i + 3, i : i + 3] += share * np.einsum("klab,ab->kl", BOTH, weights)


def pull_of(e: ExternalSpring, length: float) -> float:
    pull = e.stiffness * (length - e.length)
    return max(pull, 0.0) if e.tension_only else pull


def plain(name: str) -> str:
    return name.removeprefix("platform.").removeprefix("base.")


def springs(e: Spring) -> tuple[Array, list[int], list[tuple[int, Any]]]:
    """Stiffness (6, 6), rigid directions, and the laws in place of directions."""
    if e.stroke is not None:
        raise Unsupported("a spring that varies with the stroke")
    laws = list(e.laws)
    if e.stiffness is not None:
        matrix, rigid = np.array(e.stiffness, dtype=float), []
    else:
        given = np.array(e.compliance, dtype=float)
        rigid = [i for i in range(6) if not given[i].any()]
        keep = [i for i in range(6) if i not in rigid]
        matrix = np.zeros((6, 6))
        matrix[np.ix_(keep, keep)] = np.linalg.inv(given[np.ix_(keep, keep)])
        rigid = [i for i in rigid if i not in dict(laws)]
    for i, _ in laws:
        matrix[i, :] = matrix[:, i] = 0.0
    return matrix, rigid, laws
