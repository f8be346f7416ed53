"""§5.3, workspace analysis (Figure 7). The direction of the force is nowhere stated: four readings."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import xarray as xr

from stiffmap.ui.paper.results import Results
from stiffmap.ui.paper.statement import Statement, judge, of_section_5_3, rounds_to

Ranges = dict[str, dict[float, tuple[float, float]]]
READINGS = ("worst", "Fx", "Fy", "best")


def workspace_statements(results: Results) -> Iterator[Statement]:
    """The error maps."""
    ranges: Ranges = {r: _ranges(reading(results.maps, r)) for r in READINGS}
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
    worst, best = results.maps.worst_deflection_xy, results.maps.best_deflection_xy
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
