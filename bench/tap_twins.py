"""Tap tests of machines with one undeclared effect, made by MuJoCo, and of machines without any.

    python bench/tap_twins.py --twins 20 --nulls 100

The numbers of the machine file are off by their uncertainties (masses by 5 %) in every twin; frequencies carry 0.5 % noise,
directions 0.05. Prints how often the effect is named, listed beside others, missed or wrong, how often nulls get a cause,
and how many standard deviations the fitted number is off.
"""

from __future__ import annotations

import argparse

import numpy as np
from tests.python.vibration.mujoco_frf import machine_of, modes

import stiffmap as sm
from stiffmap.effects import apply_records
from stiffmap.taps import TapTest, explain_taps
from stiffmap.taps.explain import _candidates
from stiffmap.taps.problem import shifted, uncertain_numbers

MACHINES = ("ur10", "orthoglide-revised", "five-bar", "linear-delta", "travelling-column")
POSES, MODES, NOISE, TURN, DEFAULT = 3, 4, 0.005, 0.05, 0.05


def twin(machine, rng, term=None):
    """Table of a real machine: numbers off by their uncertainty, an effect, noise."""
    numbers = uncertain_numbers(machine.description, DEFAULT)
    d = shifted(machine.description, numbers, np.clip(rng.normal(size=len(numbers)), -3, 3))
    real = sm.Machine(apply_records(d, [term] if term else []))
    low, high = machine.workspace
    rows = []
    for p in low + (high - low) * rng.uniform(0.25, 0.75, (POSES, 3)):
        f, way = modes(real, p, MODES)
        for hertz, b in zip(f, way, strict=True):
            b = b + TURN * rng.normal(size=3)
            rows.append([*p, hertz * (1 + NOISE * rng.normal()), *(b / np.linalg.norm(b))])
    r = np.array(rows)
    return TapTest(r[:, :3], r[:, 3], NOISE * r[:, 3], np.full(len(r), np.nan), r[:, 4:])


def main() -> None:
    """Run and print."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--twins", type=int, default=20)
    parser.add_argument("--nulls", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    rng = np.random.default_rng(given.seed)
    tally, false, off = {}, 0, []
    for k in range(given.twins):
        name = MACHINES[k % len(MACHINES)]
        machine = machine_of(name)
        drives = [
            c for c in _candidates(machine.description) if c.kind == "compliance" and "." not in c.element
        ]
        own = {a.rpartition(".")[2] for a in machine.actuators}
        drives = [c for c in drives if c.element in own and len(c.legs) == 1] or drives
        c = drives[rng.integers(len(drives))]
        scale = float(rng.uniform(2.5, 5.0))
        found = explain_taps(machine, twin(machine, rng, c.term([scale])), default_u=DEFAULT)
        names = [e.candidate for e in found.alike]
        how = (
            "named"
            if names[:1] == [str(c)]
            else "listed"
            if str(c) in names
            else "missed"
            if not names
            else "wrong"
        )
        tally.setdefault(name, []).append(how)
        if how == "named":
            off.append((found.alike[0].parameters["scale"] - scale) / found.alike[0].u["scale"])
        print(name, c, f"{scale:.2f}", how, found.sentence, flush=True)
    for k in range(given.nulls):
        machine = machine_of(MACHINES[k % len(MACHINES)])
        found = explain_taps(machine, twin(machine, rng), default_u=DEFAULT)
        false += found.named is not None
        if found.named is not None:
            print("false cause", machine.name, found.sentence, flush=True)
    for name, hows in tally.items():
        print(f"{name:22s}", {h: hows.count(h) for h in sorted(set(hows))})
    print("false causes", false, "of", given.nulls)
    print("within 2 standard deviations", int((np.abs(off) < 1.96).sum()), "of", len(off), np.round(off, 2))


if __name__ == "__main__":
    main()
