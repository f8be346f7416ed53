"""Standard deviations of a map from those of the machine's numbers and of its identified links.

First order (the delta method): variance = J V J', with J the derivatives of the displacement with respect
to the uncertain numbers and V their covariance (docs/link.md §11).
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import chain

import numpy as np
import xarray as xr

from stiffmap.common.broadcasting import Floats, instance_of
from stiffmap.common.errors import StiffmapError
from stiffmap.common.short import first_of
from stiffmap.model.addresses import moved, number
from stiffmap.model.description import MachineDescription
from stiffmap.solve.machine import Machine

STEP = 2e-3  # of a number's size: truncation of a central difference is then about 1e-6
LINKS = "link_covariance"
"""Key of `MachineDescription.extra`: (file, full names of its springs, (21, 21) rows) per link file."""
UPPER = tuple((i, j) for i in range(6) for j in range(i, 6))
"""Order of the 21 entries of a symmetric 6x6 matrix: k11, k12, ... k66."""
METHOD = (
    "first order (delta method): J V J', derivatives by central differences through the equilibrium; "
    "all springs of one link file move together, numbers of the machine file are independent of each other"
)


@dataclass(frozen=True)
class Uncertain:
    """What is uncertain about a machine (P numbers), and the machines with one of them moved."""

    names: tuple[str, ...]
    covariance: Floats  # (P, P) SI
    steps: Floats  # (P,) SI
    machines: tuple[Machine, ...]  # (2P,): each number down, then up, by its step
    left_out: tuple[str, ...]
    """Uncertain numbers that a description does not keep apart, or that no map depends on."""


@dataclass(frozen=True)
class _Number:
    """One uncertain number: all its places move together."""

    name: str
    keys: tuple[str, ...]
    deviation: float
    size: float  # typical size (SI); 0: the deviation itself

    @property
    def step(self) -> float:
        return min(self.deviation, STEP * self.size) if self.size else self.deviation


def uncertain_numbers(machine: Machine) -> Uncertain:
    """The uncertain numbers of a machine.

    Raises StiffmapError where there are none that a map depends on.
    """
    d = machine.description
    links = [_link(d, *entry) for entry in dict(d.extra).get(LINKS, ())]
    plain = [_Number(k, (k,), u, abs(number(d, k) or 0.0)) for k, u in d.uncertainty if u > 0.0]
    kept = [n for n in plain if number(d, n.keys[0]) is not None]
    numbers = [*chain.from_iterable(n for n, _ in links), *kept]
    if not numbers:
        only = f" that a map depends on (only {first_of([n.name for n in plain])})" if plain else ""
        raise StiffmapError(
            f"uncertainty: the numbers of machine '{machine.name}' have none{only}: give some as "
            "{value: ..., u: ...} or springs as {link: file} (docs/machine_files.md)"
        )
    from scipy.linalg import block_diag

    blocks = [v for _, v in links] + [np.array([[n.deviation**2]]) for n in kept]
    return Uncertain(
        names=tuple(n.name for n in numbers),
        covariance=np.asarray(block_diag(*blocks)),
        steps=np.array([n.step for n in numbers]),
        machines=tuple(Machine(_at(d, n, s * n.step), like=machine) for n in numbers for s in (-1, 1)),
        left_out=tuple(n.name for n in plain if n not in kept),
    )


def _link(
    d: MachineDescription, file: str, springs: tuple[str, ...], rows: tuple[tuple[float, ...], ...]
) -> tuple[list[_Number], Floats]:
    """Entries of a link with a variance, and their covariance."""
    covariance = np.array(rows)
    found, kept = [], []
    for n, (i, j) in enumerate(UPPER):
        deviation = float(np.sqrt(covariance[n, n]))
        if deviation == 0.0:
            continue
        entry = f"k{i + 1}{j + 1}"
        ends = [number(d, f"{springs[0]}/compliance.k{a + 1}{a + 1}") for a in (i, j)]
        if None in ends:
            raise StiffmapError(f"uncertainty: spring {springs[0]} is no longer that of its link file {file}")
        size = float(np.sqrt((ends[0] or 0.0) * (ends[1] or 0.0)))
        keys = tuple(f"{s}/compliance.{entry}" for s in springs)
        found.append(_Number(f"{file} {entry}", keys, deviation, size))
        kept.append(n)
    return found, covariance[np.ix_(kept, kept)]


def _at(d: MachineDescription, n: _Number, delta: float) -> MachineDescription:
    for key in n.keys:
        changed = moved(d, key, delta)
        if changed is None:
            raise StiffmapError(f"uncertainty: machine '{d.name}' has no number {key}")
        d = changed
    return d


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
