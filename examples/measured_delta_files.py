# SPDX-License-Identifier: MIT
"""Machine file and experiment of the measured delta, as `stiffmap calibrate` and `diagnose` read them.

    python examples/measured_delta_files.py [DATA] [OUT] [EVERY]
    stiffmap calibrate OUT/flsun.yaml OUT/heights -o OUT/calibration

DATA is the folder with heights.csv, distances.csv and sessions.csv (not part of stiffmap; without it the script says so and ends);
 OUT (default: delta) gets flsun.yaml, heights/ and both/ (the same heights and 24 distances); EVERY (default 7) takes every so manyth height.
One machine stands for all sessions: what each firmware believed is in its commands only. docs/measured_delta.md tells the result.
"""

from __future__ import annotations

import csv
import math
import re
import sys
from pathlib import Path

import stiffmap

DATA = Path(__file__).resolve().parents[1] / "measured" / "flsun_v400_delta"
RADIUS, ROD, SPREAD, PLATE = 161.8, 344.0, 50.0, 30.0
"""mm: towers less the effector's radius, rods (means of the sessions); the last two are assumed."""
TOWERS = {"a": 210, "b": 330, "c": 90}
HEAD = """machine: ../flsun.yaml
quantity: position
units: {length: mm}
noise: {hh: 0.02, dd: 0.04}
surface: {normal: [0, 0, 1], shape: unknown}
command:
"""


def machine() -> str:
    """The shipped linear delta with this one's dimensions, its home 20 mm above the bed."""
    text = (Path(stiffmap.__file__).parent / "model/machines" / "linear-delta.yaml").read_text(
        encoding="utf-8"
    )
    home = math.sqrt(ROD**2 - RADIUS**2) + 20.0
    for old, new in (
        ("name: linear-delta", "name: flsun"),
        ("[0, 0, 300]", "[0, 0, 20]"),
        ("x: [-100, 100], y: [-100, 100], z: [200, 400]", "x: [-150, 150], y: [-150, 150], z: [10, 60]"),
        ("home: 700", f"home: {home!r}"),
        ("range: [420, 950]", "range: [-500, 1200]"),
        ("53.13010235415598", repr(math.degrees(math.acos(RADIUS / ROD)))),
        ("[500, 0, 0]", f"[{ROD}, 0, 0]"),
        ("length: 500", f"length: {ROD}"),
        ("[250, 0, 0]", f"[{ROD / 2}, 0, 0]"),
        ("-30, 0]", f"{-SPREAD}, 0]"),
        ("[0, 30, 0]", f"[0, {SPREAD}, 0]"),
        ("plate, translation: [50, 0, 0]", f"plate, translation: [{PLATE}, 0, 0]"),
    ):
        text = text.replace(old, new)
    for name, angle in TOWERS.items():
        at = [(RADIUS + PLATE) * f(math.radians(angle)) for f in (math.cos, math.sin)]
        place = f"{name}: {{template: leg, frame: {{translation: [{at[0]!r}, {at[1]!r}, 0]"
        text = re.sub(rf"{name}: \{{template: leg, frame: \{{translation: \[[^\]]*\]", place, text)
    return text


def tops(folder: Path) -> dict[str, dict[str, float]]:
    """Height of each carriage at its endstop, mm, by session."""
    with (folder / "sessions.csv").open(newline="", encoding="utf-8") as stream:
        return {
            s["session"]: {
                t: math.sqrt(float(s[f"arm_{t}_mm"]) ** 2 - float(s["delta_radius_mm"]) ** 2)
                + float(s[f"endstop_{t}_mm"])
                for t in TOWERS
            }
            for s in csv.DictReader(stream)
        }


def distances(folder: Path) -> list[list[str]]:
    """Session, heights of the carriages at both ends and the distance that a caliper read, mm."""
    top = tops(folder)
    with (folder / "distances.csv").open(newline="", encoding="utf-8") as stream:
        data = list(csv.DictReader(stream))
    out = []
    for k, r in enumerate(data):
        ends = [
            f"{top[r['session']][t] - float(r[f'p{p}_travel_{t}_mm']):.6f}" for p in (1, 2) for t in TOWERS
        ]
        out.append([f"d{k}", r["session"], *ends[:3], "", *ends[3:], r["distance_measured_mm"]])
    return out


def rows(folder: Path, every: int) -> list[list[str]]:
    """Session and heights of the carriages, mm, where the probe touched."""
    sessions = tops(folder)
    with (folder / "heights.csv").open(newline="", encoding="utf-8") as stream:
        heights = [r for r in csv.DictReader(stream) if r["kind"] == "mesh"]
    out = []
    for i, row in list(enumerate(heights, 1))[every - 1 :: every]:
        top = sessions[row["session"]]
        carriages = [f"{top[t] - float(row[f'travel_{t}_mm']):.6f}" for t in TOWERS]
        out.append([str(i), row["session"], *carriages, "0"])
    return out


def main() -> int:
    given = sys.argv[1:]
    folder = Path(given[0]) if given else DATA
    out = Path(given[1]) if len(given) > 1 else Path("delta")
    if not (folder / "heights.csv").is_file():
        print(f"skipped: no measured data in {folder} (heights.csv, see docs/measured_delta.md)")
        return 0
    for name in ("heights", "both"):
        (out / name).mkdir(parents=True, exist_ok=True)
    (out / "flsun.yaml").write_text(machine(), encoding="utf-8")
    columns = "".join(f"  q{t}: {{actuator: {t}.carriage, unit: mm}}\n" for t in TOWERS)
    (out / "heights" / "experiment.yaml").write_text(
        HEAD.replace(", dd: 0.04", "") + columns, encoding="utf-8"
    )
    (out / "both" / "experiment.yaml").write_text(HEAD + columns, encoding="utf-8")
    data = rows(folder, int(given[2]) if len(given) > 2 else 7)
    with (out / "heights" / "data.csv").open("w", newline="", encoding="utf-8") as stream:
        csv.writer(stream).writerows([["id", "setup", "qa", "qb", "qc", "contact"], *data])
    more = distances(folder)
    head = ["id", "setup", "qa", "qb", "qc", "contact", "qa2", "qb2", "qc2", "distance"]
    with (out / "both" / "data.csv").open("w", newline="", encoding="utf-8") as stream:
        csv.writer(stream).writerows([head, *([*r, "", "", "", ""] for r in data), *more])
    print(
        f"{len(data)} heights in {out / 'heights'}, with {len(more)} distances in {out / 'both'}; machine {out / 'flsun.yaml'}"
    )
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
