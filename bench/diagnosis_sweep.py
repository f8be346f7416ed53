"""How often a diagnosis names the truth: virtual experiments over effects, sizes and seeds, and null sets.

    python bench/diagnosis_sweep.py --null 160 --seeds 1 --out bench/diagnosis_sweep.jsonl

`--pairs 20` adds sets with two effects at once, each of the size 12; `--outliers 0.02` makes two of a hundred rows of every set wild.
Resumable: cases that are in the file are not run again. `--table` prints the table of what is there.
Size: rms of the effect's whitened signature that no single rival class can imitate, in noise floors.
"""

from __future__ import annotations

import argparse
import json
import time
from collections import Counter, defaultdict
from collections.abc import Iterator
from itertools import islice
from pathlib import Path
from typing import Any
from zlib import crc32

import numpy as np

import stiffmap as sm
from stiffmap.experiment import Experiment, Predictor, random_plan, simulate
from stiffmap.experiment.noise.whitening import Problem
from stiffmap.identification.calibration import Tolerances
from stiffmap.identification.diagnosis.candidates.candidates import Candidate
from stiffmap.identification.diagnosis.decision.beside_calibration import find_effects
from stiffmap.identification.diagnosis.report.describe import named_effects
from stiffmap.identification.diagnosis.rivals.explain import Explanation, explain
from stiffmap.identification.diagnosis.search.alias import same_way
from stiffmap.identification.diagnosis.search.screen import Screen
from stiffmap.identification.diagnosis.search.selection import Search
from stiffmap.identification.diagnosis.search.study import Study, study

SIZES = (6.0, 12.0, 3.0, 20.0, 2.0, 1.0)
PAIR = 12.0
CHUNK = 25
"""Null sets between two rounds of effects: whatever is there when a run stops is a mixture."""


def main() -> None:
    """Run what is missing, then print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--machine", default="orthoglide-revised")
    parser.add_argument("--null", type=int, default=160, help="null sets per quantity")
    parser.add_argument("--seeds", type=int, default=1, help="seeds per effect and size")
    parser.add_argument("--every", type=int, default=1, help="every so manyth effect of each size only")
    parser.add_argument("--pairs", type=int, default=0, help="sets with two effects at once")
    parser.add_argument("--outliers", type=float, default=0.0, help="share of rows that are wild")
    parser.add_argument("--minutes", type=float, default=np.inf, help="no new set begins after")
    parser.add_argument("--size", type=float, action="append", help="default: all sizes")
    parser.add_argument("--quantity", action="append", choices=("position", "deflection"))
    parser.add_argument("--out", type=Path, default=Path("bench/diagnosis_sweep.jsonl"))
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--commit", default="", help="noted in every record")
    parser.add_argument("--table", action="store_true")
    options = parser.parse_args()
    if not options.table:
        for quantity in options.quantity or ("position", "deflection"):
            run(options, quantity)
    print(table(load(options.out)))


def run(options: argparse.Namespace, quantity: str) -> None:
    """All cases of one plan."""
    machine = sm.load_machine(options.machine)
    number = 60 if quantity == "position" else 15
    plan = random_plan(machine, quantity, poses=number, loads=6, seed=1)
    s = study(Predictor(machine, plan, threads=options.threads), 0)
    done = {r["case"] for r in load(options.out)}
    until = time.monotonic() + 60.0 * options.minutes
    with options.out.open("a", encoding="utf-8") as stream:
        for case, effect, size in cases(s, plan, options):
            if time.monotonic() > until:
                break
            if case not in done:
                begun = time.perf_counter()
                result = one(machine, plan, effect, crc32(case.encode()), options.threads, options.outliers)
                record = {
                    "case": case,
                    "quantity": quantity,
                    "size": size,
                    "commit": options.commit,
                    "seconds": round(time.perf_counter() - begun, 2),
                    **result,
                }
                stream.write(json.dumps(record) + "\n")
                stream.flush()


def cases(s: Study, plan: Experiment, options: argparse.Namespace) -> Iterator[tuple[str, Any, float]]:
    """Null sets and effects in turn, so that a run that stops early is a fair sample."""
    if options.outliers:
        for case, effect, size in _cases(s, plan, options):
            yield f"{case} outliers {options.outliers:g}", effect, size
    else:
        yield from _cases(s, plan, options)


def _cases(s: Study, plan: Experiment, options: argparse.Namespace) -> Iterator[tuple[str, Any, float]]:
    yield from pair_cases(s, plan, options)
    nulls = iter(range(options.null))
    for k, case in enumerate(effect_cases(s, plan, options)):
        if k % CHUNK == 0:
            yield from (null_case(plan, k) for k in islice(nulls, CHUNK))
        yield case
    yield from (null_case(plan, k) for k in nulls)


def pair_cases(s: Study, plan: Experiment, options: argparse.Namespace) -> Iterator[tuple[str, Any, float]]:
    """Two effects of different classes, drawn at random, each of the size `PAIR`."""
    single = argparse.Namespace(**{**vars(options), "size": [PAIR], "every": 1, "seeds": 1})
    known = [effect for _, effect, _ in effect_cases(s, plan, single)] if options.pairs else []
    rng = np.random.default_rng(11)
    for k in range(options.pairs):
        a, b = (known[i] for i in rng.choice(len(known), 2, replace=False))
        yield f"{plan.quantity} pair {k}: {a[0]} and {b[0]}", (a, b), PAIR


def null_case(plan: Experiment, number: int) -> tuple[str, Any, float]:
    """A set without any effect."""
    return f"{plan.quantity} null {number}", None, 0.0


def effect_cases(s: Study, plan: Experiment, options: argparse.Namespace) -> Iterator[tuple[str, Any, float]]:
    """Each class's representative at each size."""
    screen = Screen.of(Problem.of(plan, s.noise.sigma, s.plan.base), s.plan.stack)
    named = [i for i, v in enumerate(s.plan.variants) if v.candidate in {c.representative for c in s.classes}]
    for turn, size in enumerate(options.size or SIZES):
        for i in named[turn % options.every :: options.every]:
            variant = screen.variants[i]
            if not variant.shape:
                for seed in range(options.seeds):
                    values = sized(screen, i, named, size, seed)
                    if values is not None:
                        term = variant.candidate.term(values)
                        name = f"{plan.quantity} {variant.candidate} {size} {seed}"
                        yield name, (variant.candidate, term), size


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
            if k != i and same_way(screen, i, k)
            for q in [screen.basis(k)]
            if len(c.parameters) >= q.shape[1]
        ),
        default=float(np.linalg.norm(w)),
    )
    if rest < 1e-9:
        return None
    tried = [direction, -direction] if not sign.any() else [direction]
    return next(
        (v for d in tried if (v := _within(c, d * size * np.sqrt(screen.readings) / rest)) is not None), None
    )


def _within(c: Candidate, values: Any) -> Any:
    """SI values of so many scales from the null, if the effect allows them."""
    si = np.array([float(p.null or 0.0) + v * p.scale for p, v in zip(c.parameters, values, strict=True)])
    inside = all(p.lower <= v <= p.upper for p, v in zip(c.parameters, si, strict=True))
    return si if inside and np.abs(values).max() <= 200 else None


def one(
    machine: sm.Machine, plan: Experiment, effect: Any, seed: int, threads: int, outliers: float = 0.0
) -> dict[str, Any]:
    """What a diagnosis (without its cross-validation) says of one virtual experiment."""
    truth = [] if effect is None else list(effect) if isinstance(effect[0], tuple) else [effect]
    if len(truth) == 1:
        effect = truth[0]
    try:
        twin = simulate(machine, plan, [t for _, t in truth], seed=seed, outliers=outliers)
    except sm.StiffmapError as problem:
        return {"outcome": "not simulated", "why": str(problem)}
    s = study(Predictor(machine, twin, threads=threads), 0)
    found = find_effects(s, 0, Tolerances())
    s, finding, verdict = found.study, found.finding, found.verdict
    layered = {"layer": found.calibration is not None}
    if len(truth) > 1:
        why = explain(s, finding.search, finding.model)
        named = [aliases(s, c, why) for c in why.model.candidates]
        hits = sum(any(c in n for n in named) for c, _ in truth)
        words = ("neither", "one of two", "both")[hits] + (
            " named and another" if len(named) > hits else " named"
        )
        names = [str(c) for c in why.model.candidates]
        return {"verdict": verdict, "names": names, "outcome": f"pair: {words}", **layered}
    if not finding.model.candidates:
        return {"verdict": verdict, "outcome": outcome(effect, [], [], verdict), **layered}
    why = explain(s, finding.search, finding.model)
    named = [aliases(s, c, why) for c in why.model.candidates]
    instead = [c for m in why.others for c in m.candidates]
    return {
        "verdict": "ambiguous" if why.others and verdict == "effects" else verdict,
        "names": [str(c) for c in why.model.candidates],
        "instead": [str(c) for c in instead],
        "outcome": outcome(effect, named, instead, verdict),
        **layered,
        "inside": inside(s, finding.search, why, effect),
    }


def inside(s: Study, search: Search, why: Explanation, effect: Any) -> list[bool]:
    """Per parameter of a truth that is named itself: whether the 95 % interval holds it."""
    if effect is None:
        return []
    found = [e for e in named_effects(s, search, why.model) if e.place == effect[0].place]
    truth = dict(effect[1].parameters)
    return [
        low <= truth[n] <= high for e in found for n, (_, low, high, _) in e.parameters.items() if n in truth
    ]


def aliases(s: Study, c: Candidate, why: Explanation) -> set[Candidate]:
    """The candidate and what the plan cannot tell from it, at all or at this size."""
    near = {a for own, a, _ in why.aliases if own == c}
    wide = [k for k in s.classes if k.representative in {c, *near}]
    return {c, *near}.union(*({*k.members, *k.generalisations} for k in wide))


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
        if r["outcome"] != "not simulated":
            pair = r["outcome"].startswith("pair")
            counts[(f"{r['quantity']}{', pairs' if pair else ''}", r["size"])][r["outcome"]] += 1
    lines = ["| plan | size | sets | " + " | ".join(heads) + " |", "|" + "---|" * (3 + len(heads))]
    for (quantity, size), c in sorted(counts.items()):
        label = "null" if size == 0 else f"{size:g}"
        if any(o.startswith("pair") for o in c):
            continue
        lines.append(f"| {quantity} | {label} | {c.total()} | " + " | ".join(str(c[h]) for h in heads) + " |")
    for (quantity, size), c in sorted(counts.items()):
        if any(o.startswith("pair") for o in c):
            told = ", ".join(f"{n} {o.removeprefix('pair: ')}" for o, n in c.most_common())
            lines.append(f"\n{quantity}, size {size:g} each, {c.total()} sets: {told}.")
    held = [v for r in records for v in r.get("inside", [])]
    lines.append(f"\nTrue values inside their 95 % intervals: {sum(held)} of {len(held)}.")
    return "\n".join(lines)


if __name__ == "__main__":
    main()
