"""`stiffmap.uncertainty_ranking`."""

from __future__ import annotations

import xarray as xr

from stiffmap.common.broadcasting import instance_of
from stiffmap.common.errors import StiffmapError


def uncertainty_ranking(ds: xr.Dataset) -> xr.DataArray:
    """Which numbers the uncertainty of an error map comes from, the largest first.

    Returns (parameter,): share of each in the variance of the deflection, summed over all poses and load
    cases of the map. They sum to 1; correlated numbers divide what they share, so one may be negative.

    Raises StiffmapError for a map made without ``uncertainty=True``.
    """
    if "variance_share" not in instance_of(ds, xr.Dataset, "ds", "an error map"):
        raise StiffmapError("ranking: the map has none; it needs error_map(..., uncertainty=True)")
    weight = ds.deflection_std**2
    over = list(weight.dims)
    share: xr.DataArray = (ds.variance_share * weight).sum(over) / weight.sum(over)
    share.attrs = {"units": "1", "long_name": "share of the variance of the deflection over the map"}
    ranked: xr.DataArray = share.sortby(-share).rename("variance_share")
    return ranked
