# SPDX-License-Identifier: MIT
"""One large fault among many small ones, over the number of poses: how often it is named, and how often anything false is.

    OPENBLAS_NUM_THREADS=1 python bench/large_fault_study.py [--draws 4] [--poses 20 80 300 1000] [--machines ur10 ...]

Every uncertain number of a machine is off by a draw from half of its standard uncertainty; one axis direction, link or place that the
plan tells is off by ten of them, or none is (the control). Frame unknown; a smooth wave of one noise floor that no number makes lies below all.
Named: the claim, or its rivals, contain it. False: a single number is claimed whose list does not contain it.
"""

from __future__ import annotations

import argparse
from dataclasses import replace

import numpy as np

import stiffmap as sm
from stiffmap.experiment import Experiment, Predictor, random_plan
from stiffmap.identification.calibration import Unknown, calibrate, unknowns
from stiffmap.identification.calibration.calibrator import Calibrator
from stiffmap.identification.calibration.model import predicted

MACHINES = ("ur10", "linear-delta", "hexapod", "rotary-delta", "orthoglide-revised")
SMALL, LARGE = 0.5, 10.0
TOLD = 3.0
"""u over sigma from which a number is one that the plan tells alone."""


def telling(names: tuple[Unknown, ...], found: Calibrator) -> list[int]:
    """Numbers that the plan tells three times better than their uncertainty does."""
    spread = np.sqrt(np.diag(found.sums.covariance))
    plain = ("axis directions", "axis positions", "zeros", "lengths", "mismatch", "gains")
    return [i for i, u in enumerate(names) if u.group in plain and spread[i] < 1.0 / TOLD]


def twin(machine: sm.Machine, poses: int, seed: int, fault: bool) -> tuple[Experiment, str]:
    """Readings and the name of what is far off; empty: nothing is."""
    plan = replace(random_plan(machine, "position", poses=poses, repeats=1, seed=seed), frame="unknown")
    p = Predictor(machine, plan)
    wanted = unknowns(machine.description, p.experiment)
    found = Calibrator.of(p, wanted)
    names = found.sensitivity.unknowns
    rng = np.random.default_rng(seed)
    t = SMALL * rng.standard_normal(len(names)) * np.array([not u.of_instrument for u in names])
    what = ""
    tell = telling(names, found)
    if fault and tell:
        i = int(rng.choice(tell))
        t[i], what = LARGE * rng.choice((-1.0, 1.0)), names[i].name
    sigma = np.nan_to_num(p.experiment.sigma)
    x = (p.experiment.position - p.experiment.position.mean(0)) / np.ptp(p.experiment.position, axis=0)
    wave = np.sin(x @ (6.0 * rng.standard_normal((3, 3))) + rng.uniform(0.0, 6.0, 3))
    noise = sigma * rng.standard_normal(sigma.shape)
    noise[:, :3] += sigma[:, :3] * wave
    return p.experiment.with_readings(predicted(p, names, t) + noise), what


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--machines", nargs="+", default=list(MACHINES))
    parser.add_argument("--poses", nargs="+", type=int, default=[20, 80, 300, 1000])
    parser.add_argument("--draws", type=int, default=4)
    parser.add_argument("--verbose", action="store_true")
    a = parser.parse_args()
    print("| machine | poses | named | false beside it | false in the control |\n|---|---|---|---|---|")
    wrong = 0
    for name in a.machines:
        machine = sm.load_machine(name)
        for poses in a.poses:
            told = named = false = control = 0
            for seed in range(a.draws):
                data, what = twin(machine, poses, seed, True)
                if what:
                    c = calibrate(machine, data)
                    hits = [what in (b.name, *b.rivals) for b in c.beyond]
                    told, named, false = told + 1, named + any(hits), false + (not all(hits))
                    if a.verbose and (not any(hits) or not all(hits)):
                        print(what, seed, c.verdict, c.refused)
                quiet = calibrate(machine, twin(machine, poses, seed, False)[0])
                control += bool(quiet.beyond or quiet.wider)
                if a.verbose and (quiet.beyond or quiet.wider):
                    print("control", seed, quiet.verdict)
            wrong += false + control
            print(f"| {name} | {poses} | {named} of {told} | {false} | {control} |", flush=True)
    return int(wrong > 0)


if __name__ == "__main__":
    raise SystemExit(main())
