"""Tap tests of machines with one undeclared effect, made by MuJoCo, and of machines without any.

    python -m bench.tap_twins --twins 20 --nulls 100

The numbers of the machine file are off by their uncertainties (masses by 5 %) in every twin; frequencies carry 0.5 % noise,
directions 0.05. An effect is a drive 1.5 to 6 times as soft as declared that shifts the readings by 8 standard deviations or more
which no uncertain number can imitate. Prints how often it is named alone, listed with others that the readings cannot tell
from it, missed or wrong, how often nulls get a cause, and how many standard deviations the fitted number is off.
"""

from __future__ import annotations

import argparse

import numpy as np
from tests.python.workspace.vibration.mujoco_frf import machine_of, modes

import stiffmap as sm
from stiffmap.identification.taps import TapTest, explain_taps
from stiffmap.identification.taps.causes import causes
from stiffmap.identification.taps.causes import term as change
from stiffmap.identification.taps.explain import _fitted, _refined
from stiffmap.identification.taps.problem import TapsProblem, shifted, uncertain_numbers
from stiffmap.model.effects import apply_records

MACHINES = ("ur10", "orthoglide-revised", "five-bar", "linear-delta", "travelling-column")
POSES, MODES, NOISE, TURN, DEFAULT = 4, 5, 0.005, 0.05, 0.05
VISIBLE = 8.0
"""Standard deviations."""


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


def visible(problem, place, scale):
    """Standard deviations by which an effect shifts the readings, net of what uncertain numbers can imitate, to first order."""
    rows, W = problem.whitener()
    return float(np.linalg.norm(W @ (problem.residual(change(place, scale)) - problem.residual())[rows]))


def drawn(machine, rng):
    """A drive that is softer than its file says, visible to these taps."""
    problem = TapsProblem(machine, twin(machine, rng), None, DEFAULT)
    own = {a.rpartition(".")[2] for a in machine.actuators}
    drives = [c for c in causes(problem) if c.kind == "compliance" and c.element in own]
    while True:
        place, scale = drives[rng.integers(len(drives))], float(rng.uniform(1.5, 6.0))
        if len(place.legs) == 1 and visible(problem, place, scale) > VISIBLE:
            return place, scale


def main() -> None:
    """Run and print."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--twins", type=int, default=30)
    parser.add_argument("--nulls", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    rng = np.random.default_rng(given.seed)
    tally, false, off, nulls = {}, 0, [], 0
    for k in range(given.twins):
        name = MACHINES[k % len(MACHINES)]
        machine = machine_of(name)
        for _ in range(given.nulls * k // given.twins, given.nulls * (k + 1) // given.twins):
            found = explain_taps(machine, twin(machine, rng), default_u=DEFAULT)
            nulls, false = nulls + 1, false + (found.named is not None)
            if found.named is not None:
                print("false cause", name, found.sentence, flush=True)
        place, scale = drawn(machine, rng)
        taps = twin(machine, rng, place.term([scale]))
        found = explain_taps(machine, taps, default_u=DEFAULT)
        names = [e.candidate for e in found.alike]
        right = str(place) in names
        how = "named" if right and len(names) == 1 else "listed" if right else "wrong" if names else "missed"
        tally.setdefault(name, []).append(how)
        problem = TapsProblem(machine, taps, None, DEFAULT)
        true = _refined(problem, _fitted(problem, place))
        off.append(
            float(np.log(true.parameters["scale"] / scale) * true.parameters["scale"] / true.u["scale"])
        )
        print(name, place, f"{scale:.2f}", how, f"{off[-1]:.2f}", found.sentence, flush=True)
        print(
            f"false causes {false} of {nulls}; within 1.96 {int((np.abs(off) < 1.96).sum())} of {len(off)}",
            flush=True,
        )
    for name, hows in tally.items():
        print(f"{name:22s}", {h: hows.count(h) for h in ("named", "listed", "wrong", "missed")})


if __name__ == "__main__":
    main()
