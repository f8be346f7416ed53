"""The arm of `arm_calibration.py` by FIGAROH (Gepetto; PyPI figaroh, on Pinocchio): held-out error and time.

    PYTHON_OF_THE_PEER bench/peers/arm_figaroh.py DATA.npz

Run by a Python that has figaroh; prints JSON. Full parameters, base and tool frames, position and orientation measured.
"""

import contextlib
import io
import json
import logging
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import pandas as pd
import pinocchio as pin
from figaroh.calibration.base_calibration import BaseCalibration
from figaroh.calibration.calibration_tools import calc_updated_fkm
from figaroh.calibration.config import unified_to_legacy_config
from scipy.spatial.transform import Rotation

PLACES = ["x1", "y1", "z1", "phix1", "phiy1", "phiz1"]


def arm(data):
    """Pinocchio's model of the nominal screws, a frame at the target."""
    model, parent, last = pin.Model(), 0, pin.SE3.Identity()
    model.name = "ur10"
    for k, (w, p) in enumerate(zip(data["axes"], data["points"], strict=True)):
        turn = Rotation.align_vectors([w], [[0.0, 0.0, 1.0]])[0].as_matrix()
        here = pin.SE3(turn, p)
        name = f"joint_{k + 1}"
        parent = model.addJoint(parent, pin.JointModelRZ(), last.inverse() * here, name)
        model.addJointFrame(parent)
        model.appendBodyToJoint(parent, pin.Inertia.Random(), pin.SE3.Identity())
        last = here
    zero = pin.SE3(data["zero"][:3, :3], data["zero"][:3, 3])
    model.addFrame(pin.Frame("target", parent, last.inverse() * zero, pin.FrameType.OP_FRAME))
    model.lowerPositionLimit[:], model.upperPositionLimit[:] = -7.0, 7.0
    return pin.RobotWrapper(model)


class Arm(BaseCalibration):
    """Settings in the place of a file."""

    def load_param(self, config_file, setting_type="calibration"):
        names = [n for n in self.model.names if n.startswith("joint_")]
        self.calib_config = unified_to_legacy_config(
            self.robot,
            {
                "joints": {"active_joints": names},
                "kinematics": {"base_frame": "universe", "tool_frame": "target"},
                "parameters": {"calibration_level": "full_params", "outlier_threshold": 1.0},
                "measurements": {
                    "markers": [{"measurable_dof": [True] * 6}],
                    "poses": {"base_pose": [0.0] * 6, "tool_pose": [0.0] * 6},
                },
                "data": {"number_of_samples": int(self.samples), "source_file": config_file},
            },
        )

        self.calib_config |= {"known_baseframe": False, "known_tipframe": False}

    def cost_function(self, var):
        expected = calc_updated_fkm(self.model, self.data, var, self.q_measured, self.calib_config)
        left = self._compute_logmap_residuals(self.PEE_measured, expected, position_frame="world")
        return self.apply_measurement_weighting(left)


def written(file, model, q, seen):
    """Measurements as FIGAROH reads them."""
    rpy = np.array([pin.rpy.matrixToRpy(m[:3, :3]) for m in seen])
    names = [n for n in model.names if n.startswith("joint_")]
    table = pd.DataFrame(np.hstack([seen[:, :3, 3], rpy, q]), columns=[*PLACES, *names])
    table.to_csv(file, index=False)


def main():
    logging.disable(logging.CRITICAL)
    data = np.load(sys.argv[1])
    q, seen, fold = data["q"], data["seen"], data["fold"]
    squares, seconds = [], []
    with tempfile.TemporaryDirectory() as scratch:
        for k in np.unique(fold):
            train, test = fold != k, fold == k
            robot = arm(data)
            file = str(Path(scratch) / f"fold{k}.csv")
            written(file, robot.model, q[train], seen[train])
            Arm.samples = int(train.sum())
            begun = time.process_time()
            with contextlib.redirect_stdout(io.StringIO()):
                fit = Arm(robot, file)
                fit.initialize()
                fit.solve()
            seconds.append(time.process_time() - begun)
            fit.calib_config["NbSample"] = int(test.sum())
            var = fit.LM_result.x
            told = calc_updated_fkm(fit.model, fit.data, var, q[test], fit.calib_config)
            at = np.reshape(told, (6, -1))[:3].T
            squares.append(np.sum((at - seen[test][:, :3, 3]) ** 2, axis=1))
    rms = float(np.sqrt(np.mean(np.concatenate(squares))))
    print(json.dumps({"held_out_mm": 1e3 * rms, "seconds": float(np.mean(seconds))}))


if __name__ == "__main__":
    main()
