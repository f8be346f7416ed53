"""A measured UR10's kinematics by stiffmap and by other calibration packages: same poses, same folds, held-out error and time.

    OPENBLAS_NUM_THREADS=1 python bench/peers/arm_calibration.py measured/ipa_ur10_accuracy --every 8 \\
        --peer robotkinecal=/path/to/venv/bin/python --peer figaroh=/path/to/venv/bin/python

Each peer runs in a Python of its own (their requirements exclude each other), `arm_NAME.py` beside this file, and gets commanded
joints, poses of the target in base axes (frame and target found by stiffmap's hand-eye registration of all poses, errors of which each
package can take up in its first and last frame), the nominal axes, and five folds. Held-out error: rms of the length of the
target's position error in each fold, fitted to the other four. Peers know no weight; stiffmap is run with and without it.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

import stiffmap as sm
from stiffmap.experiment import Predictor, load_experiment
from stiffmap.experiment.noise.whitening import folds
from stiffmap.identification.numbers import Tolerances

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "examples"))
import measured_arm

ELASTIC = ("drive compliance", "link compliance", "masses")


def exported(folder: Path, file: Path) -> None:
    """Commanded joints, seen poses in base axes, folds and nominal screws."""
    machine = sm.load_machine("ur10")
    data = load_experiment(folder)
    e = Predictor(machine, data).experiment
    frames = {name.split()[0]: (r, p) for name, r, p in e.registration}
    (base_r, base_p), (tool_r, tool_p) = frames["instrument"], frames["target"]
    assert data.seen is not None
    assert data.seen_rotation is not None
    seen = np.tile(np.eye(4), (len(e), 1, 1))
    seen[:, :3, :3] = base_r.T @ data.seen_rotation
    seen[:, :3, 3] = (data.seen - base_p) @ base_r
    q0 = np.zeros((1, 6))
    zero = np.eye(4)
    at = sm.forward_kinematics(machine, q0)
    zero[:3, :3] = at.rotation[0] @ tool_r
    zero[:3, 3] = at.position[0] + at.rotation[0] @ tool_p
    axes, points = [], []
    for k in range(6):  # the axis of a joint from two small turns about it
        turned = [sm.forward_kinematics(machine, s * 0.5 * np.eye(6)[k : k + 1]) for s in (1, -1)]
        r = turned[0].rotation[0] @ turned[1].rotation[0].T
        axes.append(Rotation.from_matrix(r).as_rotvec())
        p = turned[0].position[0] - r @ turned[1].position[0]
        points.append(np.linalg.lstsq(np.eye(3) - r, p, rcond=1e-9)[0])
    joints = np.column_stack([data.command[:, i] for i in range(6)])
    np.savez(file, q=joints, seen=seen, fold=folds(e, 0)[0], zero=zero, axes=axes, points=points)


def main() -> int:
    """Command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("data", type=Path)
    parser.add_argument("--series", default="C")
    parser.add_argument("--every", type=int, default=8)
    parser.add_argument("--peer", action="append", default=[], help="NAME=PYTHON")
    a = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        folder, file = Path(scratch) / "arm", Path(scratch) / "arm.npz"
        measured_arm.write(a.data, [a.series], a.every, folder)
        exported(folder, file)
        e = load_experiment(folder)
        print(f"series {a.series}, {len(e)} poses, five folds; seconds of CPU for one fit of four folds")
        print(f"{'package':34}  held-out, mm  seconds")
        for name, plan, out in (
            ("stiffmap, geometry, no weight", replace(e, gravity=None), ELASTIC),
            ("stiffmap, geometry beside weight", e, ELASTIC),
            ("stiffmap, all", e, ()),
        ):
            begun = time.process_time()
            c = sm.calibrate("ur10", plan, tolerances=Tolerances().scaled(10.0), exclude=out)
            used = time.process_time() - begun
            assert c.held_out is not None
            print(
                f"{name:34}  {measured_arm.LENGTH * c.held_out.after.rms:12.3f}  {used:7.2f} (all folds and verdict)"
            )
        for name, python in (p.split("=", 1) for p in a.peer):
            script = Path(__file__).with_name(f"arm_{name}.py")
            run = subprocess.run(
                [python, str(script), str(file)], capture_output=True, text=True, check=False
            )
            if run.returncode:
                print(f"{name:34}  failed: {run.stderr.strip().splitlines()[-1]}")
                continue
            told = json.loads(run.stdout.splitlines()[-1])
            print(f"{name:34}  {told['held_out_mm']:12.3f}  {told['seconds']:7.2f}")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
