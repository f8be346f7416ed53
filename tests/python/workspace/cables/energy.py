"""Equilibria of cable machines by minimising their energy in Cartesian coordinates: shares no code with the core."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

from stiffmap.model.description import Body, Cable, MachineDescription

Floats = NDArray[np.float64]


@dataclass
class Hung:
    """What a platform without offsets hangs in: anchors, fixing points, compliances and free lengths."""

    anchor: Floats
    at: Floats
    elasticity: Floats
    stiffness: Floats
    free: Floats
    mass: float
    com: Floats
    gravity: Floats

    def tension(self, p: Floats, r: Floats) -> tuple[Floats, Floats, Floats]:
        """Tensions (n,), unit vectors (n, 3) towards the platform, arms (n, 3)."""
        arm = self.at @ r.T
        d = p + arm - self.anchor
        length = np.linalg.norm(d, axis=1)
        with np.errstate(divide="ignore"):
            compliance = self.free / self.elasticity + 1.0 / self.stiffness
        return np.maximum(length - self.free, 0.0) / compliance, d / length[:, None], arm

    def energy(self, p: Floats, r: Floats, force: Floats) -> float:
        """J, of cables, weight and a dead force at the frame's origin."""
        with np.errstate(divide="ignore"):
            compliance = self.free / self.elasticity + 1.0 / self.stiffness
        t = self.tension(p, r)[0]
        return float(
            0.5 * np.sum(t * t * compliance) - self.mass * self.gravity @ (p + r @ self.com) - force @ p
        )

    def minimum(self, p: Floats, r: Floats, force: Floats) -> tuple[Floats, Floats]:
        """The minimum that a descent from a pose leads to: position, rotation."""
        scale = np.array([1.0, 1.0, 1.0, 2.0, 2.0, 2.0])
        for _ in range(30):

            def e(x: Floats, p: Floats = p, r: Floats = r) -> tuple[float, Floats]:
                x = x * scale
                turn = Rotation.from_rotvec(x[3:]).as_matrix() @ r
                here = p + x[:3]
                t, u, arm = self.tension(here, turn)
                pull = -t[:, None] * u
                lever = turn @ self.com
                f = pull.sum(0) + self.mass * self.gravity + force
                m = np.cross(arm, pull).sum(0) + np.cross(lever, self.mass * self.gravity)
                angle = np.linalg.norm(x[3:])
                s = np.array([[0, -x[5], x[4]], [x[5], 0, -x[3]], [-x[4], x[3], 0]])
                jac = np.eye(3)
                if angle > 1e-8:  # left Jacobian of the rotation vector
                    jac = (
                        np.eye(3)
                        + (1 - np.cos(angle)) / angle**2 * s
                        + (angle - np.sin(angle)) / angle**3 * s @ s
                    )
                g = np.concatenate([-f, -jac.T @ m])
                return self.energy(here, turn, force) - self.energy(p, r, force), g * scale

            best = minimize(e, np.zeros(6), jac=True, method="BFGS", options={"gtol": 1e-11, "maxiter": 500})
            x = best.x * scale
            p, r = p + x[:3], Rotation.from_rotvec(x[3:]).as_matrix() @ r
            if np.abs(x).max() < 1e-11:
                break
        return p, r


def hung(machine: MachineDescription, p: Floats, r: Floats) -> Hung:
    """At a commanded pose of the tcp, which is where the platform starts."""
    cables = [e for e in machine.platform if isinstance(e, Cable)]
    bodies = [e for e in machine.platform if isinstance(e, Body)]
    anchor, at = np.array([c.anchor for c in cables]), np.array([c.at for c in cables])
    elasticity = np.array([c.elasticity or np.inf for c in cables])
    stiffness = np.array([c.stiffness or np.inf for c in cables])
    pretension = np.array([c.pretension for c in cables])
    offset = np.array([sum(e.offset for e in c.command_errors) for c in cables])
    length = np.linalg.norm(p + at @ r.T - anchor, axis=1)
    free = (length - pretension / stiffness) / (1.0 + pretension / elasticity) + offset
    mass = sum(b.mass for b in bodies)
    com = sum((b.mass * np.array(b.com) for b in bodies), np.zeros(3)) / max(mass, 1e-300)
    return Hung(anchor, at, elasticity, stiffness, free, mass, com, np.array(machine.gravity or (0, 0, 0)))
