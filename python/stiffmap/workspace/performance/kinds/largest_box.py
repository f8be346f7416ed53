"""First edge of the largest box of the required shape in the workspace, equation (3)."""

from __future__ import annotations

import numpy as np

from stiffmap.solve.status import Status
from stiffmap.workspace.performance.box.box import largest_box
from stiffmap.workspace.performance.limits.limits import Bounds
from stiffmap.workspace.performance.registry import Case, Found, Measure


def compute(case: Case) -> Found:
    """Anywhere; drive ranges, joint limits, the transmission range and the case's limits count."""
    if case.quick:
        return concentric(case)
    b = largest_box(
        case.machine, case.proportions, tolerance=case.gap, scheduler=case.scheduler, **case.limits
    )
    if b.edge == 0:
        return Found(
            0.0, note=f"no pose was found inside; broken: {', '.join(b.limited_by)}", extra={"box": b}
        )
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


MEASURE = Measure(
    "largest_box", "edge of the largest box", "m", "high", compute, "mm", 1e3, order=5, apart=True
)
