"""In place of a robot: ``python examples/sockets/make_tables.py arm.yaml FOLDER`` puts a ball into sockets and writes the tables.

The arm shows angles whose zeros are wrong at two joints. The ball's place at the flange and the sockets' places are known to this
script only, and the ball sits in a socket to 0.1 mm.
"""

from __future__ import annotations

import csv
import sys
from pathlib import Path

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

import stiffmap as sm

ZEROS = np.array([0, 0, -20e-3, 0, 10e-3, 0])
"""Turn of each joint less the angle that is shown, rad."""
BALL = np.array([0.060, 0.004, -0.003])
PLACES = {
    "readings": {"front": [0.45, 0.0, 0.02], "left": [0.30, 0.35, 0.17], "right": [0.35, -0.30, 0.32]},
    "unseen": {"middle": [0.40, 0.10, 0.12]},
}
POSTURES, PLAY, APART = 12, 1e-4, 0.05


def main() -> None:
    """Write ``readings.csv`` and ``unseen.csv``."""
    arm, rng = sm.load_machine(sys.argv[1]), np.random.default_rng(1)
    for name, places in PLACES.items():
        with (Path(sys.argv[2]) / f"{name}.csv").open("w", newline="", encoding="utf-8") as stream:
            table = csv.writer(stream, lineterminator="\n")
            table.writerow(["position", "socket", *(f"j{k} [deg]" for k in range(1, 7))])
            for place, corner in places.items():
                along = Rotation.from_euler("z", rng.uniform(0, 360), degrees=True).apply([APART, 0, 0])
                for socket in (0, 1):
                    for _ in range(POSTURES):
                        goal = np.array(corner) + socket * along + PLAY * rng.standard_normal(3)
                        turn = np.arctan2(goal[1], goal[0])
                        shown = _seated(arm, goal, [turn, 0.4, 0.5, 0, 0.7, 0] + rng.uniform(-0.8, 0.8, 6))
                        table.writerow([place, socket, *(f"{q:.3f}" for q in np.degrees(shown))])


def _seated(arm: sm.Machine, goal: np.ndarray, start: np.ndarray) -> np.ndarray:
    """Angles shown, near `start`, where the ball sits at `goal`."""

    def apart(shown: np.ndarray) -> np.ndarray:
        at = sm.forward_kinematics(arm, (shown + ZEROS)[None])
        return np.append(at.position[0] + at.rotation[0] @ BALL - goal, 1e-6 * (shown - start))

    return np.asarray(least_squares(apart, start, xtol=1e-12, ftol=1e-12, gtol=1e-12).x)


if __name__ == "__main__":
    main()
