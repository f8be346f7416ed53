"""§5.3, force size analysis (Figure 6)."""

from __future__ import annotations

import numpy as np
import xarray as xr

from stiffmap.ui.paper.results import Results
from stiffmap.ui.paper.statement import Statement, judge, of_section_5_3, rounds_to

LINEAR = 5.0
"""Percent: what a straight line in a printed figure can hide."""


def force_statements(results: Results) -> list[Statement]:
    """Linearity, and the forces that the tolerance allows."""
    limits = {n: _limits(p, results.sweeps[n]) for n, p in results.points.items()}
    return [_linear(results), _depends(results), _600(limits["isotropic"]), _100(limits), _1mm(results)]


def nonlinearity(swp: xr.Dataset) -> float:
    """Largest distance of the deflection from its initial slope, in percent of that line's end."""
    force, value = swp.force.values, swp.deflection_xy.values
    tangent = value[1] / force[1] * force
    return float(100 * np.abs(value - tangent).max() / tangent[-1])


def _limits(point: xr.Dataset, sweeps: dict[str, xr.Dataset]) -> dict[str, float]:
    out = {"worst": float(point.force_limit_xy)}
    for name, swp in sweeps.items():
        if name != "worst":
            reached = swp.deflection_xy.values[-1] >= 0.25e-3
            out[name] = float(np.interp(0.25e-3, swp.deflection_xy, swp.force)) if reached else np.inf
    return out


def _linear(results: Results) -> Statement:
    off = {n: max(nonlinearity(s) for s in sweeps.values()) for n, sweeps in results.sweeps.items()}
    text = ", ".join(f"{v:.2g}" for v in off.values())
    return of_section_5_3(
        "The force-deflection relationship for the force less than 1000 N is linear",
        f"off a straight line by at most {text} % at the four points",
        judge(max(off.values()) < LINEAR),
        "largest distance from the slope of the first 25 N, relative to the deflection at 1000 N, over "
        "Fx, Fy, weakest and strongest "
        f"direction; less than the {LINEAR:g} % that a printed line can hide, but not zero",
        {f"percent_{n.replace(' ', '_')}": v for n, v in off.items()},
        printed="linear",
    )


def _depends(results: Results) -> Statement:
    slope = {n: 1e6 * s["Fx"].compliance_along.values[0] for n, s in results.sweeps.items()}
    text = ", ".join(f"{v:.3g}" for v in slope.values())
    return of_section_5_3(
        "… but depends on the manipulator configuration",
        f"{text} µm/N along x at the four points",
        judge(max(slope.values()) > 1.5 * min(slope.values())),
        "",
        {f"um_per_N_{n.replace(' ', '_')}": float(v) for n, v in slope.items()},
        printed="it depends",
    )


def _600(limits: dict[str, float]) -> Statement:
    return of_section_5_3(
        "in the work point x=y=z=0, the required accuracy can be satisfied for the force up to 600 N",
        f"{limits['worst']:.1f} N",
        judge(rounds_to(limits["worst"], "600")),
        "0.25 mm in the plane, the same in every direction",
        {"limit_N": limits["worst"]},
        printed="600 N",
    )


def _100(limits: dict[str, dict[str, float]]) -> Statement:
    others = {n: v for n, v in limits.items() if n != "isotropic"}
    text = "; ".join(
        f"{n}: worst {v['worst']:.0f}, Fx {v['Fx']:.0f}, Fy {v['Fy']:.0f} N" for n, v in others.items()
    )
    return of_section_5_3(
        "while for all other tested workpoints, it can be satisfied only for forces inferior to 100 N",
        text,
        judge(all(v["worst"] < 100 for v in others.values())),
        "true of x=y=z=300 in the worst direction only; at (-200, 300, 0) the machine is nearly as stiff "
        "as at the isotropic point",
        {
            f"{k}_N_{n.replace(' ', '_')}": x
            for n, v in others.items()
            for k, x in v.items()
            if k in ("worst", "Fx", "Fy")
        },
        printed="less than 100 N",
    )


def _1mm(results: Results) -> Statement:
    points = max(1e3 * float(p.worst_deflection_xy) for p in results.points.values())
    planes, space = (1e3 * float(results.maps[f"worst_deflection{s}"].max()) for s in ("_xy", ""))
    return of_section_5_3(
        "maximum compliance errors for the force 300 N may raise up to 1 mm and more",
        f"{points:.3f} mm at the four points, {planes:.3f} mm in the three planes",
        judge(max(planes, space) >= 1.0),
        "close to 1 mm, not more; the paper's own maps say 0.5 mm",
        {"points_mm": points, "planes_mm": planes, "planes_with_z_mm": space},
        printed="1 mm and more",
    )
