"""The arm of `arm_calibration.py` by robotkinecal (Nadeau; Li, Wu, Löwe, Li, IEEE T-RO 2016): held-out error and time.

    PYTHON_OF_THE_PEER bench/peers/arm_robotkinecal.py DATA.npz

Run by a Python that has robotkinecal (PyPI); prints JSON.
"""

import contextlib
import io
import json
import sys
import time

import numpy as np
import roboticstoolbox as rtb
from robotkinecal.calibration import SerialRobotKineCal
from spatialmath import SE3, Twist3


def pose(model, q):
    """Target at the joints q, by the fitted screws."""
    t = SE3()
    for axis, angle in zip(model.joint_screw_axis, q, strict=True):
        t *= Twist3(axis).exp(angle)
    return t * model.zero_conf_EE_pose


def main():
    data = np.load(sys.argv[1])
    q, seen, fold = data["q"], data["seen"], data["fold"]
    squares, seconds = [], []
    for k in np.unique(fold):
        train, test = fold != k, fold == k
        links = [rtb.PoERevolute(w, p) for w, p in zip(data["axes"], data["points"], strict=True)]
        model = SerialRobotKineCal(rtb.PoERobot(links, SE3(data["zero"], check=False)))
        # rtb adds a link of no motion at both ends, which robotkinecal takes for joints
        model.joint_screw_axis = model.joint_screw_axis[1:-1]
        model.N_JOINTS = len(model.joint_screw_axis)
        begun = time.process_time()
        with contextlib.redirect_stdout(io.StringIO()):
            model.set_observations(list(q[train]), [SE3(m, check=False) for m in seen[train]])
            model.solve(max_iterations=20)
        seconds.append(time.process_time() - begun)
        off = np.array([pose(model, a).t for a in q[test]]) - seen[test][:, :3, 3]
        squares.append(np.sum(off**2, axis=1))
    print(
        json.dumps(
            {
                "held_out_mm": 1e3 * float(np.sqrt(np.mean(np.concatenate(squares)))),
                "seconds": float(np.mean(seconds)),
            }
        )
    )


if __name__ == "__main__":
    main()
