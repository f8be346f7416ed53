"""The tap tests of this example: MuJoCo plays an arm whose second joint is 1.8 times as soft as its file says.

    python -m examples.taps.make_taps    # from the root of the repository

Frequencies carry 0.5 % noise, directions of modes 0.05 in each component; three poses, four modes each.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from tests.python.workspace.vibration.mujoco_frf import modes

import stiffmap as sm

HERE = Path(__file__).parent
POSES = np.array([[1.98, -0.28, 1.225], [1.7, 0.4, 1.4], [1.9, 0.0, 1.0]])
SOFT = 1.8


def main() -> None:
    """Write taps.csv."""
    arm = sm.load_machine(HERE / "kr210.yaml").with_effect(
        "compliance", element="a2", legs=["arm"], scale=SOFT
    )
    rng = np.random.default_rng(7)
    lines = ["x_mm,y_mm,z_mm,frequency_Hz,u_Hz,dir_x,dir_y,dir_z"]
    for p in POSES:
        f, way = modes(arm, p, 4)
        for hertz, b in zip(f, way, strict=True):
            b = b + 0.05 * rng.normal(size=3)
            hertz = hertz * (1 + 0.005 * rng.normal())
            at = ",".join(f"{1e3 * v:g}" for v in p)
            lines.append(
                f"{at},{hertz:.3f},{0.005 * hertz:.3f}," + ",".join(f"{v:.3f}" for v in b / np.linalg.norm(b))
            )
    (HERE / "taps.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
