"""Tap tests of machines with one undeclared effect, made by MuJoCo, and of machines without any.

    python -m bench.tap_twins --twins 20 --nulls 40

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
from stiffmap.identification.taps.fit import fitted
from stiffmap.identification.taps.problem import TapsProblem, causes, shifted, uncertain_numbers
from stiffmap.model.effects import apply_records

MACHINES = ("ur10", "five-bar", "travelling-column", "linear-delta", "orthoglide-revised")
POSES, MODES, NOISE, TURN, DEFAULT = 4, 5, 0.005, 0.05, 0.05
VISIBLE = 8.0
"""Standard deviations."""
TRIES = 50
"""Drives and sizes, of which the first visible one is taken."""


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
    J = problem.slopes[problem.used]
    white = np.linalg.cholesky(np.eye(len(J)) + J @ J.T)
    return float(
        np.linalg.norm(np.linalg.solve(white, problem.residual([(place, scale)]) - problem.residual()))
    )


def drawn(machine, rng):
    """A drive that is softer than its file says, visible to these taps; None where there is none."""
    problem = TapsProblem(machine, twin(machine, rng), None, DEFAULT)
    own = {a.rpartition(".")[2] for a in machine.actuators}
    drives = [c for c in causes(problem) if c.kind == "compliance" and c.element in own and len(c.legs) == 1]
    for _ in range(TRIES if drives else 0):
        place, scale = drives[rng.integers(len(drives))], float(rng.uniform(1.5, 6.0))
        if visible(problem, place, scale) > VISIBLE:
            return place, scale
    return None


def main() -> None:
    """Run and print."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--twins", type=int, default=20)
    parser.add_argument("--nulls", type=int, default=40)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    rng = np.random.default_rng(given.seed)
    tally, false, off, nulls = {}, 0, [], 0
    for k in range(given.twins):
        name = MACHINES[k % len(MACHINES)]
        machine = machine_of(name)
        for _ in range(given.nulls * k // given.twins, given.nulls * (k + 1) // given.twins):
            found = explain_taps(machine, twin(machine, rng), default_u=DEFAULT)
            nulls, false = nulls + 1, false + bool(found.named)
            if found.named:
                print("false cause", name, found.sentence, flush=True)
        softer = drawn(machine, rng)
        if softer is None:
            print(name, "no drive is visible", flush=True)
            continue
        place, scale = softer
        taps = twin(machine, rng, place.term([scale]))
        found = explain_taps(machine, taps, default_u=DEFAULT)
        names = [[e.candidate, *(a.candidate for a in e.alike)] for e in found.named]
        how = "missed" if not names else "wrong" if len(names) > 1 or str(place) not in names[0] else (
            "named" if len(names[0]) == 1 else "listed"
        )  # fmt: skip
        tally.setdefault(name, []).append(how)
        problem = TapsProblem(machine, taps, None, DEFAULT)
        (true,) = fitted(problem, [(place, scale)]).named
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
