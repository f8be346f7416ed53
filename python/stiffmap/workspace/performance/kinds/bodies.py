"""What the bodies of the machine weigh, how they vibrate and what ground they stand over."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from stiffmap.common.broadcasting import Floats
from stiffmap.solve.status import Status
from stiffmap.workspace.maps.inputs import box_nodes
from stiffmap.workspace.performance.motion.closing import drive_kinematics
from stiffmap.workspace.performance.motion.inertia import (
    moving_mass,
    natural_frequencies,
    need_masses,
    total_mass,
)
from stiffmap.workspace.performance.registry import Case, Found, Measure, over_poses


def mass(case: Case) -> Found:
    """All bodies that joints move."""
    need_masses(case.machine, "mass")
    return Found(moving_mass(case.machine), note=f"all bodies: {total_mass(case.machine):.4g} kg")


def frequency(case: Case) -> Found:
    """Over a coarse grid of the box, unloaded, drives held."""
    w = natural_frequencies(
        case.machine,
        case.coarse_positions,
        rotation=case.rotation,
        gravity=case.gravity,
        modes=1,
        threads=case.threads,
    )
    return over_poses(case.coarse_positions, w.frequency[:, 0], "high")


def footprint(case: Case) -> Found:
    """Area in the base's xy plane of the frames of all bodies and joints."""
    if case.quick:
        k, corner = case.kinematics, _corners(case.positions)
    else:
        p = box_nodes(case.low, case.high, 2)
        k = drive_kinematics(case.machine, p, case.rotation, threads=case.threads)
        corner = _corners(p)
    coordinates, status = k.coordinates[corner], k.status[corner]
    if (status != Status.CONVERGED).any():
        return Found(float("nan"), note="a corner of the box is not within reach")
    points = np.concatenate([case.machine.compiled.frames(x)[0][1:] for x in coordinates])
    size = np.ptp(points, axis=0)
    return Found(float(size[0] * size[1]), note=f"{1e3 * size[0]:.0f} x {1e3 * size[1]:.0f} mm")


def _corners(p: Floats) -> NDArray[np.bool_]:
    return np.asarray(((p == p.min(axis=0)) | (p == p.max(axis=0))).all(axis=1))


MEASURES = (
    Measure("mass", "moving mass", "kg", "low", mass, "kg", order=40),
    Measure("frequency", "first natural frequency", "Hz", "high", frequency, "Hz", order=42),
    Measure("footprint", "ground that the machine stands over", "m^2", "low", footprint, "m²", order=43),
)
