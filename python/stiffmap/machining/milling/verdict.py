"""Sizes of errors, and the verdict in words."""

from __future__ import annotations

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from stiffmap.machining.milling.limits import BROKEN
from stiffmap.solve.status import Status


def sizes(values: ArrayLike) -> dict[str, float]:
    """rms and largest size of errors (m), in mm; points without an answer do not count."""
    v = np.asarray(values, dtype=float)
    v = v[np.isfinite(v)]
    if not v.size:
        return {"rms": float("nan"), "largest": float("nan")}
    return {"rms": float(1e3 * np.sqrt((v**2).mean())), "largest": float(1e3 * np.abs(v).max())}


def verdict(ds: xr.Dataset) -> str:
    """One sentence."""
    bad = int((ds.status.values != Status.CONVERGED).sum())
    if (ds.status.values == Status.UNSTABLE).any():
        return f"The cut runs away at {int((ds.status.values == Status.UNSTABLE).sum())} points: the force grows faster than the machine resists."
    if bad:
        return f"{bad} of {ds.sizes['point']} points have no equilibrium."
    b, a = sizes(ds.error_normal), sizes(ds.error_normal_after)
    lost = int((~np.isfinite(ds.error_normal_after.values)).sum())
    if lost:
        return (
            f"The part is off by {b['largest']:.3f} mm at most. With the compensated program {lost} of {ds.sizes['point']} points have "
            "no equilibrium."
        )
    text = f"The part is off by {b['largest']:.3f} mm at most; with the compensated program by {a['largest']:.4f} mm."
    flags = ds.flags.values | ds.flags_after.values
    over = [name for name, flag in BROKEN.items() if (flags & flag).any()]
    end = f" Limits are broken: {', '.join(over)}." if over else ""
    if "tolerance" not in ds.attrs:
        return text + end
    t = 1e3 * ds.attrs["tolerance"]
    words = [("within" if v["largest"] <= t else "beyond") for v in (b, a)]
    return f"{text} The tolerance is {t:g} mm: {words[0]} it as it is, {words[1]} it compensated.{end}"
