"""§5.3, force size analysis (Figure 6)."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import xarray as xr

from stiffmap.ui.paper.results import Results
from stiffmap.ui.paper.statement import Statement, by_point, judge, of_section_5_3, rounds_to

LINEAR = 5.0
"""Percent: what a straight line in a printed figure can hide."""


def force_statements(results: Results) -> Iterator[Statement]:
    """Linearity, and the forces that the tolerance allows."""
    off = {n: max(nonlinearity(s) for s in sweeps.values()) for n, sweeps in results.sweeps.items()}
    yield of_section_5_3(
        "The force-deflection relationship for the force less than 1000 N is linear",
        f"off a straight line by at most {', '.join(f'{v:.2g}' for v in off.values())} % at the four points",
        judge(max(off.values()) < LINEAR),
        "largest distance from the slope of the first 25 N, relative to the deflection at 1000 N, over "
        "Fx, Fy, weakest and strongest "
        f"direction; less than the {LINEAR:g} % that a printed line can hide, but not zero",
        by_point("percent", off),
        printed="linear",
    )
    slope = {n: 1e6 * s["Fx"].compliance_along.values[0] for n, s in results.sweeps.items()}
    yield of_section_5_3(
        "… but depends on the manipulator configuration",
        f"{', '.join(f'{v:.3g}' for v in slope.values())} µm/N along x at the four points",
        judge(max(slope.values()) > 1.5 * min(slope.values())),
        "",
        by_point("um_per_N", slope),
        printed="it depends",
    )
    limits = {n: _limits(p, results.sweeps[n]) for n, p in results.points.items()}
    isotropic = limits.pop("isotropic")["worst"]
    yield of_section_5_3(
        "in the work point x=y=z=0, the required accuracy can be satisfied for the force up to 600 N",
        f"{isotropic:.1f} N",
        judge(rounds_to(isotropic, "600")),
        "0.25 mm in the plane, the same in every direction",
        {"limit_N": isotropic},
        printed="600 N",
    )
    text = [f"{n}: worst {v['worst']:.0f}, Fx {v['Fx']:.0f}, Fy {v['Fy']:.0f} N" for n, v in limits.items()]
    yield of_section_5_3(
        "while for all other tested workpoints, it can be satisfied only for forces inferior to 100 N",
        "; ".join(text),
        judge(all(v["worst"] < 100 for v in limits.values())),
        "true of x=y=z=300 in the worst direction only; at (-200, 300, 0) the machine is nearly as stiff "
        "as at the isotropic point",
        {f"{k}_N_{n.replace(' ', '_')}": v[k] for n, v in limits.items() for k in ("worst", "Fx", "Fy")},
        printed="less than 100 N",
    )
    points = max(1e3 * float(p.worst_deflection_xy) for p in results.points.values())
    planes, space = (1e3 * float(results.maps[f"worst_deflection{s}"].max()) for s in ("_xy", ""))
    yield of_section_5_3(
        "maximum compliance errors for the force 300 N may raise up to 1 mm and more",
        f"{points:.3f} mm at the four points, {planes:.3f} mm in the three planes",
        judge(max(planes, space) >= 1.0),
        "close to 1 mm, not more; the paper's own maps say 0.5 mm",
        {"points_mm": points, "planes_mm": planes, "planes_with_z_mm": space},
        printed="1 mm and more",
    )


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
