"""Core against oracle on one random machine."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

import stiffmap as sm
from stiffmap.description import MachineDescription

from .energy import Loads
from .generate import Generator
from .minimise import Oracle


@dataclass(frozen=True)
class Comparison:
    """Largest differences relative to the largest entry of each kind."""

    status: sm.Status
    translation: float
    rotation: float
    compliance: float
    residual: float
    truth: str
    """Of the minimiser: found, ends, given up, singular."""
    stable: bool
    """Of the minimiser: no eigenvalue of the reduced Hessian is negative."""
    crossed: bool
    """Of the minimiser: the path went through a bifurcation."""
    flags: sm.Flag
    moved: float
    """Motion of the tip by the minimiser, m."""

    @property
    def gap(self) -> float:
        """The largest of the differences."""
        return max(self.translation, self.rotation, self.compliance)


def compare(seed: int, methods: tuple[str, ...] = ("reference", "fast")) -> list[Comparison]:
    """Machine and loads of `seed`: solved by each method and by energy minimisation."""
    generator = Generator(seed)
    description = generator.machine()
    return compare_machine(description, generator.loads(description), methods)


def compare_machine(
    description: MachineDescription, loads: Loads, methods: tuple[str, ...] = ("reference", "fast")
) -> list[Comparison]:
    """A machine under loads at its home pose, solved by each method and by energy minimisation."""
    machine = sm.Machine(description)
    truth = Oracle(description, loads).solve()
    moved = truth.position - description.home.p
    turned = Rotation.from_matrix(truth.rotation @ description.home.r.T).as_rotvec()
    out = []
    for method in methods:
        s = machine.solve(
            description.home.p,
            [*loads.force, *loads.moment],
            load_type="semitangential" if loads.moment.any() else "dead",
            wrenches={n: [*f, 0, 0, 0] for n, f in loads.at_points.items()},
            gravity=loads.gravity,
            method=method,
            threads=1,
        )
        scale = np.sqrt(np.abs(np.diag(s.compliance)))
        gap = np.abs(s.compliance[:, :3] - truth.compliance) / np.outer(scale, scale[:3])
        translation = np.abs(s.displacement[:3] - moved).max() / np.abs(moved).max()
        rotation = np.abs(s.displacement[3:] - turned).max() / np.abs(turned).max()
        found = (float(translation), float(rotation), float(gap.max()), truth.residual)
        flags = sm.Flag(int(s.flags))
        out.append(
            Comparison(
                sm.Status(int(s.status)),
                *found,
                truth.kind,
                truth.stable,
                truth.crossed,
                flags,
                float(np.linalg.norm(moved)),
            )
        )
    return out
