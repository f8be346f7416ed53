# SPDX-License-Identifier: MIT
"""A real robot: the laser-tracker readings of a UR10 against its nominal model.

Data: Landgraf et al., IEEE CASE 2021, github.com/christianlandgraf/ipa-robot-accuracy (MIT licence); as
CSV files in the folder given. They are read where they are and not part of stiffmap.

    python examples/measured_ur10.py measured/ipa_ur10_accuracy -o ur10

makes an experiment of commanded joint angles and tracker positions, reduced to the robot's base by a
hand-eye registration whose rest (frames of instrument and tool) stays unknown, and diagnoses it. With
150 rows drawn from series B (held-out rms 0.47 mm, 0.17 after) the verdict is `effects+unattributed`: geometry
within tolerance, and errors of the shoulder, base and elbow that return every 17 to 23 degrees of their turn.
With `--rows 60` only that of the shoulder is told from a smooth field that knows nothing of the arm.
"""

from __future__ import annotations

import argparse
import csv
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

import stiffmap as sm
from stiffmap.solve.kinematics import forward_kinematics, inverse_kinematics

Floats = NDArray[np.float64]

JOINTS = ("base", "shoulder", "elbow", "wrist_1", "wrist_2", "wrist_3")
NOISE = 0.03  # mm: the maker's repeatability, +-0.1 mm, taken as three standard deviations

HEAD = """machine: ur10
title: UR10 under a laser tracker (Fraunhofer IPA, series B)
quantity: position
units: {length: mm}
frame: unknown
tool: offset_unknown
gravity: [0, 0, -9.81]
"""


def table(path: Path) -> dict[str, Floats]:
    """Columns of a CSV file."""
    with path.open(newline="") as file:
        rows = list(csv.DictReader(file))
    return {k: np.array([float(r[k]) for r in rows]) for k in rows[0]}


def tracker(t: dict[str, Floats]) -> tuple[Floats, Floats]:
    """Position (n, 3) m and orientation (n, 3, 3) of the target in the tracker's frame."""
    angles = np.column_stack([t[f"meas_r{a}_deg"] for a in "xyz"])
    position = 1e-3 * np.column_stack([t[f"meas_{a}_mm"] for a in "xyz"])
    return position, Rotation.from_euler("XYZ", angles, degrees=True).as_matrix()


def register(p: Floats, r: Floats, q: Floats, m: Floats) -> Floats:
    """(n, 3) m, tracker positions q as flange positions in the robot's base.

    Hand-eye registration of flange poses (p, r) with target poses (q, m) = base * flange * tool: the
    turns from relative rotations, the shifts by least squares.
    """
    i, k = np.random.default_rng(0).integers(0, len(p), (2, 400))
    a = Rotation.from_matrix(np.swapaxes(r[i], 1, 2) @ r[k]).as_rotvec()
    b = Rotation.from_matrix(np.swapaxes(m[i], 1, 2) @ m[k]).as_rotvec()
    tool = Rotation.align_vectors(a, b)[0].as_matrix()
    base = Rotation.from_matrix(m @ tool.T @ np.swapaxes(r, 1, 2)).mean().as_matrix()
    rows = np.concatenate([base @ r, np.broadcast_to(np.eye(3), r.shape)], axis=2).reshape(-1, 6)
    shift = np.linalg.lstsq(rows, (q - p @ base.T).ravel(), rcond=None)[0]
    return np.asarray((q - shift[3:]) @ base - r @ shift[:3])


def choose(machine: sm.Machine, t: dict[str, Floats], rows: int) -> tuple[Floats, Floats, Floats, Floats]:
    """Row numbers, joint angles, flange positions and readings of poses in the home configuration."""
    q = np.column_stack([t[f"q{i}_rad"] for i in range(1, 7)])
    flange = forward_kinematics(machine, q)
    angles = inverse_kinematics(machine, flange.position, rotation=flange.rotation).actuators
    same = np.abs(np.angle(np.exp(1j * (angles - q)))).max(axis=1) < 1e-6
    reading = register(flange.position, flange.rotation, *tracker(t))
    kept = np.flatnonzero(same)
    kept = np.sort(np.random.default_rng(1).permutation(kept)[:rows])
    return kept, q[kept], flange.position[kept], reading[kept]


def write(folder: Path, machine: sm.Machine, t: dict[str, Floats], rows: int) -> None:
    """The experiment's two files."""
    number, q, flange, reading = choose(machine, t, rows)
    folder.mkdir(parents=True, exist_ok=True)
    noise = ", ".join(f"d{a}: {NOISE}" for a in "xyz")
    commands = "".join(
        f"  {j}: {{actuator: {a}, unit: rad}}\n" for j, a in zip(JOINTS, machine.actuators, strict=True)
    )
    (folder / "experiment.yaml").write_text(f"{HEAD}noise: {{{noise}}}\ncommand:\n{commands}")
    with (folder / "data.csv").open("w", newline="") as file:
        out = csv.writer(file)
        out.writerow(["id", *JOINTS, "dx", "dy", "dz", "temperature"])
        for k, angles, e in zip(number, q, 1e3 * (reading - flange), strict=True):
            out.writerow([k, *angles, *(f"{v:.5f}" for v in e), t["temperature_C"][k]])


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("data", type=Path, help="folder with series_B.csv")
    parser.add_argument("-o", "--output", type=Path, default=Path("ur10"))
    parser.add_argument("--rows", type=int, default=150)
    args = parser.parse_args()
    machine = sm.load_machine("ur10")
    write(args.output, machine, table(args.data / "series_B.csv"), args.rows)
    diagnosis = sm.diagnose(machine, args.output, seed=0)
    print(diagnosis)
    diagnosis.report(args.output / "report.html")
    (args.output / "diagnosis.json").write_text(diagnosis.to_json())


if __name__ == "__main__":
    main()
