# SPDX-License-Identifier: MIT
"""A real UR5 under a laser tracker: from commanded joints to a machine file, and what it does on poses that no fit saw.

    python examples/measured_ur5.py [DATA] [--poses 1000] [--tolerance 3] [-o FOLDER]

DATA is the folder of grid.csv (to calibrate) and random.csv (20 poses that no fit sees); default measured/ur5_tracker.
The data (MIT licence, P. Jacobi, github.com/pauljac7700/serial_robots_datasets) are not part of stiffmap; without them the script says
so and ends. The tracker read one reflector: its place on the flange and the tracker's frame are unknown.
"""

from __future__ import annotations

import argparse
import csv
import tempfile
from pathlib import Path

import numpy as np

import stiffmap as sm
from stiffmap.common.broadcasting import Floats, Mask
from stiffmap.experiment import Experiment, Predictor
from stiffmap.experiment.files.load import load_experiment
from stiffmap.experiment.noise.whitening import left_unseen
from stiffmap.identification.numbers import Tolerances
from stiffmap.solve.kinematics import forward_kinematics
from stiffmap.ui.cli.calibrate import write as write_calibration

DATA = Path(__file__).resolve().parents[1] / "measured" / "ur5_tracker"
MACHINE = Path(__file__).with_name("ur5.yaml")
JOINTS = ("base", "shoulder", "elbow", "wrist_1", "wrist_2", "wrist_3")
HEAD = """machine: ur5
title: UR5 under a laser tracker (P. Jacobi, Tsinghua University)
quantity: position
units: {length: mm, force: N, angle: deg}
noise: {dx: 0.033, dy: 0.033, dz: 0.033}
frame: unknown
tool: offset_unknown
gravity: [0, 0, -9.81]
command:
"""


def table(path: Path) -> dict[str, Floats]:
    """Columns of a CSV file."""
    with path.open(newline="", encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    return {k: np.array([float(r[k]) for r in rows]) for k in rows[0]}


def joined(data: Path, poses: int) -> tuple[dict[str, Floats], int]:
    """The first poses of the grid and all random ones behind them, and how many the fit may see."""
    grid, random = table(data / "grid.csv"), table(data / "random.csv")
    seen = min(poses, len(grid["x_t"]))
    pick = np.sort(np.random.default_rng(0).permutation(len(grid["x_t"]))[:seen])
    return {k: np.concatenate([grid[k][pick], random[k]]) for k in grid}, seen


def write(machine: sm.Machine, t: dict[str, Floats], seen: int, folder: Path) -> None:
    """experiment.yaml and data.csv: places reached (target less difference) less the flange's, and less a first guess of
    the reflector's place and of the frame's shift by the poses that the fit may see; what they are off stays unknown."""
    q = np.radians(np.column_stack([t[f"joint_{i}"] for i in range(1, 7)]))
    flange = forward_kinematics(machine, q)
    place = 1e-3 * np.column_stack([t[f"{a}_t"] - t[f"{a}_dif"] for a in "xyz"])
    off = place - flange.position
    columns = np.concatenate([flange.rotation, np.broadcast_to(np.eye(3), flange.rotation.shape)], axis=2)
    guess = np.linalg.lstsq(columns[:seen].reshape(-1, 6), off[:seen].ravel(), rcond=None)[0]
    reading = 1e3 * (off - columns @ guess)
    folder.mkdir(parents=True, exist_ok=True)
    command = "".join(f"  {j}: {{actuator: arm.{j}, unit: rad}}\n" for j in JOINTS)
    (folder / "experiment.yaml").write_text(HEAD + command, encoding="utf-8")
    with (folder / "data.csv").open("w", newline="", encoding="utf-8") as stream:
        out = csv.writer(stream)
        out.writerow(["id", *JOINTS, "dx", "dy", "dz"])
        for k, (angles, r) in enumerate(zip(q, reading, strict=True)):
            out.writerow([k, *map(float, angles), *map(float, r)])


def lengths(left: Floats) -> str:
    """Mean and largest length of position errors (n, 3) m, and rms of one coordinate, in mm."""
    d = 1e3 * np.linalg.norm(left[:, :3], axis=1)
    one = float(np.sqrt(np.mean(d**2) / 3.0))
    return f"{d.mean():.4f} mean, {d.max():.4f} largest, {one:.4f} rms of one coordinate"


def unseen(machine: sm.Machine, whole: Experiment, new: Mask) -> Floats:
    """(n, c) what a machine leaves of the readings in `new` (n,), frame and reflector as the others determine them."""
    p = Predictor(machine, whole)
    e, base = p.experiment, p()
    return left_unseen(e, e.sigma, base, ~new, new)[new]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("data", nargs="?", type=Path, default=DATA)
    parser.add_argument("--poses", type=int, default=1000, help="poses of the grid that the fit sees")
    parser.add_argument("--tolerance", type=float, default=3.0, help="factor on the default uncertainties")
    parser.add_argument("-o", "--output", type=Path, help="folder for the experiment and the calibration")
    a = parser.parse_args()
    if not (a.data / "grid.csv").is_file():
        print(f"skipped: no measured data in {a.data} (grid.csv, see docs/measured_ur5.md)")
        return 0
    with tempfile.TemporaryDirectory() as scratch:
        folder = a.output or Path(scratch)
        report(a.data, a.poses, a.tolerance, folder)
    return 0


def report(data: Path, poses: int, tolerance: float, folder: Path) -> None:
    """Calibrate on the grid, write the machine file, and say what that file does on the random poses."""
    declared = sm.load_machine(MACHINE)
    t, seen = joined(data, poses)
    write(declared, t, seen, folder / "all")
    whole = load_experiment(folder / "all")
    new = np.arange(len(whole)) >= seen
    c = sm.calibrate(declared, whole.rows(~new), tolerances=Tolerances().scaled(tolerance))
    print(*c.lines(), sep="\n")
    write_calibration(c, folder / "calibration")
    file = sm.load_machine(folder / "calibration" / "machine.yaml")
    print(f"\n{new.sum()} poses that no fit saw, length of the position error in mm")
    for name, machine in (("as declared", declared), ("machine file", file)):
        print(f"  {name:20} {lengths(unseen(machine, whole, new))}")


if __name__ == "__main__":
    raise SystemExit(main())
