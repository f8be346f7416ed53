"""How far two solutions are apart, in the metric of the project's reference cases, and who draws poses."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

import stiffmap as sm
from stiffmap.model.description import Point

TOLERANCE = 1e-10
FLOOR_TRANSLATION, FLOOR_ROTATION = 1e-14, 1e-13  # m, rad

# machine -> largest force (N) and moment (N·m) of a random load
LOADS = {
    "orthoglide-revised": (1000.0, 60.0),
    "orthoglide-original": (1000.0, 60.0),
    "tripteron": (1000.0, 60.0),
    "hexapod": (1000.0, 60.0),
    "linear-delta": (10.0, 1.0),
    "rotary-delta": (20.0, 2.0),
    "hybrid": (300.0, 20.0),
    "ur10": (50.0, 5.0),
    "five-bar": (50.0, 1.0),
    "swing-table": (50.0, 1.0),
    "3-rps": (300.0, 20.0),
    "travelling-column": (1000.0, 60.0),
}


class Gap(NamedTuple):
    """Largest differences: displacement and compliance dimensionless, wrong statuses, poses compared."""

    displacement: float
    compliance: float
    statuses: int
    poses: int

    def worst(self) -> float:
        """Largest dimensionless difference."""
        return max(self.displacement, self.compliance)


def draw(machine: sm.Machine, n: int, seed: int, margin: float = 0.05) -> tuple[np.ndarray, np.ndarray]:
    """Positions (n, 3) m in the workspace box, without a margin of its faces, and wrenches (n, 6)."""
    rng = np.random.default_rng(seed)
    low, high = machine.workspace
    edge = margin * (high - low)
    force, moment = LOADS[machine.name]
    size = np.array([force] * 3 + [moment] * 3)
    return rng.uniform(low + edge, high - edge, (n, 3)), size * rng.uniform(-1, 1, (n, 6))


def displacement_gap(a: np.ndarray, b: np.ndarray) -> float:
    """Largest difference of displacements (n, 6) in multiples of the largest component of either kind."""
    worst = 0.0
    for part, floor in ((slice(0, 3), FLOOR_TRANSLATION), (slice(3, 6), FLOOR_ROTATION)):
        size = np.abs(b[:, part]).max(axis=1, keepdims=True)
        # the floor in the unit of the tolerance: |a - b| <= tolerance * size + floor
        over = np.maximum(np.abs(a[:, part] - b[:, part]) - floor, 0.0)
        worst = max(worst, float(np.max(over / np.maximum(size, 1e-300), initial=0.0)))
    return worst


def compliance_gap(a: np.ndarray, b: np.ndarray) -> float:
    """Largest difference of compliances (n, 6, 6), each entry in multiples of sqrt(C_ii C_jj)."""
    size = np.sqrt(np.abs(np.diagonal(b, axis1=-2, axis2=-1)))
    return float(np.max(np.abs(a - b) / (size[:, :, None] * size[:, None, :]), initial=0.0))


def pointed(machine: sm.Machine) -> sm.Machine:
    """The machine with two more points on its tip's body, one in the middle and one at the end of each leg, and one on
    its base."""
    d = machine.description

    def marked(elements: tuple) -> tuple:
        at = len(elements) // 2
        return (*elements[:at], Point("middle", (0.01, 0.02, 0.03)), *elements[at:], Point("end"))

    legs = tuple(replace(leg, elements=marked(leg.elements)) for leg in d.legs)
    tip = (Point("probe", (0.03, 0.05, -0.12)), Point("gauge", (-0.1, 0.02, 0.06)))
    floor = Point("floor", (0.1, 0.0, 0.0))
    return sm.Machine(replace(d, legs=legs, platform=(*d.platform, *tip), base=(*d.base, floor)))


def several(wrench: np.ndarray, case: int, machine: sm.Machine) -> dict[str, object]:
    """Options of a call on a `pointed` machine with other reading points, several loads, and both."""
    two = {"platform.probe": wrench[::-1], "tcp": np.roll(wrench, 3, axis=0)}
    types = {"platform.probe": "follower", "tcp": "semitangential"}
    every = [p for p in machine.points if p != "tcp"]
    return (
        {"read_points": every},
        {"point": "platform.probe", "read_points": every[::-2]},
        {"wrenches": {"platform.probe": two["platform.probe"]}, "read_points": ["platform.gauge"]},
        {"point": "platform.gauge", "wrenches": two, "load_type": types, "read_points": every[::2]},
        {
            "wrenches": {"tcp": -wrench, "platform.gauge": two["tcp"]},
            "load_type": {"platform.gauge": "follower"},
        },
    )[case]


def reading_gap(a: sm.Solution, b: sm.Solution) -> float:
    """`displacement_gap` of every reading point where both have an equilibrium."""
    ok = a.ok & b.ok
    pairs = zip(np.moveaxis(a.readings[ok], -2, 0), np.moveaxis(b.readings[ok], -2, 0), strict=True)
    return max(displacement_gap(x, y) for x, y in pairs)


def compare(fast: sm.Solution, reference: sm.Solution) -> Gap:
    """Statuses everywhere, numbers where the reference has an equilibrium."""
    ok = reference.ok & fast.ok
    compliance = np.isfinite(reference.compliance).all(axis=(-2, -1)) & ok
    np.testing.assert_array_equal(compliance, np.isfinite(fast.compliance).all(axis=(-2, -1)) & ok)
    return Gap(
        displacement_gap(fast.displacement[ok], reference.displacement[ok]),
        compliance_gap(fast.compliance[compliance], reference.compliance[compliance]),
        int((fast.status != reference.status).sum()),
        int(ok.sum()),
    )


def gap(machine: sm.Machine, position: np.ndarray, wrench: np.ndarray, **options: object) -> Gap:
    """Both paths on the same poses."""
    fast = machine.solve(position, wrench, method="fast", threads=1, **options)
    return compare(fast, machine.solve(position, wrench, method="reference", threads=1, **options))
