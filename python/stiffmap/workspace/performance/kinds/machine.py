"""What the machine is in the orientation of the case: its masses, their first frequency, the ground that it stands over, the volume of its
workspace, and the first edge of the largest box of the required shape in it, equation (3)."""

from __future__ import annotations

import numpy as np

from stiffmap.common.errors import StiffmapError
from stiffmap.solve.status import Status
from stiffmap.workspace.maps.inputs import box_nodes
from stiffmap.workspace.performance.box.box import largest_box
from stiffmap.workspace.performance.box.workspace import workspace_volume
from stiffmap.workspace.performance.limits.limits import Bounds
from stiffmap.workspace.performance.motion.closing import drive_kinematics
from stiffmap.workspace.performance.motion.inertia import (
    moving_mass,
    natural_frequencies,
    need_masses,
    total_mass,
)
from stiffmap.workspace.performance.registry import Case, Found, Measure, over_poses

CELLS, QUICK = 12, 6


def volume(case: Case) -> Found:
    """Reach, drive ranges, joint limits, the transmission range, singularities and the case's limits count."""
    w = workspace_volume(case.machine, cells=QUICK if case.quick else CELLS, **case.limits)
    if w.dimension < 3:
        raise StiffmapError(
            f"{case.machine.name}: the workspace is flat: {w.volume:.4g} m{'²' if w.dimension == 2 else ''}"
        )
    ends = ", ".join(f"{name} {100 * share:.0f} %" for name, share in w.limited_by[:4])
    if w.volume == 0:
        return Found(0.0, note=f"no pose is inside; of all drawn, broken: {ends}", extra={"workspace": w})
    note = f"± {w.error:.2g} m³ (standard error){', more outside of the region' if w.cut else ''}; ends by {ends or 'nothing found'}"
    return Found(w.volume, note=note, extra={"workspace": w})


def edge(case: Case) -> Found:
    """Anywhere; drive ranges, joint limits, the transmission range and the case's limits count."""
    if case.quick:
        return concentric(case)
    b = largest_box(
        case.machine, case.proportions, tolerance=case.gap, scheduler=case.scheduler, **case.limits
    )
    if b.edge == 0:
        note = f"no pose was found inside; broken: {', '.join(b.limited_by)}"
        return Found(0.0, note=note, extra={"box": b})
    note = f"no box of {1e3 * b.edge_upper:.2f} mm; limited by {', '.join(b.limited_by) or 'nothing found'}; {b.guarantee}"
    return Found(b.edge, b.centre, b.edge, b.centre, note, extra={"box": b})


def concentric(case: Case) -> Found:
    """The largest box about the centre of the case's box whose nodes, and the case's, keep all limits."""
    k, v = case.kinematics, case.factors
    good = k.status == Status.CONVERGED
    with np.errstate(invalid="ignore"):
        good &= (v.sphere_min >= case.transmission[0]) & (v.sphere_max <= case.transmission[1])
        bounds = Bounds(case.machine, **(case.limits | {"transmission": None}))
        for limit in bounds.limits_of(k, case.positions):
            good &= limit.value <= limit.most
    centre, half = (case.low + case.high) / 2, (case.high - case.low) / 2
    share = (np.abs(case.positions - centre) / half).max(axis=1)
    kept = 1.0 if good.all() else float(share[~good].min())
    inner = share[good & (share < kept - 1e-9)] if kept < 1 or not good.all() else np.ones(1)
    edge = 2 * half[0] * (1.0 if good.all() else 0.5 * (kept + float(inner.max(initial=0.0))))
    return Found(float(edge), centre, note="about the centre, nodes only")


def mass(case: Case) -> Found:
    """All bodies that joints move."""
    need_masses(case.machine, "mass")
    return Found(moving_mass(case.machine), note=f"all bodies: {total_mass(case.machine):.4g} kg")


def frequency(case: Case) -> Found:
    """Over a coarse grid of the box, unloaded, drives held."""
    w = natural_frequencies(
        case.machine, case.coarse_positions, rotation=case.rotation, gravity=case.gravity, modes=1, threads=case.threads
    )  # fmt: skip
    return over_poses(case.coarse_positions, w.frequency[:, 0], "high")


def footprint(case: Case) -> Found:
    """Area in the base's xy plane of the frames of all bodies and joints."""
    k = drive_kinematics(case.machine, box_nodes(case.low, case.high, 2), case.rotation, threads=case.threads)
    if (k.status != Status.CONVERGED).any():
        return Found(float("nan"), note="a corner of the box is not within reach")
    points = np.concatenate([case.machine.compiled.frames(x)[0][1:] for x in k.coordinates])
    size = np.ptp(points, axis=0)
    return Found(float(size[0] * size[1]), note=f"{1e3 * size[0]:.0f} x {1e3 * size[1]:.0f} mm")


MEASURES = (
    Measure("largest_box", "edge of the largest box", "m", "high", edge, "mm", 1e3, order=5, apart=True),
    Measure("workspace", "volume of the workspace", "m^3", "high", volume, "m³", order=6, apart=True),
    Measure("mass", "moving mass", "kg", "low", mass, "kg", order=40),
    Measure("frequency", "first natural frequency", "Hz", "high", frequency, "Hz", order=42),
    Measure("footprint", "ground that the machine stands over", "m^2", "low", footprint, "m²", order=43),
)
