"""§5.3, force size analysis (Figure 6) and workspace analysis (Figure 7). The direction of the force is nowhere stated in the latter:
four readings."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import xarray as xr

from stiffmap.ui.paper.results import Results
from stiffmap.ui.paper.statement import Statement, by_point, judge, of_section_5_3, rounds_to
from stiffmap.workspace.maps.summary import readings, values_of

LINEAR = 5.0  # percent: what a straight line in a printed figure can hide


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


Ranges = dict[str, dict[float, tuple[float, float]]]
READINGS = ("worst", "Fx", "Fy", "best")


def workspace_statements(results: Results) -> Iterator[Statement]:
    """The error maps."""
    maps = results.maps
    ranges: Ranges = {n: _ranges(1e3 * values_of(maps, how)) for n, how in readings(maps, "xy").items()}
    outer = (-0.2, 0.3)
    low = min(ranges[r][z][0] for r in READINGS for z in outer)
    high = min(ranges[r][z][1] for r in ("worst", "Fx", "Fy") for z in outer)
    yield of_section_5_3(
        "the position accuracy … vary from 0,1 mm to more than 0.5 mm for z=-200 and z=300",
        f"z = -200: {_text(ranges, -0.2)}; z = 300: {_text(ranges, 0.3)}",
        judge(rounds_to(low, "0.1") and high > 0.5),
        "the upper end holds for the worst direction, Fx and Fy alike; values near 0.1 mm occur in the best "
        "direction and, at z = -200 and 300, for Fy",
        {f"z{1e3 * z:g}_{k}": v for z in outer for k, v in _numbers(ranges, z).items()},
        printed="0.1 mm to more than 0.5 mm",
    )
    yield of_section_5_3(
        'The accuracy of the "zero plane" is satisfied for the operation',
        _text(ranges, 0.0),
        judge(all(ranges[r][0.0][1] <= 0.25 for r in ("Fx", "Fy"))),
        "0.25 mm holds everywhere in the best direction only; the corner x = y = 300 exceeds it under Fx, "
        "Fy and the worst direction",
        _numbers(ranges, 0.0),
        printed="at most 0.25 mm (required)",
    )
    for z, words, printed in (
        (-0.2, "for z=-200 mm, guaranteed accuracy is only 0.4 mm", "0.4"),
        (0.3, "and for z=300, 0.5 mm", "0.5"),
    ):
        fitting = [r for r in READINGS if rounds_to(ranges[r][z][1], printed)]
        yield of_section_5_3(
            words,
            f"at most {', '.join(f'{r} {ranges[r][z][1]:.2f}' for r in READINGS)} mm",
            judge(bool(fitting)),
            f"for the reading: {', '.join(fitting)}"
            if fitting
            else f"no reading of the force's direction gives {printed} mm; the printed sentence before this "
            "one says more than 0.5 mm for the same plane",
            _numbers(ranges, z),
            printed=f"{printed} mm",
        )
    top = {z: high for z, (_, high) in ranges["best"].items()}
    yield of_section_5_3(
        "milling in the strongest direction of the manipulator leads to an accuracy more than 0,2 mm",
        f"at most {', '.join(f'{v:.3f} mm (z = {1e3 * z:g})' for z, v in top.items())}",
        judge(all(v <= 0.2 for v in top.values())),
        "read as better than 0.2 mm; holds at z = -200 and 0, not in the far corner of z = 300",
        {f"z{1e3 * z:g}_best_max_mm": v for z, v in top.items()},
        printed="better than 0.2 mm",
    )
    worst, best = maps.worst_deflection_xy, maps.best_deflection_xy
    ratio, of_largest = worst / best, float(worst.max() / best.max())
    largest, median, share = float(ratio.max()), float(np.median(ratio)), 100 * float((ratio > 3).mean())
    yield of_section_5_3(
        "optimizing the milling process for the specialized Orthoglide manipulator may improve the "
        "accuracy more than 3 times",
        f"up to {largest:.1f} times, {median:.2f} in the median",
        judge(largest > 3),
        f"worst over best direction at the same position; more than 3 in {share:.0f} % of the positions. "
        f"The largest error of all falls {of_largest:.2f} times",
        {
            "largest": largest,
            "median": median,
            "share_above_3_percent": share,
            "largest_error_ratio": of_largest,
        },
        printed="more than 3 times",
    )


def _ranges(values: xr.DataArray) -> dict[float, tuple[float, float]]:
    return {float(z): (float(values.sel(z=z).min()), float(values.sel(z=z).max())) for z in values.z}


def _numbers(ranges: Ranges, z: float) -> dict[str, float]:
    return {f"{r}_{end}_mm": ranges[r][z][i] for r in READINGS for i, end in enumerate(("min", "max"))}


def _text(ranges: Ranges, z: float) -> str:
    return ", ".join(f"{r} {ranges[r][z][0]:.2f}–{ranges[r][z][1]:.2f}" for r in READINGS) + " mm"
