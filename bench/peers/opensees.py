"""The Tripteron as beams in OpenSeesPy, built anew per pose; equalDOF less a rotation is a passive joint."""

from __future__ import annotations

import numpy as np
import openseespy.opensees as ops
from tripteron import AREA, DRIVE, INERTIA, LEGS, POLAR, SHEAR, YOUNG, corners

NAME = "OpenSeesPy, corotational"


def build(p: np.ndarray, transformation: str = "Corotational") -> None:
    """Nodes 100·leg: ground, slider, elbow on either side, tip; node 1 is the platform."""
    ops.wipe()
    ops.model("basic", "-ndm", 3, "-ndf", 6)
    ops.node(1, *map(float, p))
    ops.uniaxialMaterial("Elastic", 1, DRIVE)
    for i, (axes, _) in enumerate(LEGS):
        a, b, c = corners(p, i)
        axis = axes[:, 2]
        free = int(np.argmax(np.abs(axis))) + 1
        ground = 100 * (i + 1)
        for tag, at in enumerate((a, a, b, b, c)):
            ops.node(ground + tag, *map(float, at))
        ops.fix(ground, 1, 1, 1, 1, 1, 1)
        ops.fix(ground + 1, *(int(d not in (free, free + 3)) for d in range(1, 7)))
        ops.element("zeroLength", 10 * ground, ground, ground + 1, "-mat", 1, "-dir", free)
        held = [d for d in range(1, 7) if d != free + 3]
        ops.equalDOF(ground + 2, ground + 3, *held)
        ops.equalDOF(1, ground + 4, *held)
        ops.geomTransf(transformation, i + 1, *map(float, axis))
        for tag in (1, 3):
            section = (AREA, YOUNG, SHEAR, POLAR, INERTIA, INERTIA)
            ops.element(
                "elasticBeamColumn", 10 * ground + tag, ground + tag, ground + tag + 1, *section, i + 1
            )


def loaded(p: np.ndarray, wrench: np.ndarray) -> np.ndarray:
    """Displacement (3,) m at the equilibrium; OpenSees gives no platform stiffness. NaN where it fails."""
    build(p)
    ops.timeSeries("Linear", 1)
    ops.pattern("Plain", 1, 1)
    ops.load(1, *map(float, wrench))
    ops.constraints("Transformation")
    ops.numberer("RCM")
    ops.system("UmfPack")
    ops.test("NormDispIncr", 1e-10, 30, 0)
    ops.algorithm("Newton")
    ops.integrator("LoadControl", 1.0)
    ops.analysis("Static")
    return np.array(ops.nodeDisp(1))[:3] if ops.analyze(1) == 0 else np.full(3, np.nan)
