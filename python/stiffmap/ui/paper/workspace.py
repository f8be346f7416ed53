"""§5.3, workspace analysis (Figure 7). The direction of the force is nowhere stated: four readings."""

from __future__ import annotations

import numpy as np
import xarray as xr

from stiffmap.ui.paper.results import Results
from stiffmap.ui.paper.statement import Statement, judge, of_section_5_3, rounds_to

Ranges = dict[str, dict[float, tuple[float, float]]]
READINGS = ("worst", "Fx", "Fy", "best")


def workspace_statements(results: Results) -> list[Statement]:
    """The error maps."""
    ranges: Ranges = {r: _ranges(reading(results.maps, r)) for r in READINGS}
    return [
        _varies(ranges),
        _zero_plane(ranges),
        _guaranteed(ranges, -0.2, "for z=-200 mm, guaranteed accuracy is only 0.4 mm", "0.4"),
        _guaranteed(ranges, 0.3, "and for z=300, 0.5 mm", "0.5"),
        _strongest(ranges),
        _three_times(results.maps),
    ]


def reading(maps: xr.Dataset, name: str) -> xr.DataArray:
    """Deflection in the plane (mm) under one reading of the force's direction."""
    extreme = name in ("worst", "best")
    values: xr.DataArray = maps[f"{name}_deflection_xy"] if extreme else maps.deflection_xy.sel(case=name)
    return values * 1e3


def _ranges(values: xr.DataArray) -> dict[float, tuple[float, float]]:
    return {float(z): (float(values.sel(z=z).min()), float(values.sel(z=z).max())) for z in values.z}


def _numbers(ranges: Ranges, z: float) -> dict[str, float]:
    return {f"{r}_{end}_mm": ranges[r][z][i] for r in READINGS for i, end in enumerate(("min", "max"))}


def _text(ranges: Ranges, z: float) -> str:
    return ", ".join(f"{r} {ranges[r][z][0]:.2f}–{ranges[r][z][1]:.2f}" for r in READINGS) + " mm"


def _varies(ranges: Ranges) -> Statement:
    low = min(ranges[r][z][0] for r in READINGS for z in (-0.2, 0.3))
    high = min(ranges[r][z][1] for r in ("worst", "Fx", "Fy") for z in (-0.2, 0.3))
    both = {f"z{1e3 * z:g}_{k}": v for z in (-0.2, 0.3) for k, v in _numbers(ranges, z).items()}
    return of_section_5_3(
        "the position accuracy … vary from 0,1 mm to more than 0.5 mm for z=-200 and z=300",
        f"z = -200: {_text(ranges, -0.2)}; z = 300: {_text(ranges, 0.3)}",
        judge(rounds_to(low, "0.1") and high > 0.5),
        "the upper end holds for the worst direction, Fx and Fy alike; values near 0.1 mm occur in the best "
        "direction and, at z = -200 and 300, for Fy",
        both,
        printed="0.1 mm to more than 0.5 mm",
    )


def _zero_plane(ranges: Ranges) -> Statement:
    satisfied = [r for r in READINGS if ranges[r][0.0][1] <= 0.25]
    return of_section_5_3(
        'The accuracy of the "zero plane" is satisfied for the operation',
        _text(ranges, 0.0),
        judge(set(satisfied) >= {"Fx", "Fy"}),
        "0.25 mm holds everywhere in the best direction only; the corner x = y = 300 exceeds it under Fx, "
        "Fy and the worst direction",
        _numbers(ranges, 0.0),
        printed="at most 0.25 mm (required)",
    )


def _guaranteed(ranges: Ranges, z: float, words: str, printed: str) -> Statement:
    fitting = [r for r in READINGS if rounds_to(ranges[r][z][1], printed)]
    return of_section_5_3(
        words,
        f"at most {', '.join(f'{r} {ranges[r][z][1]:.2f}' for r in READINGS)} mm",
        judge(bool(fitting)),
        f"no reading of the force's direction gives {printed} mm; the printed sentence before this one says "
        "more than 0.5 mm for the same plane"
        if not fitting
        else f"for the reading: {', '.join(fitting)}",
        _numbers(ranges, z),
        printed=f"{printed} mm",
    )


def _strongest(ranges: Ranges) -> Statement:
    top = {z: ranges["best"][z][1] for z in ranges["best"]}
    text = ", ".join(f"{v:.3f} mm (z = {1e3 * z:g})" for z, v in top.items())
    return of_section_5_3(
        "milling in the strongest direction of the manipulator leads to an accuracy more than 0,2 mm",
        f"at most {text}",
        judge(all(v <= 0.2 for v in top.values())),
        "read as better than 0.2 mm; holds at z = -200 and 0, not in the far corner of z = 300",
        {f"z{1e3 * z:g}_best_max_mm": v for z, v in top.items()},
        printed="better than 0.2 mm",
    )


def _three_times(maps: xr.Dataset) -> Statement:
    ratio = maps.worst_deflection_xy / maps.best_deflection_xy
    share = 100 * float((ratio > 3).mean())
    ends = [float(maps[f"{w}_deflection_xy"].max()) for w in ("worst", "best")]
    return of_section_5_3(
        "optimizing the milling process for the specialized Orthoglide manipulator may improve the "
        "accuracy more than 3 times",
        f"up to {float(ratio.max()):.1f} times, {float(np.median(ratio)):.2f} in the median",
        judge(float(ratio.max()) > 3),
        f"worst over best direction at the same position; more than 3 in {share:.0f} % of the positions. "
        f"The largest error of all falls {ends[0] / ends[1]:.2f} times",
        {
            "largest": float(ratio.max()),
            "median": float(np.median(ratio)),
            "share_above_3_percent": share,
            "largest_error_ratio": ends[0] / ends[1],
        },
        printed="more than 3 times",
    )
