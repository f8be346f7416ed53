"""Cables that only pull: from a point of a body to an eye or over a pulley in the base; free length commanded by a winch.

In the plane of the pulley's axis a and of the direction e to the body, the pulley touches the anchor and the cable comes
along a. It leaves at the angle b from a along u = (sin b, cos b); the end is B = C + r (-cos b, sin b) + s u. From
dB = (r db + ds) u + s n db, n = (cos b, -sin b): the way r b + s grows by u . dB, and b by n . dB / s."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stiffmap.model.description import Cable

from .relative import BOTH, Array, State, crossed
from .structure import At, Structure, Unsupported


def way(anchor: Array, guide: Array, radius: float, end: Array) -> tuple[float, Array, Array]:
    """Length, its gradient and its second derivative by the end."""
    off = end - anchor
    if radius == 0.0:
        length = float(np.linalg.norm(off))
        u = off / length
        return length, u, (np.eye(3) - np.outer(u, u)) / length
    high = float(guide @ off)
    side = off - high * guide
    far = float(np.linalg.norm(side))
    e = side / far
    straight = float(np.sqrt((far - radius) ** 2 + high**2 - radius**2))
    b = np.arctan2(far - radius, high) + np.arctan2(radius, straight)
    u, n = np.sin(b) * e + np.cos(b) * guide, np.cos(b) * e - np.sin(b) * guide
    t = np.cross(guide, e)
    return radius * b + straight, u, np.outer(n, n) / straight + np.sin(b) / far * np.outer(t, t)


@dataclass(frozen=True)
class Winch:
    """A cable and its free length."""

    e: Cable
    at: At
    leg: str
    name: str
    free: float

    @staticmethod
    def commanded(e: Cable, at: At, leg: str, name: str, state: State) -> Winch:
        """The free length for which the cable as drawn carries its pretension at the state."""
        if e.lead_tension != 1.0 or any(c.reference is None for c in e.command_errors):
            raise Unsupported("friction of a cable's guide")
        end = state.p[at.body] + state.r[at.body] @ (at.p + at.r @ np.array(e.at))
        length = way(np.array(e.anchor), np.array(e.guide), e.radius, end)[0]
        soft, steady = compliances(e)
        free = (length - e.pretension * (e.lead * soft + steady)) / (1 + e.pretension * soft)
        return Winch(e, at, leg, name, free)

    @property
    def real(self) -> float:
        """With the errors of its command."""
        out = self.free
        for c in self.e.command_errors:
            v = self.free - (c.reference or 0.0)
            out += c.offset + c.slope * v + c.amplitude * np.sin(2 * np.pi * v / c.period + c.phase)
        return float(out)

    def pull(self, state: State) -> tuple[float, Array, Array, Array]:
        """Tension, gradient (6,) and Hessian (6, 6) of its energy in the motion of its body, and where it holds it."""
        e, body = self.e, self.at.body
        arm = state.r[body] @ (self.at.p + self.at.r @ np.array(e.at))
        anchor = np.array(e.anchor) + np.array(e.anchor_error)
        length, u, bend = way(anchor, np.array(e.guide), e.radius, state.p[body] + arm)
        soft, steady = compliances(e)
        over, c = length - self.real, ((self.real + e.lead) * soft + steady) * e.stretch
        if over < -1e-12 * length:
            return 0.0, np.zeros(6), np.zeros((6, 6)), arm
        tension = max(over, 0.0) / c
        lever = np.hstack([np.eye(3), -crossed(arm[None])[0]])
        k = lever.T @ (np.outer(u, u) / c + tension * bend) @ lever
        k[3:, 3:] += np.einsum("klim,i,m->kl", BOTH, tension * u, arm)
        return tension, lever.T @ (tension * u), k, arm


def compliances(e: Cable) -> tuple[float, float]:
    """Per length of the cable, and that of what is in series."""
    return 1 / e.elasticity if e.elasticity else 0.0, 1 / e.stiffness if e.stiffness else 0.0


def winches(s: Structure, state: State) -> list[Winch]:
    return [Winch.commanded(e, at, leg, name, state) for name, leg, at, e in s.cables if at.body != s.size]
