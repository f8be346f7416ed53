"""Solve many random cases and verify every answer by free bodies (`statics`), or see that it is flagged.

    python -m tests.oracle.many --count 10000000 [--machine NAME ...] [--random] [--out many.jsonl] [--jobs 2]
        [--batch 2000]

Shipped machines x effects x poses in, on and beyond the workspace x loads from nothing to buckling x load types x gravity,
and random machines of all families and classes (`crowd`); --random: these only. An answer CONVERGED must balance to 1e-6
of the largest force in the machine, close to 1e-6 of its size, and have moved its TCP by the displacement that it states;
every other status must come without numbers. Batches are written to --out as they end; the same command goes on where it
was stopped. Of a hundredth of the batches the reference path solves 20 poses: ask for an eighth more than is wanted. What
round-off of the coordinates alone would do proves nothing (`statics.noise`) and is counted as undecided. Exit code 1 where
an answer is wrong.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from tests.oracle.crowd import KINDS, crowd
from tests.oracle.statics import coordinates
from tests.oracle.verify import Question, verified
from tests.oracle.with_effects import VALUES, with_effect

import stiffmap as sm

BATCH = 2000
RARE = {"dead_zone": 20, "position_offset": 20, "axis_tilt": 20}
"""Effects whose batches are smaller by this, since the reference path decides about each pose: with a gap in every drive and every
direction of a spring some bear nothing; rods that are off their axis spin under gravity."""
EFFECTS = ("as declared", *VALUES)
CROWD = 8  # random machines of a kind for each round over the shipped ones
RANDOM = "random"
"""Of a batch whose machine is a kind of `crowd`, drawn by the seed."""


@dataclass(frozen=True)
class Batch:
    """One call of `Machine.solve`."""

    machine: str
    effect: str
    seed: int


def batches(machines: list[str], count: int, size: int, kinds: tuple[str, ...] = ()) -> Iterator[Batch]:
    """As many as make `count` solves, machines and effects in turn, and random machines of kinds."""
    made = seed = 0
    while made < count:
        for kind in kinds:
            for k in range(CROWD):
                if made >= count:
                    return
                yield Batch(kind, RANDOM, CROWD * seed + k)
                made += size
        for name in machines:
            for effect in EFFECTS:
                if made >= count:
                    return
                yield Batch(name, effect, seed)
                made += size_of(effect, size)
        seed += 1


def size_of(effect: str, size: int) -> int:
    """Solves of a batch."""
    return max(1, size // RARE.get(effect, 1))


@cache
def changed(name: str, effect: str) -> tuple[sm.Machine | None, tuple[str, ...]]:
    """A shipped machine with an effect at every place that takes it, and the places that refused it."""
    machine = sm.load_machine(name)
    return (machine, ()) if effect == "as declared" else with_effect(machine, effect)


@cache
def buckling(name: str) -> float:
    """Force (N) under which a tenth of random poses and directions of a shipped machine have no stable answer."""
    machine, rng = sm.load_machine(name), np.random.default_rng(0)
    p, force = rng.uniform(*machine.workspace, (50, 3)), rng.normal(size=(50, 3))
    force /= np.linalg.norm(force, axis=1)[:, None]
    level = 10.0
    while level < 1e5:
        wrench = np.hstack([level * force, np.zeros((50, 3))])
        if (machine.solve(p, wrench, threads=1).status != sm.Status.CONVERGED).mean() > 0.1:
            break
        level *= 1.5
    return level


def asked(machine: sm.Machine, rng: np.random.Generator, count: int) -> tuple[np.ndarray, dict[str, object]]:
    """Positions (n, 3) and the load of a batch."""
    low, high = machine.workspace
    middle, half = (low + high) / 2, (high - low) / 2
    u = rng.uniform(-1, 1, (count, 3))
    where = rng.integers(0, 4, count)
    u[where == 1] = np.clip(u[where == 1] * 3, -1, 1)  # on the faces, edges and corners
    u[where == 2] *= 1.8  # beyond
    force = rng.normal(size=(count, 3))
    size = buckling(machine.description.name) * 10 ** rng.uniform(-4, 0.02, count) * (rng.random(count) < 0.9)
    force *= (size / np.linalg.norm(force, axis=1))[:, None]
    kind = str(rng.choice(["dead", "dead", "follower", "semitangential"]))
    moment = np.zeros((count, 3))
    if kind != "dead":
        moment = 0.05 * np.linalg.norm(force, axis=1)[:, None] * rng.normal(size=(count, 3))
    gravity = [0.0, 0.0, -9.81] if rng.random() < 0.5 else [0.0, 0.0, 0.0]
    return middle + u * half, {
        "wrench": np.hstack([force, moment]),
        "load_type": kind,
        "gravity": gravity,
        "method": "reference" if rng.random() < 0.01 else "fast",
    }


def timed(batch: Batch, count: int) -> dict[str, object]:
    """`run`, and the CPU time that it took, s."""
    start = time.process_time()
    return {**run(batch, count), "cpu": round(time.process_time() - start, 3)}


def run(batch: Batch, count: int = BATCH) -> dict[str, object]:
    """Counts, worst numbers and the wrong answers of a batch."""
    key = [batch.seed, *batch.machine.encode(), *batch.effect.encode()]
    if batch.effect == RANDOM:
        question = crowd(batch.machine, batch.seed, count)
        return judged(batch, question, ())
    machine, refused = changed(batch.machine, batch.effect)
    if machine is None:
        return {**vars(batch), "solves": 0, "refused": refused}
    p, load = asked(machine, np.random.default_rng(key), count)
    if load["method"] == "reference":
        p = p[:20]
        load["wrench"] = load["wrench"][:20]  # type: ignore[index]
    return judged(batch, question_at(machine, p, load), refused)


def question_at(machine: sm.Machine, p: np.ndarray, load: dict[str, object]) -> Question:
    """Poses, and what the controller commands there. The free bodies see whether it closes."""
    names = machine.compiled.names.coordinates
    return Question(machine, load, p, commanded(machine, p, names), machine_size(machine))


def judged(batch: Batch, q: Question, refused: tuple[str, ...]) -> dict[str, object]:
    s = q.solve()
    failed = np.isin(s.status, (int(sm.Status.UNREACHABLE), int(sm.Status.NOT_CONVERGED)))
    numbers = np.isfinite(s.displacement).any(1) | np.isfinite(s.stiffness).any((1, 2))
    good = s.status == sm.Status.CONVERGED
    finite = np.isfinite(s.displacement).all(1)
    wrong = {int(i): "a number with a failed status" for i in np.flatnonzero(failed & numbers)}
    wrong |= {int(i): "CONVERGED without numbers" for i in np.flatnonzero(good & ~finite)}
    flagged = s.flags & (sm.Flag.BRANCH_UNVERIFIED) != 0
    verdict = verified(q, s, np.flatnonzero(good & finite))
    wrong |= {i: f"{word}{' (flagged)' if flagged[i] else ''}" for i, word in verdict.bad.items()}
    out = {"solves": len(q.at), "status": Counter(sm.Status(int(v)).name for v in s.status)}
    out |= {"refused": refused, "undecided": verdict.undecided, "flagged": int((good & flagged).sum())}
    return {**vars(batch), **out, "worst": verdict.worst, "wrong": wrong}


def commanded(machine: sm.Machine, p: np.ndarray, names: tuple[str, ...]) -> dict[str, np.ndarray]:
    """Coordinates (n,) by name that the controller commands."""
    unchanged, _ = changed(machine.description.name, "as declared")
    assert unchanged is not None
    start = unchanged.solve(p, threads=1, stiffness=False)
    x = start.coordinates.copy()
    same = tuple(start.coordinate_names) == tuple(names)
    missing = ~np.isfinite(x).all(1) if same else np.ones(len(p), dtype=bool)
    if missing.any():
        found = sm.inverse_kinematics(machine, p[missing]).coordinates
        x = x if same else np.empty((len(p), len(names)))
        x[missing] = found
    return coordinates(names, x)


def machine_size(machine: sm.Machine) -> float:
    """Of the workspace and of the way to it, m."""
    low, high = machine.workspace
    return float(max(np.linalg.norm(high - low), np.abs([low, high]).max()))


def main() -> int:
    """Runs the batches that are not in --out yet, then prints the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--count", type=float, default=1e5)
    parser.add_argument("--machine", action="append")
    parser.add_argument("--random", action="store_true", help="random machines only")
    parser.add_argument("--out", type=Path, default=Path("build/many.jsonl"))
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--batch", type=int, default=BATCH, help="solves of one machine and effect at a time")
    given = parser.parse_args()
    given.out.parent.mkdir(parents=True, exist_ok=True)
    done = [json.loads(line) for line in given.out.read_text().splitlines()] if given.out.exists() else []
    seen = {(r["machine"], r["effect"], r["seed"]) for r in done}
    machines = [] if given.random else given.machine or sm.machine_names()
    kinds = () if given.machine else KINDS
    todo = [b for b in batches(machines, int(given.count), given.batch, kinds)
            if (b.machine, b.effect, b.seed) not in seen]  # fmt: skip
    with ProcessPoolExecutor(given.jobs) as pool, given.out.open("a") as out:
        for work in as_completed([pool.submit(timed, b, size_of(b.effect, given.batch)) for b in todo]):
            result = json.loads(json.dumps(work.result()))
            out.write(json.dumps(result) + "\n")
            out.flush()
            done.append(result)
    return report(done)


def report(done: list[dict[str, object]]) -> int:
    """Prints a row per machine, and the wrong answers."""
    bad = [(r["machine"], r["effect"], r["seed"], i, w) for r in done for i, w in r.get("wrong", {}).items()]  # type: ignore[attr-defined]
    for machine in dict.fromkeys(str(r["machine"]) for r in done):
        rows = [r for r in done if r["machine"] == machine and r["solves"]]
        status = sum((Counter(r["status"]) for r in rows), Counter[str]())  # type: ignore[arg-type]
        worst = {
            w: max((r["worst"].get(w, 0.0) for r in rows), default=0.0)
            for w in ("command", "closure", "force", "motion")
        }  # type: ignore[attr-defined]
        told = ", ".join(f"{w} {v:.1e}" for w, v in worst.items())
        flagged = sum(int(str(r["flagged"])) for r in rows)
        undecided = sum(int(str(r["undecided"])) for r in rows)
        print(
            f"{machine}: {sum(status.values())} solves; {dict(status)}; {flagged} flagged; "
            f"{undecided} undecided; worst {told}"
        )
    refused = {f"{r['machine']} {r['effect']}: {why}": None for r in done for why in r["refused"]}  # type: ignore[attr-defined]
    for text in refused:
        print("refused:", text)
    for row in bad[:40]:
        print("WRONG", *row)
    solves, cpu = (sum(float(str(r[n])) for r in done) for n in ("solves", "cpu"))
    print(f"{solves:.0f} solves, {len(bad)} wrong, {1e3 * cpu / max(1.0, solves):.3f} ms of CPU each")
    return int(bool(bad))


if __name__ == "__main__":
    sys.exit(main())
