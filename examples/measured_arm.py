# SPDX-License-Identifier: MIT
"""Report on a real arm: a UR10 under a laser tracker, calibrated with frame and tool unknown.

    python examples/measured_arm.py [DATA] [--series C B D] [--every 4] [-o FOLDER]

DATA is the folder of the series (series_B.csv, series_C.csv, series_D.csv); default
measured/ipa_ur10_accuracy. The data (MIT licence, Landgraf et al., IEEE CASE 2021) are not part
of stiffmap; without them the script says so and ends. docs/measured_arm.md tells the result.
"""

from __future__ import annotations

import argparse
import csv
import tempfile
from collections.abc import Sequence
from itertools import combinations
from pathlib import Path

import numpy as np

import stiffmap as sm
from stiffmap.common.broadcasting import Floats, Mask
from stiffmap.experiment import Predictor
from stiffmap.experiment.noise.whitening import LinearProblem, nuisance_part
from stiffmap.identification.calibration import Calibration
from stiffmap.identification.inference.travel import Profile
from stiffmap.identification.numbers import Tolerances
from stiffmap.ui.cli.calibrate import write as write_calibration

DATA = Path(__file__).resolve().parents[1] / "measured" / "ipa_ur10_accuracy"
JOINTS = ("base", "shoulder", "elbow", "wrist_1", "wrist_2", "wrist_3")
ELASTIC = ("drive compliance", "link compliance", "masses")
LENGTH = 1e3 * 3.0**0.5
"""From rms of the coordinates in m to rms of the length in mm."""
OVERLAP, NEAR = 20, 2.0
"""Degrees that two series must share for their profiles to be compared; from a knot."""
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


def write(data: Path, series: Sequence[str], every: int, folder: Path) -> None:
    """experiment.yaml and data.csv of every so many rows of some series, each a set-up of its own."""
    command = "".join(f"  c{i}: {{actuator: arm.{j}, unit: rad}}\n" for i, j in enumerate(JOINTS))
    folder.mkdir(parents=True, exist_ok=True)
    head = HEAD.format(series=", ".join(series))
    (folder / "experiment.yaml").write_text(head + "command:\n" + command)
    with (folder / "data.csv").open("w", newline="", encoding="utf-8") as stream:
        out = csv.writer(stream)
        out.writerow(["id", "setup", *(f"c{i}" for i in range(6)), "px", "py", "pz", "prx", "pry", "prz"])
        for name in series:
            with (data / f"series_{name}.csv").open(newline="", encoding="utf-8") as rows:
                for row in list(csv.DictReader(rows))[::every]:
                    q = [row[f"q{i}_rad"] for i in range(1, 7)]
                    place = [row[f"meas_{a}_mm"] for a in "xyz"]
                    turn = [row[f"meas_r{a}_deg"] for a in "xyz"]
                    out.writerow([f"{name}{row['index']}", name, *q, *place, *turn])


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("data", nargs="?", type=Path, default=DATA)
    parser.add_argument("--series", nargs="+", default=["C", "B", "D"], choices=["B", "C", "D"])
    parser.add_argument("--every", type=int, default=1, help="take every so many rows")
    parser.add_argument("--tolerance", type=float, default=3.0, help="factor on the default uncertainties")
    parser.add_argument("-o", "--output", type=Path, help="folder for the experiments and the calibrations")
    a = parser.parse_args()
    missing = [s for s in a.series if not (a.data / f"series_{s}.csv").is_file()]
    if missing:
        print(f"skipped: no measured data in {a.data} (series_{missing[0]}.csv, see docs/measured_arm.md)")
        return 0
    with tempfile.TemporaryDirectory() as scratch:
        place = a.output or Path(scratch)
        for series in a.series:
            write(a.data, [series], a.every, place / series)
        found = {s: calibrated(s, place / s, a.tolerance) for s in a.series}
        first, *others = a.series
        for series in others:
            elsewhere(first, found[first], series, place / series, found[series])
        alike(found)
        if len(a.series) > 1:
            write(a.data, a.series, a.every, place / "all")
            found["all"] = calibrated("all", place / "all", a.tolerance)
        if a.output:
            for series, c in found.items():
                write_calibration(c, place / series / "calibration")
    return 0


def calibrated(series: str, folder: Path, tolerance: float) -> Calibration:
    """Calibrate by geometry alone and with drives and masses, and say what holds on held-out poses."""
    tolerances = Tolerances().scaled(tolerance)
    geometry = sm.calibrate("ur10", folder, tolerances=tolerances, exclude=ELASTIC)
    c = sm.calibrate("ur10", folder, tolerances=tolerances)
    print(f"\nseries {series}, {len(c.experiment)} poses", *c.lines(), sep="\n  ")
    if c.held_out is None or geometry.held_out is None:
        return c
    print(f"  held-out {c.held_out.by}, rms of the position error's length, mm")
    print(f"    as declared (frame and tool fitted)  {LENGTH * c.held_out.before.rms:.3f}")
    print(f"    geometry                             {LENGTH * geometry.held_out.after.rms:.3f}")
    print(f"    geometry, drives and masses          {LENGTH * c.held_out.after.rms:.3f}")
    return c


def elsewhere(first: str, c: Calibration, series: str, folder: Path, own: Calibration) -> None:
    """What the calibration of one series foretells of another, whose rows tell its frame and tool only."""
    aside = np.isin(own.experiment.ids, own.outliers)
    print(f"\nseries {series} predicted by series {first}, rms of the position error's length, mm")
    declared = Predictor(sm.load_machine("ur10"), own.experiment)
    found = Predictor(c.machine, own.experiment)()
    for name, prediction in (("as declared", declared()), (f"calibrated on {first}", found)):
        problem = LinearProblem.of(own.experiment, declared.experiment.sigma, prediction, ~aside)
        raw = own.experiment.reading - prediction
        left = (raw - nuisance_part(problem, raw))[~aside, :3]
        print(f"    {name:35}  {LENGTH * float(np.sqrt(np.mean(left**2))):.3f}")


def alike(found: dict[str, Calibration]) -> None:
    """How far the profiles of two series, each found by itself, are the same where both have been."""
    for one, other in combinations(found, 2):
        others = {q.drive: q for q in found[other].profiles}
        for p, q in [(p, others[p.drive]) for p in found[one].profiles if p.drive in others]:
            at = np.radians(np.arange(0.0, 360.0))
            both = [standing(np.array(x.at), at) for x in (p, q)]
            x = at[both[0] & both[1]]
            if len(x) < OVERLAP:
                continue
            told = [np.interp(x, *turned(v)) for v in (p, q)]
            line = np.column_stack([np.ones_like(x), x])  # zero and gain are the calibration's
            left = [v - line @ np.linalg.lstsq(line, v, rcond=None)[0] for v in told]
            r = float(np.corrcoef(left[0], left[1])[0, 1])
            print(
                f"profiles of {p.drive} by {one} and by {other}, {len(x)} degrees of travel: correlation {r:.2f}"
            )


def standing(knots: Floats, at: Floats) -> Mask:
    """Where within a turn there is a knot nearer than `NEAR` degrees."""
    gap = np.abs(np.mod(knots[None] - at[:, None] + np.pi, 2 * np.pi) - np.pi)
    return np.asarray(gap.min(axis=1) < np.radians(NEAR))


def turned(p: Profile) -> tuple[Floats, Floats]:
    """Knots within a turn and the error there."""
    at = np.mod(p.at, 2 * np.pi)
    order = np.argsort(at)
    return at[order], np.array(p.error)[order]


if __name__ == "__main__":
    raise SystemExit(main())
