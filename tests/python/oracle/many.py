"""Solve many random cases and verify every answer by free bodies (`statics`), or see that it is flagged.

    python -m tests.python.oracle.many --count 10000000 [--machine NAME ...] [--out many.jsonl] [--jobs 2] [--batch 2000]

Machines x effects x poses in, on and beyond the workspace x loads from nothing to buckling x load types x gravity. An
answer CONVERGED must balance to 1e-6 of the largest force in the machine, close to 1e-6 of its size, and have moved its
TCP by the displacement that it states; every other status must come without numbers. Batches are written to --out as
they end; the same command goes on where it was stopped. Of a hundredth of the batches the reference path solves 20 poses:
ask for an eighth more than is wanted. What round-off of the coordinates alone would do proves nothing (`statics.noise`) and is
counted as undecided. Exit code 1 where an answer is wrong.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass, fields, is_dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation
from tests.python.oracle.statics import Case, balance, closed, coordinates
from tests.python.oracle.with_effects import VALUES, with_effect

import stiffmap as sm
from stiffmap.description import Joint, Law

BATCH = 2000
RARE = {"dead_zone": 20, "position_offset": 20, "axis_tilt": 20}
"""Effects whose batches are smaller by this, since the reference path decides about each pose: with a gap in every drive and every
direction of a spring some bear nothing; rods that are off their axis spin under gravity."""
FORCE, CLOSURE, MOTION = 1e-6, 1e-6, 1e-6
EFFECTS = ("as declared", *VALUES)


@dataclass(frozen=True)
class Batch:
    """One call of `Machine.solve`."""

    machine: str
    effect: str
    seed: int


def batches(machines: list[str], count: int, size: int) -> Iterator[Batch]:
    """As many as make `count` solves, machines and effects in turn."""
    made = seed = 0
    while made < count:
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


def run(batch: Batch, count: int = BATCH) -> dict[str, object]:
    """Counts, worst numbers and the wrong answers of a batch."""
    machine, refused = changed(batch.machine, batch.effect)
    if machine is None:
        return {**vars(batch), "solves": 0, "refused": refused}
    key = [batch.seed, *batch.machine.encode(), *batch.effect.encode()]
    p, load = asked(machine, np.random.default_rng(key), count)
    if load["method"] == "reference":
        p = p[:20]
        load["wrench"] = load["wrench"][:20]  # type: ignore[index]
    s = machine.solve(p, threads=1, **load)  # type: ignore[arg-type]
    failed = np.isin(s.status, (int(sm.Status.UNREACHABLE), int(sm.Status.NOT_CONVERGED)))
    numbers = np.isfinite(s.displacement).any(1) | np.isfinite(s.stiffness).any((1, 2))
    good = s.status == sm.Status.CONVERGED
    wrong = {int(i): "a number with a failed status" for i in np.flatnonzero(failed & numbers)}
    wrong |= {
        int(i): "CONVERGED without numbers"
        for i in np.flatnonzero(good & ~np.isfinite(s.displacement).all(1))
    }
    out = {"solves": len(p), "status": Counter(sm.Status(int(v)).name for v in s.status)}
    flagged = s.flags & (sm.Flag.BRANCH_UNVERIFIED) != 0
    worst, bad, undecided = verified(
        machine, p, load, s, np.flatnonzero(good & np.isfinite(s.displacement).all(1))
    )
    wrong |= {i: f"{word}{' (flagged)' if flagged[i] else ''}" for i, word in bad.items()}
    out |= {"refused": refused, "undecided": undecided}
    return {**vars(batch), **out, "flagged": int((good & flagged).sum()), "worst": worst, "wrong": wrong}


def verified(
    machine: sm.Machine, p: np.ndarray, load: dict[str, object], s: sm.Solution, at: np.ndarray
) -> tuple[dict[str, float], dict[int, str], int]:
    """Largest relative errors, what is wrong by the pose, and how many poses the free bodies cannot decide."""
    worst: dict[str, float] = {}
    bad: dict[int, str] = {}
    undecided = 0
    joints = list(s.joint_index.values())
    patterns, which = np.unique(s.indeterminate_mask[at][:, joints], axis=0, return_inverse=True)
    for k in range(len(patterns)):  # what an answer leaves open differs from pose to pose
        found, wrong, unclear = verified_alike(machine, p, load, s, at[which.reshape(-1) == k])
        worst = {w: max(v, worst.get(w, 0.0)) for w, v in found.items()}
        bad |= wrong
        undecided += unclear
    return worst, bad, undecided


def verified_alike(
    machine: sm.Machine, p: np.ndarray, load: dict[str, object], s: sm.Solution, at: np.ndarray
) -> tuple[dict[str, float], dict[int, str], int]:
    """The same for poses (k,) > 0 of which the answer leaves the same joints open."""
    d, size = machine.description, machine_size(machine)
    names = s.coordinate_names
    before = commanded(machine, p[at], names)
    wrench = np.asarray(load["wrench"])[at]
    command = {n: before[n] for n in s.actuators}
    turned = np.broadcast_to(np.eye(3), (len(at), 3, 3))
    gravity = np.asarray(load["gravity"], dtype=float)
    case = Case(command, turned, wrench[:, :3], wrench[:, 3:], gravity, str(load["load_type"]), before)
    gap, tip = closed(d, before, case, size)
    smooth = without_friction(machine, p[at], {**load, "wrench": wrench}, names)
    case = Case(command, tip.r, wrench[:, :3], wrench[:, 3:], gravity, str(load["load_type"]), before, smooth)
    case = replace(
        case, left_open=tuple(n for n, i in s.joint_index.items() if s.indeterminate_mask[at, i].all())
    )
    found = balance(d, coordinates(names, s.coordinates[at]), case, size)
    stated = s.displacement[at]
    turn = Rotation.from_matrix(found.rotation @ np.swapaxes(tip.r, 1, 2)).as_rotvec()
    moved = np.abs(
        np.hstack([found.position - tip.p, size * turn]) - stated * [1, 1, 1, size, size, size]
    ).max(1)
    force = found.residual / np.maximum(found.scale, 1.0)
    errors = {
        "command": np.maximum(gap, task_error(d, tip, p[at])) / size,
        "closure": found.gap / size,
        "force": force,
        "motion": moved / size,
    }
    undecided = (found.undecided | (found.residual < found.noise)) & ~(force < FORCE)
    errors["force"] = np.where(undecided, 0.0, force)
    limits = {"command": CLOSURE, "closure": CLOSURE, "force": FORCE, "motion": MOTION}
    bad = {}
    for word, error in errors.items():
        for i in np.flatnonzero(~(error < limits[word])):
            bad[int(at[i])] = f"{word} off by {error[i]:.1e}"
    return {w: float(e.max()) for w, e in errors.items()}, bad, int(undecided.sum())


def commanded(machine: sm.Machine, p: np.ndarray, names: Sequence[str]) -> dict[str, np.ndarray]:
    """Coordinates (n,) by name that the controller commands. The free bodies see whether they close."""
    unchanged, _ = changed(machine.description.name, "as declared")
    assert unchanged is not None
    start = unchanged.solve(p, threads=1)
    x = start.coordinates.copy()
    same = tuple(start.coordinate_names) == tuple(names)
    missing = ~np.isfinite(x).all(1) if same else np.ones(len(p), dtype=bool)
    if missing.any():
        found = sm.inverse_kinematics(machine, p[missing]).coordinates
        x = x if same else np.empty((len(p), len(names)))
        x[missing] = found
    return coordinates(names, x)


def without_friction(
    machine: sm.Machine, p: np.ndarray, load: dict[str, Any], names: Sequence[str]
) -> dict[str, np.ndarray]:
    """Way (n,) of each coordinate in linear statics without friction, NaN where it is second order; empty where
    nothing rubs."""
    smooth = sm.Machine(smoothed(machine.description))
    if smooth == machine:
        return {}

    def reached(share: float) -> np.ndarray:
        wrench, gravity = share * load["wrench"], share * np.asarray(load["gravity"])
        at = {**load, "wrench": wrench, "gravity": list(gravity)}
        return smooth.solve(p, threads=1, **at).coordinates

    start, step = reached(0.0), 1e-4
    linear, whole = (reached(step) - start) / step, reached(1.0) - start
    bent = np.where(np.sign(linear) == np.sign(whole), 0.01, 1.0) * np.abs(whole - linear)
    doubtful = ~(np.abs(linear) > np.maximum(3e-11, bent))
    return coordinates(names, np.where(doubtful, np.nan, linear))


def smoothed(item: Any) -> Any:
    """A description whose laws have no friction."""
    if isinstance(item, Law):
        return replace(item, friction=0.0)
    if isinstance(item, Joint):
        item = replace(item, friction=None)
    if isinstance(item, tuple):
        return tuple(smoothed(v) for v in item)
    if is_dataclass(item):
        return replace(item, **{f.name: smoothed(getattr(item, f.name)) for f in fields(item) if f.init})
    return item


def task_error(d: object, tip: object, p: np.ndarray) -> np.ndarray:
    """Distance (n,) m of the closed TCP from the command, in the components that are commanded."""
    use = [c in d.task for c in "xyz"]  # type: ignore[attr-defined]
    return np.abs(tip.p - p)[:, use].max(1, initial=0.0)  # type: ignore[attr-defined, no-any-return]


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
    parser.add_argument("--out", type=Path, default=Path("build/many.jsonl"))
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--batch", type=int, default=BATCH, help="solves of one machine and effect at a time")
    given = parser.parse_args()
    given.out.parent.mkdir(parents=True, exist_ok=True)
    done = [json.loads(line) for line in given.out.read_text().splitlines()] if given.out.exists() else []
    seen = {(r["machine"], r["effect"], r["seed"]) for r in done}
    todo = [b for b in batches(given.machine or sm.machine_names(), int(given.count), given.batch)
            if (b.machine, b.effect, b.seed) not in seen]  # fmt: skip
    with ProcessPoolExecutor(given.jobs) as pool, given.out.open("a") as out:
        for work in as_completed([pool.submit(run, b, size_of(b.effect, given.batch)) for b in todo]):
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
    print(f"{sum(int(str(r['solves'])) for r in done)} solves, {len(bad)} wrong")
    return int(bool(bad))


if __name__ == "__main__":
    sys.exit(main())
