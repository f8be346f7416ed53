"""The noise floor: the larger of what repeats show and what the instrument declares."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from stiffmap.common.errors import StiffmapError
from stiffmap.experiment.channels import Channel, metres
from stiffmap.experiment.experiment import Experiment, Floats

Mask = NDArray[np.bool_]
CONTRADICTION = 1e-4
ENOUGH = 5
"""Degrees of freedom of repeats that show the noise without a declaration."""


@dataclass(frozen=True, eq=False)
class Noise:
    """Per channel (c,), m or rad; NaN where it was not read or nothing is known."""

    channels: tuple[Channel, ...]

    declared: Floats
    """Root mean square of the declared standard deviations."""
    repeats: Floats
    """From readings of the same condition."""
    freedom: NDArray[np.intp]
    """Degrees of freedom of `repeats`."""
    consistency: Floats
    """p-value of repeats that differ at least this much from what is stated (two-sided chi-square)."""
    floor: Floats
    """The larger of the two."""
    sigma: Floats
    """(n, c) standard deviation of every reading, at the floor."""

    @property
    def rms(self) -> float:
        """Floor of the lengths together, m; NaN where none was read."""
        lengths = self.floor[metres(self.channels)]
        known = lengths[np.isfinite(lengths)]
        return float(np.sqrt(np.mean(known**2))) if known.size else float("nan")

    def contradictions(self) -> list[str]:
        """Axes whose repeats scatter more than the declaration allows, described in words."""
        return [
            f"{c.name}: repeats scatter by {s:.3g}, {d:.3g} stated (SI, p = {p:.1g})"
            for c, s, d, p in zip(self.channels, self.repeats, self.declared, self.consistency, strict=True)
            if p < CONTRADICTION and s > d
        ]


def noise_of(experiment: Experiment, keep: Mask | None = None) -> Noise:
    """Noise floor from the rows in `keep`; raises StiffmapError where nothing determines the noise."""
    rows = np.ones(len(experiment), bool) if keep is None else keep
    squares, freedom = _within(experiment, rows)
    with np.errstate(invalid="ignore", divide="ignore"):
        repeats = np.sqrt(squares / freedom)
        declared = np.sqrt(_mean(experiment.sigma**2))
        ratio = squares / declared**2
        lower = chi2.cdf(ratio, np.maximum(freedom, 1))
    p = np.where((freedom > 0) & (declared > 0), 2 * np.minimum(lower, 1 - lower), np.nan)
    floor = np.fmax(declared, np.where(freedom >= ENOUGH, repeats, np.nan))
    if lost := _lost(experiment, floor):
        raise StiffmapError(
            f"{experiment.name}: the noise of {', '.join(lost)} is zero or unknown; declare it (noise: in "
            f"experiment.yaml) or repeat readings at {ENOUGH} or more conditions"
        )
    factor = np.where(declared > 0, floor / np.where(declared > 0, declared, 1.0), np.nan)
    sigma = np.where(experiment.sigma > 0, experiment.sigma * factor, floor)
    return Noise(
        experiment.channels, declared, repeats, freedom, p, floor, np.where(experiment.read, sigma, np.nan)
    )


def unknown(experiment: Experiment) -> list[str]:
    """Channels of which neither a declaration nor repeats say how sure they are: `noise_of` refuses them."""
    squares, freedom = _within(experiment, np.ones(len(experiment), bool))
    return _lost(
        experiment, np.fmax(_mean(experiment.sigma**2), np.where(freedom >= ENOUGH, squares, np.nan))
    )


def _lost(experiment: Experiment, floor: Floats) -> list[str]:
    """Channels that were read and have no positive floor (c,)."""
    read = zip(experiment.channels, floor, experiment.axis_read, strict=True)
    return [c.name for c, f, any_ in read if any_ and not f > 0]


LOUD = 10.0
"""Times the declared noise: repeats that scatter by more were not taken as the declaration says."""


def contradictions(experiment: Experiment) -> list[str]:
    """Channels whose declared noise is far below what repeats of the same command and load show, in words.

    Coordinates in the instrument's own frame are compared as they are; no machine is needed.
    """
    e = experiment
    if e.seen is not None:
        reading = e.reading.copy()
        reading[:, :3] = np.where(np.isfinite(e.seen), e.seen, reading[:, :3])
        e = replace(e, reading=reading)
    words = [np.unique(w or [""] * len(e), return_inverse=True)[1] for w in (e.target, e.instrument, e.setup)]
    alike = np.unique(np.column_stack([e.conditions, *words]), axis=0, return_inverse=True)[1].reshape(-1)
    squares, freedom = _within(e, np.ones(len(e), bool), alike)
    repeats, declared = np.sqrt(squares / np.maximum(freedom, 1)), np.sqrt(_mean(e.sigma**2))
    return [
        f"the declared noise of {c.name} is {1e3 * d:.3g} {unit}, and readings of the same command and load scatter by "
        f"{1e3 * s:.3g} {unit}, {s / d:.2g} times as much: are they of one target, one set-up and one load?"
        for c, s, d, n in zip(e.channels, repeats, declared, freedom, strict=True)
        for unit in ("mm" if c.unit == "m" else "mrad",)
        if n > 0 and s > LOUD * d > 0
    ]


def against_the_load(experiment: Experiment) -> str:
    """What to say where most readings of a deflection go against a force along their own axis; empty where they do not.

    A machine yields along the force: another sign is one of the load's or of the readings'.
    """
    e = experiment
    alone = np.count_nonzero(e.wrench, axis=1) == 1
    work = e.wrench[:, :3] * np.where(np.isfinite(e.reading[:, :3]), e.reading[:, :3], 0.0)
    clear = (
        (np.abs(work) > 5.0 * np.abs(e.wrench[:, :3]) * np.nan_to_num(e.sigma[:, :3]))
        & alone[:, None]
        & (work != 0)
    )
    wrong = clear & (work < 0)
    if e.quantity != "deflection" or 2 * wrong.sum() <= clear.sum():
        return ""
    row, axis = np.argwhere(wrong)[0]
    return (
        f"{wrong.sum()} of {clear.sum()} readings go against their force (row {e.ids[row]}: {e.wrench[row, axis]:.4g} N along "
        f'{"xyz"[axis]} and {1e6 * e.reading[row, axis]:.4g} µm): give the other sign, as in --map "f{"xyz"[axis]}=-HEADER" or '
        "--difference target-minus-actual"
    )


def _mean(values: Floats) -> Floats:
    count = np.isfinite(values).sum(axis=0)
    return np.asarray(np.where(count > 0, np.nansum(values, axis=0) / np.maximum(count, 1), np.nan))


def _within(
    experiment: Experiment, rows: Mask, alike: NDArray[np.intp] | None = None
) -> tuple[Floats, NDArray[np.intp]]:
    """Sum of squares within conditions, and its degrees of freedom, per axis."""
    condition = experiment.conditions if alike is None else alike
    number = int(condition.max()) + 1
    read = experiment.read & rows[:, None]
    values = np.where(read, experiment.reading, 0.0)
    count = np.stack([np.bincount(condition, read[:, a], number) for a in range(read.shape[1])], axis=1)
    total = np.stack([np.bincount(condition, values[:, a], number) for a in range(read.shape[1])], axis=1)
    mean = total / np.maximum(count, 1)
    squares = np.where(read, (values - mean[condition]) ** 2, 0.0).sum(axis=0)
    return squares, np.maximum(count - 1, 0).sum(axis=0).astype(np.intp)
