# SPDX-License-Identifier: MIT
"""What a corrected machine promises of poses that were not read, against what it does there.

    OPENBLAS_NUM_THREADS=1 python bench/promise.py [--sets 24]

Machines with every number off by 0, 0.5 or 1 of its standard uncertainty, most with one effect, read at 10 to 40 poses and diagnosed; 100 further
poses of the same machine are the truth. Sets that the declared machine explains make no promise.
"""

from __future__ import annotations

import argparse

import numpy as np

import stiffmap as sm
from stiffmap.experiment import Experiment, Predictor, random_plan
from stiffmap.identification.numbers import unknowns
from stiffmap.identification.numbers.sensitivity import predicted
from stiffmap.model.description import AppliedEffect
from stiffmap.solve.validity import Validity

CASES: tuple[tuple[str, str, tuple[AppliedEffect, ...]], ...] = (
    ("linear-delta", "position", (AppliedEffect("lead_error", "carriage", ("a",), (("slope", 5e-3),)),)),
    ("orthoglide-revised", "position", (AppliedEffect("length", "bar", ("x",), (("error", 1e-4),)),)),
    (
        "orthoglide-revised",
        "deflection",
        (AppliedEffect("compliance", "actuator", ("z",), (("scale", 2.0),)),),
    ),
    ("hexapod", "position", ()),
    ("ur10", "position", (AppliedEffect("zero_offset", "elbow", ("arm",), (("error", 2e-3),)),)),
    ("rotary-delta", "position", ()),
)
POSES, SPREADS, NEAR = (10, 15, 20, 40), (0.0, 0.5, 1.0), 0.15


def readings(number: int, poses: int, noise: int) -> tuple[sm.Machine, Experiment]:
    """The machine of a set as declared, and readings of the true one."""
    name, quantity, effects = CASES[number % len(CASES)]
    machine = sm.load_machine(name)
    p = Predictor(machine, random_plan(machine, quantity, poses=poses, seed=number))
    e, wanted = p.experiment, unknowns(machine.description, p.experiment)
    off = SPREADS[number % 3] * np.random.default_rng(77 + number).standard_normal(len(wanted))
    exact = predicted(p, wanted, off) + p(effects) - p()
    error = np.nan_to_num(e.sigma) * np.random.default_rng([number, noise]).standard_normal(exact.shape)
    return machine, e.with_readings(exact + error)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sets", type=int, default=24)
    good = promises = 0
    for k in range(parser.parse_args().sets):
        poses = POSES[(k // len(CASES)) % len(POSES)]
        machine, data = readings(k, poses, 0)
        _, fresh = readings(k, 100, 1)
        d = sm.diagnose(machine, data)
        found = Predictor(d.machine, fresh)
        true = float(np.sqrt(np.nanmean((found.experiment.reading - found())[:, :3] ** 2)))
        v = Validity.of_machine(d.machine)
        words = f"{k} {machine.name}, {poses} poses: {d.which}, {d.verdict}, true {1e3 * true:.4f} mm"
        if v is None or v.error is None:
            print(f"{words}, no promise", flush=True)
            continue
        promises += 1
        good += abs(v.error / true - 1.0) < NEAR
        print(
            f"{words}, promised {1e3 * v.error:.4f} ± {1e3 * v.error_u:.4f}, ratio {v.error / true:.2f}",
            flush=True,
        )
    print(f"{good} of {promises} within {100 * NEAR:.0f} %")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
