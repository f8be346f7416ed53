"""How often a diagnosis names the truth: virtual experiments over effects, sizes and seeds, and null sets.

    python bench/diagnosis_sweep.py --null 150 --seeds 1 --out bench/diagnosis_sweep.jsonl

Resumable: cases that are in the file are not run again. `--table` prints the table of what is there.
Size: rms of the effect's whitened signature that no single rival class can imitate, in noise floors.
"""

from __future__ import annotations

import argparse
import json
from collections import Counter, defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

import stiffmap as sm
from stiffmap.diagnosis.candidates import Candidate
from stiffmap.diagnosis.rivals import rivals
from stiffmap.diagnosis.screen import Screen
from stiffmap.diagnosis.study import Study, find, study
from stiffmap.diagnosis.verdict import judge, unexplained
from stiffmap.experiment import Experiment, Predictor, random_plan, simulate
from stiffmap.experiment.problem import Problem

SIZES = (1.0, 3.0, 10.0)


def main() -> None:
    """Run what is missing, then print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--machine", default="orthoglide-revised")
    parser.add_argument("--null", type=int, default=150, help="null sets per quantity")
    parser.add_argument("--seeds", type=int, default=1, help="seeds per effect and size")
    parser.add_argument("--quantity", action="append", choices=("position", "deflection"))
    parser.add_argument("--out", type=Path, default=Path("bench/diagnosis_sweep.jsonl"))
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--table", action="store_true")
    options = parser.parse_args()
    if not options.table:
        for quantity in options.quantity or ("position", "deflection"):
            run(options, quantity)
    print(table(load(options.out)))


def run(options: argparse.Namespace, quantity: str) -> None:
    """All cases of one plan."""
    machine = sm.load_machine(options.machine)
    number = 60 if quantity == "position" else 20
    plan = random_plan(machine, quantity, poses=number, loads=9, seed=1)
    s = study(Predictor(machine, plan, threads=options.threads), 0)
    done = {r["case"] for r in load(options.out)}
    with options.out.open("a", encoding="utf-8") as stream:
        for case, effect, size, seed in cases(s, plan, options):
            if case not in done:
                result = one(machine, plan, effect, seed, options.threads)
                record = {"case": case, "quantity": quantity, "size": size, **result}
                stream.write(json.dumps(record) + "\n")
                stream.flush()


def cases(s: Study, plan: Experiment, options: argparse.Namespace) -> Iterator[tuple[str, Any, float, int]]:
    """Null sets, then each class's representative at each size, largest sizes first."""
    for seed in range(options.null):
        yield f"{plan.quantity} null {seed}", None, 0.0, seed
    screen = Screen.of(Problem.of(plan, s.noise.sigma, s.plan.base), s.plan.variants)
    named = [i for i, v in enumerate(s.plan.variants) if v.candidate in {c.representative for c in s.classes}]
    for size in sorted(SIZES, reverse=True):
        for i in named:
            variant = screen.variants[i]
            if not variant.shape and len(variant.candidate.legs) != 2:
                for seed in range(options.seeds):
                    values = sized(screen, i, named, size, seed)
                    if values is not None:
                        term = variant.candidate.term(values)
                        yield (
                            f"{plan.quantity} {variant.candidate} {size} {seed}",
                            (variant.candidate, term),
                            size,
                            seed,
                        )


def sized(screen: Screen, i: int, others: list[int], size: float, seed: int) -> Any:
    """Values (SI) of variant i with this size; None where they would leave the bounds or 200 scales."""
    c = screen.variants[i].candidate
    rng = np.random.default_rng(1000 + seed)
    sign = screen.variants[i].sign
    direction = np.where(sign == 0, rng.standard_normal(len(sign)), np.abs(rng.standard_normal(len(sign))))
    w = screen.columns(i) @ direction
    rest = min(
        (
            np.linalg.norm(w - q @ (q.T @ w))
            for k in others
            if k != i
            for q in [screen.basis(k)]
            if len(c.parameters) >= q.shape[1]
        ),
        default=float(np.linalg.norm(w)),
    )
    if rest < 1e-9:
        return None
    values = direction * size * np.sqrt(screen.readings) / rest
    if np.abs(values).max() > 200:
        return None
    si = np.array([float(p.null or 0.0) + v * p.scale for p, v in zip(c.parameters, values, strict=True)])
    inside = all(p.lower <= v <= p.upper for p, v in zip(c.parameters, si, strict=True))
    return si if inside else None


def one(machine: sm.Machine, plan: Experiment, effect: Any, seed: int, threads: int) -> dict[str, Any]:
    """What a diagnosis (without its cross-validation) says of one virtual experiment."""
    terms = [] if effect is None else [effect[1]]
    try:
        twin = simulate(machine, plan, terms, seed=seed)
    except sm.StiffmapError as problem:
        return {"outcome": "not simulated", "why": str(problem)}
    s = study(Predictor(machine, twin, threads=threads), 0)
    finding = find(s)
    finding, verdict = judge(s, finding, unexplained(s, finding))
    model = finding.model
    other = rivals(finding.search, model, s.classes) if model.candidates and verdict == "effects" else []
    named = [aliases(s, c) for c in model.candidates]
    instead = [c for r in other for c in r.model.candidates]
    return {
        "verdict": "ambiguous" if other else verdict,
        "names": [str(c) for c in model.candidates],
        "instead": [str(c) for c in instead],
        "outcome": outcome(effect, named, instead, verdict),
    }


def aliases(s: Study, c: Candidate) -> set[Candidate]:
    """The candidate and what the plan cannot tell from it."""
    found = next((k for k in s.classes if k.representative == c), None)
    return {c} if found is None else {c, *found.members, *found.generalisations}


def outcome(effect: Any, named: list[set[Candidate]], instead: list[Candidate], verdict: str) -> str:
    """named alone, in the ambiguous set, missed, misnamed; clear or false alarm for null sets."""
    if effect is None:
        return "clear" if verdict == "none" else "false alarm"
    if verdict == "unattributed":
        return "left unattributed"
    if not named:
        return "missed"
    hit = any(effect[0] in n for n in named)
    if hit and len(named) == 1 and not instead:
        return "named alone"
    if hit or effect[0] in instead:
        return "in the set" if instead else "named with others"
    return "misnamed"


def load(path: Path) -> list[dict[str, Any]]:
    """Records of a file that may not exist yet."""
    return [json.loads(line) for line in path.read_text().splitlines()] if path.exists() else []


def table(records: list[dict[str, Any]]) -> str:
    """Markdown: one line per quantity and size."""
    heads = (
        "named alone",
        "in the set",
        "named with others",
        "left unattributed",
        "missed",
        "misnamed",
        "clear",
        "false alarm",
    )
    counts: dict[tuple[str, float], Counter[str]] = defaultdict(Counter)
    for r in records:
        counts[(r["quantity"], r["size"])][r["outcome"]] += 1
    lines = ["| plan | size | sets | " + " | ".join(heads) + " |", "|" + "---|" * (3 + len(heads))]
    for (quantity, size), c in sorted(counts.items()):
        label = "null" if size == 0 else f"{size:g}"
        lines.append(f"| {quantity} | {label} | {c.total()} | " + " | ".join(str(c[h]) for h in heads) + " |")
    return "\n".join(lines)


if __name__ == "__main__":
    main()
