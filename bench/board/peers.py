"""What other packages reach with the same rows."""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

import stiffmap as sm
from board.row import Peer

SCRIPTS = Path(__file__).resolve().parents[1] / "peers"
sys.path.insert(0, str(SCRIPTS))
NAMES = {
    "least_squares": "plain least squares",
    "robotkinecal": "robotkinecal (products of exponentials)",
    "figaroh": "FIGAROH (on Pinocchio)",
}


def beside_arm(folder: Path, pythons: dict[str, str]) -> tuple[Peer, ...]:
    """Peers on an arm whose tracker read poses: the same five folds. One without a Python says so."""
    import arm_calibration

    out = []
    with tempfile.TemporaryDirectory() as scratch:
        file = Path(scratch) / "arm.npz"
        arm_calibration.exported(folder, file)
        for key, name in NAMES.items():
            python = sys.executable if key == "least_squares" else pythons.get(key)
            if python is None:
                out.append(Peer(name, None, note=f"not installed (--peer {key}=PYTHON)"))
                continue
            run = subprocess.run(
                [python, str(SCRIPTS / f"arm_{key}.py"), str(file)], capture_output=True, text=True
            )
            if run.returncode:
                last = (run.stderr.strip().splitlines() or ["no message"])[-1]
                out.append(Peer(name, None, note=f"failed: {last}"))
                continue
            found = json.loads(run.stdout.splitlines()[-1])
            out.append(Peer(name, found["held_out_mm"], found["seconds"], "one fit of four folds"))
    return tuple(out)


def screws(machine: sm.Machine, joints: int) -> tuple[Any, Any, Any]:
    """Axes (k, 3), points on them (k, 3) m and the flange's place (3,) m at zero joints, by turning each joint."""
    from scipy.spatial.transform import Rotation

    axes, points = [], []
    for k in range(joints):
        there, back = (sm.forward_kinematics(machine, s * 0.5 * np.eye(joints)[k : k + 1]) for s in (1, -1))
        r = there.rotation[0] @ back.rotation[0].T
        axes.append(Rotation.from_matrix(r).as_rotvec())
        p = there.position[0] - r @ back.position[0]
        points.append(np.linalg.lstsq(np.eye(3) - r, p, rcond=1e-9)[0])
    zero = sm.forward_kinematics(machine, np.zeros((1, joints)))
    return np.array(axes), np.array(points), zero.position[0]


def plain_places(machine: sm.Machine, q: Any, seen: Any, new: Any) -> Peer:
    """Plain least squares on places (n, 3) m of a reflector: fitted to all rows but `new`, mean length there in mm."""
    import arm_least_squares

    begun = time.process_time()
    model = screws(machine, q.shape[1])
    x = arm_least_squares.fitted(q[~new], seen[~new], *model)
    left = arm_least_squares.places(x, q[new], *model) - seen[new]
    after = 1e3 * float(np.linalg.norm(left, axis=1).mean())
    return Peer(NAMES["least_squares"], after, time.process_time() - begun)
