# SPDX-License-Identifier: MIT
"""Report on a real arm: a UR10 under a laser tracker, calibrated with frame and tool unknown.

    python examples/measured_arm.py [DATA] [--series C] [--every 4] [-o FOLDER]

DATA is the folder of the series (series_B.csv, series_C.csv, series_D.csv); default
../shared/measured/ipa_ur10_accuracy. The data (MIT licence, Landgraf et al., IEEE CASE 2021) are not part
of stiffmap; without them the script says so and ends. docs/measured_arm.md tells the result.
"""

from __future__ import annotations

import argparse
import csv
import tempfile
from pathlib import Path

import stiffmap as sm
from stiffmap.calibration import Tolerances

DATA = Path(__file__).resolve().parents[2] / "shared" / "measured" / "ipa_ur10_accuracy"
JOINTS = ("base", "shoulder", "elbow", "wrist_1", "wrist_2", "wrist_3")
HEAD = """machine: ur10
title: UR10 under a laser tracker (Fraunhofer IPA, series {series})
quantity: position
units: {{length: mm, force: N, angle: deg}}
noise: {{dx: 0.033, dy: 0.033, dz: 0.033, rx: 0.005, ry: 0.005, rz: 0.005}}
frame: unknown
tool: unknown
target_orientation: XYZ
gravity: [0, 0, -9.81]
"""


def write(data: Path, series: str, every: int, folder: Path) -> None:
    """experiment.yaml and data.csv of every so many rows of a series."""
    command = "".join(f"  c{i}: {{actuator: arm.{j}, unit: rad}}\n" for i, j in enumerate(JOINTS))
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "experiment.yaml").write_text(HEAD.format(series=series) + "command:\n" + command)
    with (data / f"series_{series}.csv").open(newline="", encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))[::every]
    with (folder / "data.csv").open("w", newline="", encoding="utf-8") as stream:
        out = csv.writer(stream)
        out.writerow(["id", *(f"c{i}" for i in range(6)), "px", "py", "pz", "prx", "pry", "prz"])
        for row in rows:
            q = [row[f"q{i}_rad"] for i in range(1, 7)]
            place = [row[f"meas_{a}_mm"] for a in "xyz"]
            turn = [row[f"meas_r{a}_deg"] for a in "xyz"]
            out.writerow([row["index"], *q, *place, *turn])


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("data", nargs="?", type=Path, default=DATA)
    parser.add_argument("--series", default="C", choices=["B", "C", "D"])
    parser.add_argument("--every", type=int, default=4, help="take every so many rows")
    parser.add_argument("--tolerance", type=float, default=3.0, help="factor on the default uncertainties")
    parser.add_argument("-o", "--output", type=Path, help="folder for the experiment and the calibration")
    a = parser.parse_args()
    if not (a.data / f"series_{a.series}.csv").is_file():
        print(f"skipped: no measured data in {a.data} (series_{a.series}.csv, see docs/measured_arm.md)")
        return 0
    with tempfile.TemporaryDirectory() as scratch:
        folder = a.output or Path(scratch)
        write(a.data, a.series, a.every, folder)
        report(folder, a.tolerance)
    return 0


def report(folder: Path, tolerance: float) -> None:
    """Calibrate by geometry alone and with drives and masses, and say what holds on held-out poses."""
    tolerances = Tolerances().scaled(tolerance)
    elastic = ("drive compliance", "link compliance", "masses")
    geometry = sm.calibrate("ur10", folder, tolerances=tolerances, exclude=elastic)
    c = sm.calibrate("ur10", folder, tolerances=tolerances)
    print("\n".join(c.lines()))
    if c.held_out is None or geometry.held_out is None:
        return
    length = 1e3 * 3.0**0.5
    print("\nheld-out poses, rms of the position error's length, mm")
    print(f"  as declared (frame and tool fitted)  {length * c.held_out.before:.3f}")
    print(f"  geometry                             {length * geometry.held_out.after:.3f}")
    print(f"  geometry, drives and masses          {length * c.held_out.after:.3f}")
    print(f"  left by no model                     {length * c.floor:.3f}")
    print("\n".join(["", *c.table(15)]))


if __name__ == "__main__":
    raise SystemExit(main())
