"""How long a diagnosis takes where nothing explains the readings.

    OPENBLAS_NUM_THREADS=1 python bench/odd_sets.py --machine linear-delta --quantity deflection --rows 540

`--rows 10000` for large sets, `--planted` for the same plans with a soft drive, or a drive off its zero, in place of what
nothing explains. Deflections get a tool with couplings in all directions that changes over the workspace, positions get waves; neither is
an effect of the library. `--seed` draws others: couplings with or without symmetry, waves, cubics or what is each pose's own, of
0.1 to 3 mm. Prints CPU seconds of all threads, the peak of memory of a process of its own, the verdict, and what was not
tried; `--calibrate` the verdict of a calibration; `--elsewhere` the same where the load does not hang at the point that is read.
"""

from __future__ import annotations

import argparse
import multiprocessing
import resource
import time
from dataclasses import replace
from itertools import product

import numpy as np

import stiffmap as sm
from stiffmap.experiment import Experiment, random_plan, simulate
from stiffmap.experiment.experiment import Floats
from stiffmap.model.description import Point

MACHINES = ("orthoglide-revised", "linear-delta", "rotary-delta", "ur10", "travelling-column")


def plan_for(machine: sm.Machine, quantity: str, rows: int) -> Experiment:
    """Random poses; positions in a frame that is unknown."""
    deflection = quantity == "deflection"
    marked = "platform.gauge" in machine.points
    poses = max(rows // 12, 2) if deflection else rows // 2
    plan = random_plan(machine, quantity, poses=poses, loads=6, repeats=2, seed=1)
    if not deflection:
        plan = replace(plan, frame="unknown", tool="unknown" if machine.name == "ur10" else "known")
    return replace(plan, point="platform.gauge", load_point="platform.hook") if marked else plan


def elsewhere(machine: sm.Machine) -> sm.Machine:
    """With a hook for the load on the platform, and a point beside it that the dial gauges read."""
    d = machine.description
    marks = (Point("hook", (0.02, -0.03, -0.05)), Point("gauge", (-0.06, 0.04, 0.02)))
    return sm.Machine(replace(d, platform=(*d.platform, *marks)))


def planted(machine: sm.Machine, quantity: str, rows: int, seed: int = 0) -> Experiment:
    """Readings of a machine whose first drive is softer, or off its zero."""
    leg, _, element = machine.actuators[0].rpartition(".")
    place = {"element": element, **({"legs": [leg]} if leg else {})}
    off = {"scale": 2.0} if quantity == "deflection" else {"error": 1e-4}
    kind = "compliance" if quantity == "deflection" else "zero_offset"
    other = machine.with_effect(kind, **place, **off)
    return simulate(machine, plan_for(machine, quantity, rows), other.description.effects, seed=3 + seed)


def odd(machine: sm.Machine, quantity: str, rows: int, seed: int = 0) -> Experiment:
    """Readings of the declared machine, and what no effect explains; other seeds draw other shapes and sizes."""
    plan = plan_for(machine, quantity, rows)
    twin = simulate(machine, plan, [], seed=3 + seed)
    x = (twin.position - twin.position.mean(0)) / np.maximum(np.ptp(twin.position, axis=0), 1e-9)
    shape = coupling if quantity == "deflection" else wandering
    reading = twin.reading.copy()
    more = shape(twin, x, seed)
    reading[:, : more.shape[1]] += more
    return replace(twin, reading=np.where(twin.read, reading, np.nan), joints=None, other_joints=None)


def coupling(twin: Experiment, x: Floats, seed: int) -> Floats:
    """(n, 6) a tool that yields in all directions, otherwise at each place."""
    rng = np.random.default_rng(5 + seed)
    c = rng.standard_normal((6, 6))
    c = c @ c.T if seed % 2 == 0 else c
    size = 10.0 ** rng.uniform(-1.0, 0.5) if seed else 0.5
    change = rng.standard_normal((3, 3)) if seed else np.array([[0.0, 1.0, 0.0], [0.0] * 3, [0.0] * 3])
    more = (twin.wrench / np.abs(twin.wrench).max()) @ c
    more *= size * np.nanmedian(np.abs(twin.reading[:, :3])) / np.abs(more).max()
    return np.asarray(more * (1.0 + np.einsum("ni,ij,nj->n", x, change, x))[:, None])


def wandering(twin: Experiment, x: Floats, seed: int) -> Floats:
    """(n, 3) m, errors that no number of the machine makes."""
    if seed == 0:
        return np.stack(
            [2e-4 * np.sin(7 * x[:, a] + 5 * x[:, (a + 1) % 3] ** 2 + a) for a in range(3)], axis=-1
        )
    rng = np.random.default_rng(5 + seed)
    size = 1e-3 * 10.0 ** rng.uniform(-1.0, 0.5)
    if seed % 3 == 0:  # waves
        found = np.sin(x @ (rng.uniform(2.0, 12.0) * rng.standard_normal((3, 3))) + rng.uniform(0.0, 6.0, 3))
    elif seed % 3 == 1:
        found = 2.0 * np.einsum("ni,nj,nk,ijka->na", x, x, x, rng.standard_normal((3, 3, 3, 3)))
    else:
        found = rng.standard_normal((int(twin.groups.max()) + 1, 3))[twin.groups]
    return np.asarray(size * found * ([0.0, 0.0, 1.0] if rng.random() < 0.3 else [1.0] * 3))


def main() -> None:
    """One line per machine and quantity."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--machine", action="append", choices=MACHINES)
    parser.add_argument("--quantity", action="append", choices=("deflection", "position"))
    parser.add_argument("--rows", type=int, default=540)
    parser.add_argument("--seed", type=int, action="append", help="default: 0")
    parser.add_argument("--planted", action="store_true")
    parser.add_argument("--elsewhere", action="store_true", help="the load hangs beside what is read")
    parser.add_argument("--calibrate", action="store_true")
    o = parser.parse_args()
    for name in o.machine or MACHINES:
        for quantity, seed in product(o.quantity or ("deflection", "position"), o.seed or [0]):
            with multiprocessing.get_context("spawn").Pool(1) as alone:
                print(alone.apply(measured, (name, quantity, seed, o)), flush=True)


def measured(name: str, quantity: str, seed: int, o: argparse.Namespace) -> str:
    """The line of one set."""
    machine = elsewhere(sm.load_machine(name)) if o.elsewhere else sm.load_machine(name)
    data = (planted if o.planted else odd)(machine, quantity, o.rows, seed)
    begun = time.process_time()
    told = calibrated(machine, data) if o.calibrate else diagnosed(machine, data)
    took = time.process_time() - begun
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
    return f"{name} {quantity} {seed}: {took:.1f} s, {peak:.2f} GB, {told}"


def diagnosed(machine: sm.Machine, data: Experiment) -> str:
    """What a diagnosis says."""
    d = sm.diagnose(machine, data, seed=0)
    named = [f"{e.kind} of {e.element}" for e in d.effects]
    return f"{d.verdict} {named}, {len(d.not_tried)} steps not tried"


def calibrated(machine: sm.Machine, data: Experiment) -> str:
    """What a calibration says."""
    c = sm.calibrate(machine, data)
    return f"{c.verdict}; {100 * c.explained:.0f} % explained; refused {list(c.refused)}"


if __name__ == "__main__":
    main()
