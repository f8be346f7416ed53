"""Core against oracle on one random machine."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

import stiffmap as sm

from .energy import Oracle
from .generate import Generator

GRAVITY = (0.0, 0.0, -9.81)


@dataclass(frozen=True)
class Comparison:
    """Largest differences relative to the largest entry of each kind."""

    status: sm.Status
    translation: float
    rotation: float
    compliance: float
    residual: float


def compare(seed: int, methods: tuple[str, ...] = ("reference", "fast")) -> list[Comparison]:
    """Machine, force and gravity of `seed`: solved by each method and by energy minimisation."""
    description = Generator(seed).machine()
    rng = np.random.default_rng(10_000 + seed)
    force = rng.normal(size=3) * 300
    gravity = GRAVITY if rng.random() < 0.5 else (0.0, 0.0, 0.0)
    machine = sm.Machine(description)
    truth = Oracle(description, gravity).solve(force)
    moved = truth.position - description.home.p
    turned = Rotation.from_matrix(truth.rotation @ description.home.r.T).as_rotvec()
    out = []
    for method in methods:
        wrench = [*force, 0, 0, 0]
        s = machine.solve(description.home.p, wrench, gravity=gravity, method=method, threads=1)
        scale = np.sqrt(np.diag(s.compliance))
        gap = np.abs(s.compliance[:, :3] - truth.compliance) / np.outer(scale, scale[:3])
        translation = np.abs(s.displacement[:3] - moved).max() / np.abs(moved).max()
        rotation = np.abs(s.displacement[3:] - turned).max() / np.abs(turned).max()
        status = sm.Status(int(s.status))
        out.append(Comparison(status, float(translation), float(rotation), float(gap.max()), truth.residual))
    return out
