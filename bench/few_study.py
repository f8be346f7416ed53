"""Whether a true few effects are ever taken for "not a few": the shortcut before the search, on twins.

    python bench/few_study.py --machine orthoglide-revised --every 3 --minutes 4 --out bench/few_study.jsonl

Every effect that the plan sees (shapes as well), alone or two at a time (`--pairs`), so large that its rms is 20, 60 and
200 noise floors where its bounds allow. Per twin: whether the search would be skipped, and the chi-square per reading that the best few
leave, taken as linear and fitted. Resumable.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from zlib import crc32

import numpy as np

import stiffmap as sm
from stiffmap.experiment import Predictor, random_plan, simulate
from stiffmap.experiment.noise.whitening import readings_of
from stiffmap.identification.calibration import Tolerances
from stiffmap.identification.diagnosis.candidates.candidates import clash
from stiffmap.identification.diagnosis.candidates.sensitivity import Variant
from stiffmap.identification.diagnosis.decision.beside_calibration import calibrator, spread_evidence
from stiffmap.identification.diagnosis.decision.few import fitted, not_few, screened
from stiffmap.identification.diagnosis.search.selection import start_values
from stiffmap.identification.diagnosis.search.study import Study, study
from stiffmap.model.description import AppliedEffect

SIZES = (20.0, 60.0, 200.0)
MOST = 1000.0
"""Scales of an effect's parameters at most."""


def main() -> None:
    """Run what is missing, then print what was found."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--machine", default="orthoglide-revised")
    parser.add_argument("--poses", type=int, default=40)
    parser.add_argument("--every", type=int, default=1, help="every so manyth effect only")
    parser.add_argument("--pairs", action="store_true", help="two effects at once")
    parser.add_argument("--minutes", type=float, default=np.inf, help="no new twin begins after")
    parser.add_argument("--out", type=Path, default=Path("bench/few_study.jsonl"))
    o = parser.parse_args()
    records = [json.loads(line) for line in o.out.read_text().splitlines()] if o.out.exists() else []
    done = {r["case"] for r in records}
    until = time.monotonic() + 60.0 * o.minutes
    machine = sm.load_machine(o.machine)
    plan = random_plan(machine, "position", poses=o.poses, loads=6, repeats=2, seed=1)
    s = study(Predictor(machine, plan), 0)
    with o.out.open("a", encoding="utf-8") as stream:
        for case, terms in cases(s, o):
            if time.monotonic() > until:
                break
            if case in done:
                continue
            try:
                twin = simulate(machine, plan, terms, seed=crc32(case.encode()))
                record = {"case": case, **one(machine, twin)}
            except sm.StiffmapError as problem:
                record = {"case": case, "failed": str(problem)}
            records.append(record)
            stream.write(json.dumps(record) + "\n")
            stream.flush()
    report([r for r in records if "skipped" in r])


def one(machine: sm.Machine, twin: Any) -> dict[str, Any]:
    """What the shortcut does with one twin."""
    s = study(Predictor(machine, twin), 0)
    found = calibrator(s, Tolerances(), ())
    assert found is not None
    few = screened(s)
    spread = spread_evidence(s.whole[0], found)
    freedom = max(s.whole[0].freedom - few.directions[-1], 1)
    full = fitted(s, few)
    return {
        "skipped": not_few(s, few, spread),
        "linear": few.chi2[-1] / freedom,
        "fitted": None if full is None else full / freedom,
        "lead": spread - few.evidence(s.effective_trials),
    }


def cases(s: Study, o: argparse.Namespace) -> Iterator[tuple[str, list[AppliedEffect]]]:
    """Effects in random directions, each of one size in turn."""
    variants = s.whole[1].variants
    for turn, i in [(t, i) for t in range(len(SIZES)) for i in range(0, len(variants), o.every)]:
        size = SIZES[(i // o.every + turn) % len(SIZES)]
        picked = [variants[k] for k in ([i, (i * 7 + 3) % len(variants)] if o.pairs else [i])]
        first, last = picked[0].candidate, picked[-1].candidate
        if o.pairs and (first == last or clash(last, [first])):
            continue
        drawn = [sized(s, v, size) for v in picked]
        terms = [t for t in drawn if t is not None]
        if len(terms) == len(picked):
            names = " + ".join(f"{v.candidate} {dict(v.shape)}" for v in picked)
            yield f"{o.machine} {size:g} {names}", terms


def sized(s: Study, v: Variant, size: float) -> AppliedEffect | None:
    """The effect with values whose signature has this rms in noise floors, as far as its bounds go."""
    rng = np.random.default_rng(crc32(f"{v.candidate} {size}".encode()))
    lines = v.array()
    n = len(lines)
    way = rng.standard_normal(n)
    way = np.where(v.sign == 0, way, np.abs(way) * np.sign(v.sign))
    signal = way @ (lines / s.noise.sigma[readings_of(s.experiment, s.plan.base)])
    rms = float(np.sqrt(np.mean(signal**2)))
    if not rms > 0:
        return None
    way = way * min(size / rms, MOST / float(np.abs(way).max()))
    parameters = v.candidate.parameters
    scale, low, high = (np.array([getattr(p, k) for p in parameters]) for k in ("scale", "lower", "upper"))
    inside = 1e-9 * (high - low)
    values = start_values(v, way, np.zeros(n, bool))[0] * scale
    return v.candidate.term(np.clip(values, low + inside, high - inside).tolist())


def report(records: list[dict[str, Any]]) -> None:
    """Skipped wrongly, and the worst of what the best few leave."""
    skipped = [r for r in records if r["skipped"]]
    print(f"{len(records)} twins, {len(skipped)} taken for not a few")
    for r in skipped:
        print("  ", r)
    for name in ("linear", "fitted"):
        values = sorted((r[name], r["case"]) for r in records if r[name] is not None)
        print(f"{name}: chi-square per reading left, largest:", [(round(v, 2), c) for v, c in values[-6:]])


if __name__ == "__main__":
    main()
