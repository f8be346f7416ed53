"""Sizes of errors, and the verdict in words."""

from __future__ import annotations

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from stiffmap.solve.status import Status


def sizes(values: ArrayLike) -> dict[str, float]:
    """rms and largest size of errors (m), in mm; points without an answer do not count."""
    v = np.asarray(values, dtype=float)
    v = v[np.isfinite(v)]
    if not v.size:
        return {"rms": float("nan"), "largest": float("nan")}
    return {"rms": float(1e3 * np.sqrt((v**2).mean())), "largest": float(1e3 * np.abs(v).max())}


def verdict(ds: xr.Dataset) -> str:
    """The worst of what was found comes first: no equilibrium, chatter, broken limits, errors."""
    states, points = ds.status.values, ds.sizes["point"]
    told = []
    away, bad = int((states == Status.UNSTABLE).sum()), int((states != Status.CONVERGED).sum())
    if away:
        told.append(f"The cut runs away at {away} points: the force grows faster than the machine resists.")
    elif bad:
        told.append(f"{bad} of {points} points have no equilibrium.")
    if "multiplier" in ds and (ds.multiplier.values > 1).any():
        told.append(f"{ds.multiplier.attrs['said']} The errors are those of a cut without chatter.")
    names = ds.warnings.attrs["names"] if "warnings" in ds else []
    over = [n for n in names if n not in ("chatter", "declared workspace", "outside corner")]
    if over:
        told.append(f"Limits are broken: {', '.join(over)}.")
    if bad:
        return " ".join(told)
    b, a = sizes(ds.error_normal), sizes(ds.error_normal_after)
    lost = int((~np.isfinite(ds.error_normal_after.values)).sum())
    told.append(f"The part is off by {b['largest']:.3f} mm at most; with the compensated program ")
    if lost:
        told[-1] += f"{lost} of {points} points have no equilibrium."
        return " ".join([told.pop(), *told])
    told[-1] += f"by {a['largest']:.4f} mm."
    if "tolerance" in ds.attrs:
        t = 1e3 * ds.attrs["tolerance"]
        words = [("within" if v["largest"] <= t else "beyond") for v in (b, a)]
        told.append(f"The tolerance is {t:g} mm: {words[0]} it as it is, {words[1]} it compensated.")
    return " ".join(told)
