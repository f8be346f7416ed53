"""Twins whose every declared number is off within its uncertainty: no cause may be named, intervals must hold.

    python bench/null_study.py --twins 300 --out bench/null_study.jsonl

Three machines in turn (a translational machine, a delta with heights and frame unknown, an arm with frame and tool
unknown), positions and, every other time, deflections. Every unknown of the calibration is drawn
from a normal law of its standard uncertainty times `--scale` (0.3, 1 and 1 in turn by default: machines are often better
than they are declared). Resumable: twins that are in the file are not run again; `--table` prints what is there.

Named: effects in the verdict, or unknowns (or groups of them as a whole) `beyond tolerance`. Coverage: of the 95 % intervals of all unknowns that the
readings tell, and of the calibrated machine's prediction at poses that were not measured.
"""

from __future__ import annotations

import argparse
import json
import time
from collections import defaultdict
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

import stiffmap as sm
from stiffmap.common.tasks import workers
from stiffmap.experiment import Experiment, Predictor, random_plan
from stiffmap.experiment.noise.whitening import Problem, nuisance_part
from stiffmap.identification.calibration import Calibrator, Tolerances, Unknown, unknowns
from stiffmap.identification.calibration.conclude import conclude
from stiffmap.identification.calibration.model import predicted, sensitivity, sensitivity_at

MACHINES = ("orthoglide-revised", "linear-delta", "ur10")
SCALES = (1.0, 0.3, 1.0)
POSES = {"position": 40, "deflection": 10}
Z = 1.96


def main() -> None:
    """Run what is missing, then print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--twins", type=int, default=300)
    parser.add_argument("--scale", type=float, help="of all standard uncertainties")
    parser.add_argument("--machine", action="append", choices=MACHINES)
    parser.add_argument("--minutes", type=float, default=np.inf, help="no new twin begins after")
    parser.add_argument(
        "--diagnose", type=int, default=300, help="twins that are diagnosed; the others are calibrated only"
    )
    parser.add_argument("--out", type=Path, default=Path("bench/null_study.jsonl"))
    parser.add_argument("--table", action="store_true")
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    parser.add_argument("--scheduler", help="address of a dask scheduler whose workers make the twins")
    o = parser.parse_args()
    until = time.monotonic() + 60.0 * o.minutes
    done = {r["twin"] for r in load(o.out)}
    with o.out.open("a", encoding="utf-8") as stream:
        todo = [] if o.table else order(o.twins, o.machine or MACHINES)
        missing = (k for k in todo if k not in done and time.monotonic() < until)
        with workers(twin, (o.scale, o.diagnose), scheduler=o.scheduler, processes=o.jobs) as hands:
            for _, record in hands.as_done(missing):
                stream.write(json.dumps(record) + "\n")
                stream.flush()
    print(table(load(o.out)))


def twin(shared: tuple[float | None, int], k: int) -> dict[str, Any]:
    """One twin, as a task."""
    scale, diagnose = shared
    return one(k, scale, k < diagnose)


def load(path: Path) -> list[dict[str, Any]]:
    """Records of a file that may not exist yet."""
    return [json.loads(line) for line in path.read_text().splitlines()] if path.exists() else []


def order(number: int, machines: tuple[str, ...] | list[str]) -> list[int]:
    """Twins in chunks of one machine and quantity, whose sensitivities are computed once."""
    mine = [k for k in range(number) if MACHINES[k % 3] in machines]
    return sorted(mine, key=lambda k: (k // 60, k % 3, quantity_of(k)))


def quantity_of(k: int) -> str:
    """Two of three twins read positions."""
    return "deflection" if (k // 3) % 3 == 2 else "position"


def plan_of(name: str, quantity: str, seed: int) -> Experiment:
    """A plan as it is measured: frame unknown where positions are read, the tool as well on an arm."""
    machine = sm.load_machine(name)
    plan = random_plan(machine, quantity, poses=POSES[quantity], loads=6, repeats=2, seed=seed)
    if quantity == "position":
        plan = replace(plan, frame="unknown", tool="unknown" if name == "ur10" else "known")
    return plan


def one(k: int, scale: float | None, diagnose: bool = True) -> dict[str, Any]:
    """What a diagnosis and a calibration say of twin k."""
    begun = time.perf_counter()
    name, quantity = MACHINES[k % 3], quantity_of(k)
    machine = sm.load_machine(name)
    rng = np.random.default_rng(5000 + k)
    predictor = Predictor(machine, plan_of(name, quantity, 1))
    plan = predictor.experiment
    names = unknowns(machine.description, plan, Tolerances())
    factor = SCALES[(k // 9) % 3] if scale is None else scale
    record: dict[str, Any] = {"twin": k, "machine": name, "quantity": quantity, "scale": factor}
    truth = factor * rng.standard_normal(len(names))
    reading = predicted(predictor, names, truth)
    reading = reading + np.nan_to_num(plan.sigma) * rng.standard_normal(reading.shape)
    twin = replace(plan, reading=np.where(plan.read, reading, np.nan), joints=None, other_joints=None)
    if diagnose:
        d = sm.diagnose(machine, twin, cross_validate=False)
        record |= {
            "verdict": d.verdict,
            "named": [f"{e.kind} of {e.element} {e.legs}" for e in d.effects],
            "refused": d.refused,
            "unexplained": [str(p.what) for p in d.unexplained][:3],
            "layer": d.calibration is not None,
            "diagnosis_s": round(time.perf_counter() - begun, 2),
        }
    found = Calibrator.of(Predictor(machine, twin), names)
    c = conclude(found)
    record |= {
        "calibration": c.verdict,
        "beyond": [b.name for b in c.beyond] + [f"{w.group} as a whole" for w in c.wider],
        "floor": c.floor / c.noise,
        **covered(found, names, truth, machine, name, quantity),
        "seconds": round(time.perf_counter() - begun, 2),
    }
    return record


def covered(
    found: Calibrator, names: list[Unknown], truth: Any, machine: sm.Machine, name: str, quantity: str
) -> dict[str, Any]:
    """How many true values lie in their 95 % intervals: of numbers that are told, and of predictions elsewhere."""
    spread = np.sqrt(np.diag(found.sums.covariance))
    value = dict(zip(names, truth, strict=True))
    true = np.array([value[u] for u in found.sensitivity.unknowns])
    told = spread < 0.7
    inside = np.abs(found.fit.values - true) <= Z * spread
    elsewhere = Predictor(machine, plan_of(name, quantity, 2))
    known = found.sensitivity.unknowns
    s = sensitivity(elsewhere, names)
    mine = dict(zip(known, found.fit.values, strict=True))
    s = sensitivity_at(elsewhere, s, np.array([mine.get(u, 0.0) for u in s.unknowns]))
    at = {u: i for i, u in enumerate(s.unknowns)}
    columns = np.zeros((*s.base.shape, len(known)))
    for i, u in enumerate(known):
        if u in at:
            columns[..., i] = s.columns[..., at[u]]
    e = elsewhere.experiment
    problem = Problem.of(e, np.where(np.isfinite(e.sigma), e.sigma, 1.0), s.base)
    error = predicted(elsewhere, names, truth) - predicted(elsewhere, known, found.fit.values)
    error = error - nuisance_part(problem, error)
    columns = np.stack(
        [columns[..., i] - nuisance_part(problem, columns[..., i]) for i in range(len(known))], axis=-1
    )
    u = np.sqrt(np.einsum("ncp,pq,ncq->nc", columns, found.sums.covariance, columns))
    read = e.read & (u > 0) & np.isfinite(error)  # no pose that this twin cannot take
    return {
        "told": int(told.sum()),
        "told_inside": int((inside & told).sum()),
        "predictions": int(read.sum()),
        "predictions_inside": int((np.abs(error) <= Z * u)[read].sum()),
        "prediction_ratio": float(np.sqrt(np.mean((error[read] / u[read]) ** 2))),
    }


def table(records: list[dict[str, Any]]) -> str:
    """Markdown: one line per machine, quantity and scale."""
    groups: dict[tuple[str, str, float], list[dict[str, Any]]] = defaultdict(list)
    for r in records:
        groups[(r["machine"], r["quantity"], r["scale"])].append(r)
    groups[("all", "", 1.0)] = [r for r in records if r["scale"] == 1.0]
    groups[("all", "", 0.0)] = records
    out = [
        "| machine | readings | u times | twins | beyond tolerance | in 95 %: numbers | predictions "
        "| diagnosed | cause named | rest claimed | s |",
        "|" + "---|" * 11,
    ]
    for (machine, quantity, scale), rs in sorted(groups.items()):
        if not rs:
            continue
        diagnosed = [r for r in rs if "named" in r]
        named = sum(bool(r["named"]) for r in diagnosed)
        beyond = sum(bool(r["beyond"]) for r in rs)
        rest = sum("unattributed" in r["verdict"] for r in diagnosed)
        each = float(np.median([r["diagnosis_s"] for r in diagnosed])) if diagnosed else float("nan")
        held = [
            f"{100 * sum(r[f'{k}_inside'] for r in rs) / max(1, sum(r[k] for r in rs)):.1f} %"
            for k in ("told", "predictions")
        ]
        out.append(
            f"| {machine} | {quantity} | {scale or 'any'} | {len(rs)} | {beyond} | {held[0]} | {held[1]} "
            f"| {len(diagnosed)} | {named} | {rest} | {each:.1f} |"
        )
    return "\n".join(out)


if __name__ == "__main__":
    main()
