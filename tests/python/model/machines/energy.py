"""Potential energy and closures of a machine at given coordinates, straight from its description.

Plain transforms in NumPy: no Jacobian, no equation of the method, nothing of the compiled core but the names
of the coordinates.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

import stiffmap as sm
from stiffmap.model.description import BeamStroke, Block, Body, Element, Joint, Offset, Spring

Frame = tuple[np.ndarray, np.ndarray]


def about(axis: Sequence[float], angle: float) -> np.ndarray:
    """Rotation by an angle about a unit vector."""
    x, y, z = axis
    s = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * s + (1 - np.cos(angle)) * s @ s


@dataclass
class Energy:
    """Energy under a force at the TCP and gravity; drives are commanded to `command`."""

    machine: sm.Machine
    command: dict[str, float]
    force: np.ndarray
    gravity: np.ndarray
    value: float = 0.0
    gaps: list[np.ndarray] = field(default_factory=list)
    rotation: np.ndarray = field(default_factory=lambda: np.eye(3))
    """Of the TCP frame."""

    def __call__(self, x: dict[str, float]) -> tuple[float, np.ndarray, np.ndarray]:
        """Energy, closure gaps, TCP."""
        self.value, self.gaps = 0.0, []
        d = self.machine.description
        at: Frame = self.along(d.base, (np.zeros(3), np.eye(3)), "", x)
        ends = [self.along(leg.elements, at, f"{leg.name}.", x) for leg in d.legs]
        self.close(ends)
        p, self.rotation = self.along(d.platform, ends[0], "", x)
        return self.value - self.force @ p, np.concatenate([*self.gaps, np.zeros(0)]), p

    def close(self, ends: list[Frame]) -> None:
        """Gap of each end from the first."""
        p0, r0 = ends[0]
        for p, r in ends[1:]:
            turn = r0.T @ r
            self.gaps += [p - p0, 0.5 * np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0],
                                                  turn[1, 0] - turn[0, 1]])]  # fmt: skip

    def along(self, elements: Sequence[Element], at: Frame, prefix: str, x: dict[str, float]) -> Frame:
        """Last frame of a sequence; adds what it stores."""
        p, r = at
        for e in elements:
            name = prefix + e.name
            if isinstance(e, Offset):
                built = e.actual or e.nominal
                p, r = p + r @ built.p, r @ built.r
            elif isinstance(e, Joint):
                p, r = self.joint(e, name, p, r, x)
            elif isinstance(e, Spring):
                t = np.array([x[f"{name}.{c}"] for c in ("tx", "ty", "tz", "rx", "ry", "rz")])
                k = np.array(e.stiffness) if e.stiffness else np.linalg.inv(self.compliance(e, prefix))
                self.value += 0.5 * (t - e.rest) @ k @ (t - e.rest)
                p = p + r @ t[:3]
                for axis, angle in zip(np.eye(3), t[3:], strict=True):
                    r = r @ about(axis, angle)
            elif isinstance(e, Body):
                self.value -= e.mass * self.gravity @ (p + r @ np.array(e.com))
            elif isinstance(e, Block):
                ends = [self.along(b.elements, (p, r), f"{prefix}{b.name}.", x) for b in e.branches]
                self.close(ends)
                p, r = ends[0]
        return p, r

    def compliance(self, e: Spring, prefix: str) -> np.ndarray:
        """At the commanded length: a beam's deflections go with its length to the power of 1/2 or 3/2, the wrench
        that causes them with the same."""
        c = np.array(e.compliance)
        if isinstance(e.stroke, BeamStroke):
            u = self.command[prefix + e.stroke.joint]
            longer = (e.stroke.length + e.stroke.rate * (u - e.stroke.at)) / e.stroke.length
            d = np.full(6, longer**0.5)
            d[[i for i in range(3) if i != e.stroke.along]] = longer**1.5
            c = d[:, None] * c * d
        return c

    def joint(self, e: Joint, name: str, p: np.ndarray, r: np.ndarray, x: dict[str, float]) -> Frame:
        for i, axis in enumerate(e.axes):
            q = x[name if len(e.axes) == 1 else f"{name}.{i + 1}"]
            if e.law is not None:
                self.value += 0.5 * e.law.stiffness * (q - self.command[name]) ** 2
            if e.kind == "prismatic":
                p = p + r @ (q * np.array(axis))
            else:
                r = r @ about(axis, q)
        return p, r


def differences(energy: Energy, x: dict[str, float], step: float) -> tuple[np.ndarray, np.ndarray]:
    """Gradient of the energy and Jacobian of the gaps by central differences."""
    gradient, jacobian = [], []
    for name in x:
        up, down = (energy({**x, name: x[name] + s}) for s in (step, -step))
        gradient.append((up[0] - down[0]) / (2 * step))
        jacobian.append((up[1] - down[1]) / (2 * step))
    return np.array(gradient), np.array(jacobian).T
