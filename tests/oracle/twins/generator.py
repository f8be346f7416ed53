"""Twins of machines: readings of a machine whose faults are known, by the energy minimiser of the oracle.

Nothing of the library makes a reading: the tree is edited by hand (`faults`), the equilibrium is that of the oracle's
Cartesian bodies, the noise is `noise`. The library sees what a workshop would hand it, an experiment.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from tests.oracle.cartesian.solve import Machine
from tests.oracle.energy import Loads
from tests.oracle.twins.faults import Fault, elastic, geometric, jitter, plain
from tests.oracle.twins.noise import KINDS

import stiffmap as sm
from stiffmap.experiment import Experiment
from stiffmap.experiment.virtual.plans import plan_of_poses, random_poses
from stiffmap.model.description import MachineDescription, Pose

MACHINES = (
    "3-rps", "five-bar", "hexapod", "hybrid", "linear-delta", "orthoglide-original", "orthoglide-revised",
    "rotary-delta", "swing-table", "travelling-column", "tripteron", "ur10",
)  # fmt: skip
NOISE = {"deflection": 1e-6, "position": 8e-6}
ZERO = np.zeros(3)
STIFFEST = 8.0
"""A part that yields so many times more than declared, and one, is the softest that is tried."""


@dataclass(frozen=True)
class Twin:
    """Readings, and what is wrong with the machine that they were made of."""

    name: str
    machine: sm.Machine
    """As declared."""
    experiment: Experiment
    faults: tuple[Fault, ...]
    sizes: tuple[float, ...]
    signal: np.ndarray
    """(n, 3) m: what the faults alone change of the readings."""


def twin(number: int, *, kind: str, faults: int, poses: int, strength: float, spread: float) -> Twin:
    """A twin by its number, which is its seed too: machine and quantity in turn.

    kind
        Of the noise. `faults`: how many. `strength`: rms of what the faults change, in noise. `spread`: how far all other
        numbers are off, in the usual standard uncertainties.
    """
    rng = np.random.default_rng([number, 77])
    name = MACHINES[number % len(MACHINES)]
    quantity = ("deflection", "position")[(number // len(MACHINES)) % 2]
    declared = plain(sm.load_machine(name).description)
    machine = sm.Machine(declared)
    plan = _plan(machine, quantity, poses, number)
    base = jitter(declared, rng, spread) if spread else declared
    none = shown(declared, base, plan)
    chosen: list[Fault] = []
    sizes: list[float] = []
    whole, real = none, base
    sigma = NOISE[quantity] * (10.0 if spread else 1.0)
    few = np.arange(len(plan)) < 3
    may = (elastic if quantity == "deflection" else geometric)(declared)
    for i in map(int, rng.permutation(len(may))):
        if len(chosen) == faults:
            break
        f = may[i]
        size = f.typical
        if (
            rms(shown(declared, f.of(real, size), plan.rows(few)) - whole[few]) < 1e-9
        ):  # the plan does not feel it
            continue
        change = shown(declared, f.of(real, size), plan) - whole
        for _ in range(2):
            if abs(rms(change) / (strength * sigma) - 1.0) < 0.25 or size >= STIFFEST:
                break
            size *= strength * sigma / rms(change)
            if quantity == "deflection":
                size = min(size, STIFFEST)
            change = shown(declared, f.of(real, size), plan) - whole
        if not np.isfinite(change).all() or rms(change) < 0.5 * strength * sigma:
            continue
        real, whole = f.of(real, size), whole + change
        chosen.append(f)
        sizes.append(size)
    noise = sigma * KINDS[kind](rng, len(plan), 3)
    reading = np.full(plan.reading.shape, np.nan)
    reading[:, :3] = np.where(plan.axis_read[:3], whole + noise, np.nan)
    size_of = np.where(np.isfinite(reading), sigma, np.nan)
    data = replace(plan.with_readings(reading), sigma=size_of, order=np.arange(len(plan)))
    return Twin(
        f"{number} {name} {quantity} {kind}", machine, data, tuple(chosen), tuple(sizes), whole - none
    )


def rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.nanmean(values**2)))


def _plan(machine: sm.Machine, quantity: str, poses: int, seed: int) -> Experiment:
    low, high = machine.workspace
    middle = (low + high) / 2
    at = middle + (random_poses(machine, poses, seed) - middle) * 0.8
    planar = high[2] == low[2]
    force = 100.0
    ways = np.eye(3)[: 2 if planar else 3]
    loads = np.array([[*(force * w), 0.0, 0.0, 0.0] for w in ways])
    axes = ("dx", "dy") if planar else ("dx", "dy", "dz")
    return plan_of_poses(machine, quantity, at, loads, axes=axes, noise=NOISE[quantity])


def shown(declared: MachineDescription, real: MachineDescription, plan: Experiment) -> np.ndarray:
    """(n, 3) m: readings of the machine as built, by least energy."""
    oracle = Machine(real)
    out = np.zeros((len(plan), 3))
    rest: dict[tuple[float, ...], np.ndarray] = {}
    deflection = plan.quantity == "deflection"
    for i, (p, w) in enumerate(zip(plan.position, plan.wrench, strict=True)):
        pose = Pose.of(p, np.array(declared.home.r))
        key = tuple(p)
        if key not in rest:
            rest[key] = _moved(oracle, ZERO, pose) if not deflection or real != declared else np.zeros(3)
        out[i] = (_moved(oracle, w[:3], pose) - rest[key]) if deflection else rest[key]
    return out


def _moved(oracle: Machine, force: np.ndarray, pose: Pose) -> np.ndarray:
    found = oracle.solve(Loads(force, ZERO, ZERO, {}), pose)
    return found.displacement[:3] if found.found else np.full(3, np.nan)
