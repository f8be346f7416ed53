# SPDX-License-Identifier: MIT
"""Twins by an independent generator on all twelve machines: how often a diagnosis is right, silent, false.

    OPENBLAS_NUM_THREADS=1 python -m bench.twins --out build/twins.jsonl [--twins 60] [--nulls 100] [--minutes 30]
    python -m bench.twins --out build/twins.jsonl --table

Readings by the energy minimiser of the tests' oracle (tests/oracle/twins). Singles of 2 to 3 noise floors (rms), pairs, other noise than
declared, outliers, creep, 12 rows, machines that are off everywhere; and machines without a fault, under every noise. Resumable.
"""

from __future__ import annotations

import argparse
import json
import time
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
from tests.oracle.twins.generator import twin
from tests.oracle.twins.judge import judged, of_diagnosis
from tests.oracle.twins.noise import KINDS

import stiffmap as sm

CASES: tuple[tuple[str, dict[str, Any]], ...] = (
    ("single", {"kind": "gaussian", "faults": 1}),
    ("single", {"kind": "gaussian", "faults": 1, "spread": 0.3}),
    ("pair", {"kind": "gaussian", "faults": 2}),
    ("correlated", {"kind": "correlated", "faults": 1}),
    ("heavy", {"kind": "heavy", "faults": 1}),
    ("outliers", {"kind": "outliers", "faults": 1}),
    ("half", {"kind": "half", "faults": 1}),
    ("double", {"kind": "double", "faults": 1}),
    ("creep", {"kind": "creep", "faults": 1}),
    ("12 rows", {"kind": "gaussian", "faults": 1, "few": True}),
)


def case(number: int, null: bool) -> tuple[str, dict[str, Any]]:
    """What a twin is, by its number."""
    rng = np.random.default_rng([number, 5])
    if null:
        kind = list(KINDS)[number % len(KINDS)]
        spread = (0.0, 0.3, 1.0)[(number // len(KINDS)) % 3]
        return "null", {"kind": kind, "faults": 0, "spread": spread, "strength": 0.0}
    word, given = CASES[number % len(CASES)]
    return word, {"spread": 0.0, "strength": float(rng.uniform(2.0, 3.0)), **given}


def one(number: int, null: bool) -> dict[str, Any]:
    """A record."""
    word, given = case(number, null)
    position = (number // 12) % 2
    few = given.pop("few", False)
    poses = (12 if position else 4) if few else (30 if position else 10)
    start = time.perf_counter()
    t = twin(number + (1000 if null else 0), poses=poses, **given)
    made = time.perf_counter()
    try:
        j = judged(t, of_diagnosis(sm.diagnose(t.machine, t.experiment)))
        found, said, covered = j.word, j.said, list(j.covered)
    except sm.StiffmapError as problem:
        found, said, covered = "error", str(problem), []
    truth = [f"{f.kind} {f.at} {s:.4g}" for f, s in zip(t.faults, t.sizes, strict=True)]
    return {
        "twin": number, "null": null, "case": word, "name": t.name, "given": given, "truth": truth, "word": found,
        "said": said, "covered": [bool(c) for c in covered], "seconds": [made - start, time.perf_counter() - made],
    }  # fmt: skip


def table(records: list[dict[str, Any]]) -> str:
    """Words by case."""
    words = ("right", "same", "within", "unattributed", "silent", "quiet", "false", "error")
    out = ["| case | twins | " + " | ".join(words) + " |", "|---" * (len(words) + 2) + "|"]
    for name in [*dict.fromkeys(r["case"] for r in records), "all"]:
        mine = [r for r in records if name in (r["case"], "all")]
        count = Counter(r["word"] for r in mine)
        out.append(f"| {name} | {len(mine)} | " + " | ".join(str(count[w]) for w in words) + " |")
    covered = [c for r in records for c in r["covered"]]
    if covered:
        out.append(f"\n{sum(covered)} of {len(covered)} intervals of named faults hold the truth")
    return "\n".join(out)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("build/twins.jsonl"))
    parser.add_argument("--twins", type=int, default=60)
    parser.add_argument("--nulls", type=int, default=100)
    parser.add_argument("--first", type=int, default=0, help="number of the first twin; its seed")
    parser.add_argument("--minutes", type=float, default=np.inf)
    parser.add_argument("--table", action="store_true")
    o = parser.parse_args()
    known = [json.loads(x) for x in o.out.read_text().splitlines()] if o.out.exists() else []
    done = {(r["twin"], r["null"]) for r in known}
    sets = [(k, False) for k in range(o.first, o.first + o.twins)]
    sets += [(k, True) for k in range(o.first, o.first + o.nulls)]
    asked = sorted(sets)
    until = time.monotonic() + 60.0 * o.minutes
    with o.out.open("a", encoding="utf-8") as stream:
        for number, null in [] if o.table else [a for a in asked if a not in done]:
            if time.monotonic() > until:
                break
            known.append(one(number, null))
            stream.write(json.dumps(known[-1]) + "\n")
            stream.flush()
            print(
                known[-1]["name"], known[-1]["word"], known[-1]["truth"], known[-1]["said"][:200], flush=True
            )
    print(f"\n{table(known)}")
    return int(any(r["word"] in ("false", "error") for r in known))


if __name__ == "__main__":
    raise SystemExit(main())
