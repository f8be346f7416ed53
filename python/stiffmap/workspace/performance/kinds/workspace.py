"""Volume of the workspace in the orientation of the case."""

from __future__ import annotations

from stiffmap.common.errors import StiffmapError
from stiffmap.workspace.performance.registry import Case, Found, Measure

CELLS, QUICK = 12, 6


def compute(case: Case) -> Found:
    """Reach, drive ranges, joint limits, the transmission range, singularities and the case's limits count."""
    from stiffmap.workspace.performance.box.workspace import workspace_volume

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


MEASURE = Measure("workspace", "volume of the workspace", "m^3", "high", compute, "m³", order=6, apart=True)
