# SPDX-License-Identifier: MIT
"""The measured gearbox as a machine of one joint: files for `stiffmap diagnose`, and all tests diagnosed.

    python examples/measured_actuator_files.py [DATA] [-o OUT] [--variant split_PCCF] [--diagnose]
    stiffmap diagnose OUT/gear.yaml OUT/2024-07-11T15-47-12

DATA as in measured_actuator.py; OUT (default: gear) gets gear.yaml and a folder for each test: a set-up for each of its
ramps, rows in the order of time, the torque estimated from the current as load and the commanded one beside it. `--diagnose`
runs each test and prints a line of it; with OUT it goes on where it was stopped (results.csv). docs/measured_actuator.md tells the result.
"""

from __future__ import annotations

import argparse
import csv
import math
import time
from collections import Counter, defaultdict
from pathlib import Path

import stiffmap as sm
from stiffmap.model.description.tree import joints

DATA = Path(__file__).resolve().parents[1] / "measured" / "cycloidal_actuator_play"
MACHINE = """name: gear
title: a gearbox whose output is clamped
units: {length: mm, force: N, angle: deg}
home: {translation: [0, 0, 0]}
legs:
  box:
    elements:
      - {actuator: gear, kind: revolute, axis: z, home: 0, compliance: {value: 1.0e-6, u: 5.0e-7}}
"""
EXPERIMENT = """machine: ../gear.yaml
quantity: position
units: {length: mm, force: N, mz: N*m, angle: deg}
noise: {rz: 0.0055}
frame: offset_unknown
command:
  q: {actuator: box.gear, unit: deg}
"""


def write(data: Path, out: Path, wanted: str) -> dict[str, tuple[str, str]]:
    """Machine and experiments; variant and state of each test."""
    with (data / "tests.csv").open(newline="", encoding="utf-8") as stream:
        tests = {r["test_id"]: (r["variant"], r["state"]) for r in csv.DictReader(stream)}
    tests = {t: v for t, v in tests.items() if v[0].startswith(wanted)}
    rows: dict[str, list[list[str]]] = defaultdict(list)
    with (data / "torque_ramps.csv").open(newline="", encoding="utf-8") as stream:
        for r in csv.DictReader(stream):
            if r["test_id"] in tests and int(r["ramp"]) >= 100:
                cells = (r[c] for c in ("ramp", "time_s", "torque_est_Nm", "torque_cmd_Nm", "position_deg"))
                rows[r["test_id"]].append(list(cells))
    out.mkdir(parents=True, exist_ok=True)
    (out / "gear.yaml").write_text(MACHINE, encoding="utf-8")
    for test, values in rows.items():
        (out / test).mkdir(exist_ok=True)
        (out / test / "experiment.yaml").write_text(EXPERIMENT, encoding="utf-8")
        values.sort(key=lambda v: (int(v[0]), float(v[1])))
        with (out / test / "data.csv").open("w", newline="", encoding="utf-8") as stream:
            table = csv.writer(stream)
            table.writerow(["setup", "order", "mz", "mz_cmd", "rz", "q"])
            table.writerows([*v, "0"] for v in values)
    return {t: tests[t] for t in rows}


def diagnosed(out: Path, test: str, variant: str, state: str) -> dict[str, str]:
    """A line of the results."""
    begun = time.process_time()
    d = sm.diagnose(out / "gear.yaml", out / test, seed=0)
    law = next((e for e in d.effects if e.kind == "hysteresis"), None)
    number = {k: v[0] for k, v in law.parameters.items()} if law else {}
    spring = joints(d.machine.description)["box.gear"].law
    per_load = 1.0 / spring.stiffness if spring else 0.0
    play, memory = (number.get(k, 0.0) for k in ("half_width", "level"))
    told = next((t for t in d.limitations if "saturates" in t), "")
    values = {
        "test": test,
        "variant": variant,
        "state": state,
        "verdict": d.verdict,
        "effects": " + ".join(e.kind for e in d.effects),
        "compliance_mrad_per_Nm": 1e3 * per_load,
        "level_Nm": memory,
        "play_mrad": 2e3 * play,
        "memory_mrad": 2e3 * memory * per_load,
        "stiffening": number.get("ratio", 1.0),
        "before_deg": math.degrees(d.before.size[0]),
        "after_deg": math.degrees(d.after.size[0]),
        "saturates": told.partition(":")[0],
        "seconds": time.process_time() - begun,
    }
    return {k: f"{v:.4g}" if isinstance(v, float) else v for k, v in values.items()}


def _larger(r: dict[str, str]) -> str:
    """Which of the two makes the loop wider: play, or friction's memory over the spring."""
    play, memory = float(r["play_mrad"]), float(r["memory_mrad"])
    return "none" if not play + memory else "play" if play > memory else "memory"


def table(results: list[dict[str, str]]) -> str:
    """A line per variant and state: means of its tests."""
    groups: dict[str, list[dict[str, str]]] = defaultdict(list)
    for r in results:
        groups[f"{r['variant']} {r['state']}"].append(r)
    names = ("level_Nm", "play_mrad", "memory_mrad", "stiffening", "before_deg", "after_deg")
    out = [f"{'':38}tests  " + "  ".join(f"{n:>11}" for n in names) + "  larger  saturates"]
    for name, rs in sorted(groups.items()):
        mean = [sum(float(r[n]) for r in rs) / len(rs) for n in names]
        larger = Counter(_larger(r) for r in rs)
        stops = Counter(r["saturates"] for r in rs if r["saturates"])
        most = larger.most_common(1)[0]
        out.append(
            f"{name:38}{len(rs):5}  "
            + "  ".join(f"{v:11.3g}" for v in mean)
            + f"  {most[0]} {most[1]}"
            + (f"  {stops.most_common(1)[0][0]}" if stops else "")
        )
    kinds = Counter(f"{r['verdict']}: {r['effects'] or 'none'}" for r in results)
    return "\n".join([*out, *(f"{n} of {len(results)}: {k}" for k, n in kinds.most_common())])


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("data", nargs="?", type=Path, default=DATA)
    parser.add_argument("-o", "--output", type=Path, default=Path("gear"))
    parser.add_argument("--variant", default="", help="only tests whose variant begins so")
    parser.add_argument("--diagnose", action="store_true")
    a = parser.parse_args()
    if not (a.data / "torque_ramps.csv").is_file():
        print(f"skipped: no measured data in {a.data} (torque_ramps.csv, see docs/measured_actuator.md)")
        return 0
    tests = write(a.data, a.output, a.variant)
    print(f"{len(tests)} tests in {a.output}; machine {a.output / 'gear.yaml'}")
    if not a.diagnose:
        return 0
    file, results = a.output / "results.csv", []
    if file.is_file():
        with file.open(newline="", encoding="utf-8") as stream:
            results = list(csv.DictReader(stream))
    done, met = {r["test"] for r in results}, Counter[tuple[str, str]]()
    turn = {
        t: met.update([v]) or met[v] for t, v in tests.items()
    }  # one of each variant and state, then the next
    for test in sorted((t for t in tests if t not in done), key=lambda t: turn[t]):
        results.append(diagnosed(a.output, test, *tests[test]))
        with file.open("w", newline="", encoding="utf-8") as stream:
            out = csv.DictWriter(stream, list(results[0]))
            out.writeheader()
            out.writerows(results)
        print(", ".join(f"{k} {v}" for k, v in results[-1].items()), flush=True)
    print(table([r for r in results if r["test"] in tests]))
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
