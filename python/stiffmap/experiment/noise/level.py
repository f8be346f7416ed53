"""The noise floor: the largest of what repeats show, what the instrument declares, and what the step of its readings leaves open."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtr

from stiffmap.common.broadcasting import Mask
from stiffmap.common.errors import StiffmapError
from stiffmap.experiment.channels import Channel, metres
from stiffmap.experiment.experiment import Experiment, Floats, Integers, numbered
from stiffmap.experiment.poses.handeye import ERROR, own_frame

CONTRADICTION = 1e-4
UNIFORM = 12.0**-0.5
"""Standard deviation of a number that is rounded, in steps."""
DIGITS, WHOLE = 1e-12, 1e-3
"""Of the largest reading, to which numbers are the same whatever their unit; of a step, to which a multiple is whole."""
ENOUGH = 5
"""Degrees of freedom of repeats that show the noise without a declaration; half as many as the readings that show a step."""


@dataclass(frozen=True, eq=False)
class Noise:
    """Per channel (c,), m or rad; NaN where it was not read or nothing is known."""

    channels: tuple[Channel, ...]

    declared: Floats
    """Root mean square of the declared standard deviations."""
    repeats: Floats
    """From readings of the same condition."""
    freedom: Integers
    """Degrees of freedom of `repeats`."""
    consistency: Floats
    """p-value of repeats that differ at least this much from what is stated (two-sided chi-square)."""
    floor: Floats
    """The larger of the two, or what the step leaves open."""
    sigma: Floats
    """(n, c) standard deviation of every reading, at the floor."""
    step: Floats
    """Step in which the readings are written; 0 where none shows."""

    @property
    def rms(self) -> float:
        """Floor of the lengths together, m; NaN where none was read."""
        return rms(self.floor[metres(self.channels)])

    def coarse(self) -> list[str]:
        """Channels that are written in steps too coarse for the declared noise, described in words."""
        return [
            f"{c.name} is read in steps of {1e3 * s:.3g} m{c.unit}: its noise is at least {1e3 * s * UNIFORM:.2g} m{c.unit}, whatever is stated"
            for c, s, d in zip(self.channels, self.step, self.declared, strict=True)
            if s * UNIFORM > d
        ]

    def contradictions(self) -> list[str]:
        """Axes whose repeats scatter more than the declaration allows, described in words."""
        return [
            f"{c.name}: repeats scatter by {s:.3g}, {d:.3g} stated (SI, p = {p:.1g})"
            for c, s, d, p in zip(self.channels, self.repeats, self.declared, self.consistency, strict=True)
            if p < CONTRADICTION and s > d
        ]


def rms(values: Floats) -> float:
    """Root mean square of what is finite; NaN of nothing."""
    good = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(good**2))) if good.size else float("nan")


def noise_of(experiment: Experiment, keep: Mask | None = None) -> Noise:
    """Noise floor from the rows in `keep`; raises StiffmapError where nothing determines the noise."""
    squares, freedom, declared = _within(experiment, keep)
    with np.errstate(invalid="ignore", divide="ignore"):
        repeats = np.sqrt(squares / freedom)
        lower = chdtr(np.maximum(freedom, 1), squares / declared**2)
    p = np.where((freedom > 0) & (declared > 0), 2 * np.minimum(lower, 1 - lower), np.nan)
    if lost := _unknown(experiment, squares, freedom, declared):
        raise StiffmapError(
            f"{experiment.name}: the noise of {', '.join(lost)} is zero or unknown; declare it (noise: in "
            f"experiment.yaml) or repeat readings at {ENOUGH} or more conditions"
        )
    step = np.array([_step(v[r]) for v, r in zip(experiment.reading.T, experiment.read.T, strict=True)])
    floor = np.fmax(declared, np.where(freedom >= ENOUGH, repeats, np.nan))
    rounding = UNIFORM * step
    floor = np.where(floor > 0, np.fmax(floor, rounding), floor)
    factor = np.where(declared > 0, floor / np.where(declared > 0, declared, 1.0), np.nan)
    sigma = experiment.sigma * factor
    np.copyto(sigma, floor, where=~(experiment.sigma > 0))
    sigma[~experiment.read] = np.nan
    many = sums(experiment.read, experiment.conditions)[experiment.conditions]
    shared = np.where(rounding > np.nan_to_num(repeats), rounding, 0.0)  # repeats are rounded alike
    sigma = np.sqrt(sigma**2 + np.maximum(many - 1, 0) * shared**2) if shared.any() else sigma
    return Noise(experiment.channels, declared, repeats, freedom, p, floor, sigma, step)


def _step(values: Floats) -> float:
    """The step of which all readings (n,) are whole multiples; 0 where there is none, or too few to show it."""
    most = float(np.abs(values).max(initial=0.0))
    known = np.unique(np.round(values / (DIGITS * most))) * DIGITS * most if most > 0.0 else values[:0]
    if len(known) < 3 or len(values) < 2 * ENOUGH:
        return 0.0
    size = float(np.ptp(known) / np.round(np.ptp(known) / np.diff(known).min()))
    return size if np.abs(known / size - np.round(known / size)).max() < WHOLE else 0.0


def unknown(experiment: Experiment, rows: Mask | None = None) -> list[str]:
    """Channels of which neither a declaration nor repeats, among rows (n,), say how sure they are: `noise_of` refuses them."""
    return _unknown(experiment, *_within(experiment, rows))


def _unknown(experiment: Experiment, squares: Floats, freedom: Integers, declared: Floats) -> list[str]:
    known = (declared > 0) | ((freedom >= ENOUGH) & (squares > 0))
    return [
        c.name for c, lost in zip(experiment.channels, experiment.axis_read & ~known, strict=True) if lost
    ]


LOUD = 10.0
"""Times the declared noise: repeats that scatter by more were not taken as the declaration says."""
SCATTER = 0.3
"""Times the root mean square of deflections: repeats without a declared noise that scatter by more are of different things."""


def contradictions(experiment: Experiment) -> list[str]:
    """Channels whose repeats of the same command and load scatter far beyond the declared noise or, without one, as deflections do; in words.

    Coordinates in the instrument's own frame are compared as they are; no machine is needed.
    """
    e = experiment
    if e.seen is not None:
        reading = e.reading.copy()
        reading[:, :3] = np.where(np.isfinite(e.seen), e.seen, reading[:, :3])
        e = replace(e, reading=reading)
    squares, freedom, declared = _within(e, None, numbered([e.conditions, e.target, e.instrument, e.setup]))
    repeats = np.sqrt(squares / np.maximum(freedom, 1))
    lengths, known = metres(e.channels), np.nan_to_num(declared) > 0
    size = [rms(e.reading[:, lengths == own]) if e.quantity == "deflection" else np.nan for own in lengths]
    return [
        f"{f'the declared noise of {c.name} is' if k else f'no noise of {c.name} is declared, deflections are'} {1e3 * d:.3g} {unit}, "
        f"and readings of the same command and load scatter by {1e3 * s:.3g} {unit}, {s / d:.2g} times as much: are they of one "
        "target, one set-up and one load?"
        for c, s, d, n, k in zip(
            e.channels, repeats, np.where(known, declared, size), freedom, known, strict=True
        )
        for unit in ("mm" if c.unit == "m" else "mrad",)
        if n > 0 and s > (LOUD if k else SCATTER) * d > 0
    ]


def no_difference(experiment: Experiment) -> str:
    """What to say where readings are as large as no difference is: they change along with the commanded places, as places that were
    seen do, or are in another unit; empty where they are differences."""
    e, at, read = experiment, experiment.position, experiment.reading[:, :3]
    same = np.ptp(read - at, axis=0) < 0.1 * np.ptp(at, axis=0)  # not where one of the two is NaN
    if e.seen is not None:
        return ""
    if same.any() or own_frame(read, at) is not None:
        names = ", ".join(c.name for c, s in zip(e.channels, same, strict=False) if s or not same.any())
        return f"{names} change as the commanded places do: places that were seen are no differences; --map px=HEADER (py, pz) takes them as they were seen, and --instrument tracker, where --map does not call them differences, takes what was commanded off"
    size = float(np.median(np.abs(read[np.isfinite(read)]))) if np.isfinite(read).any() else 0.0
    if e.quantity != "position" or size <= ERROR:
        return ""
    return f"half of the readings lie {1e3 * size:.4g} mm or more from what was commanded: are they differences, and in this unit?"


def not_at_zero(experiment: Experiment) -> str:
    """What to say where a deflection is read without a load; empty where none is, or where its zero is unknown."""
    e = experiment
    without = np.all(e.wrench == 0, axis=1, keepdims=True)
    idle = without & (np.abs(e.reading) > LOUD * np.nan_to_num(e.sigma, nan=np.inf))
    if e.quantity != "deflection" or e.unloaded == "unknown" or not idle.any():
        return ""
    row, axis = np.argwhere(idle)[0]
    read = f"{1e3 * e.reading[row, axis]:.4g} m{e.channels[axis].unit}"
    return (
        f"rows without a load do not read zero (row {e.ids[row]}: {e.channels[axis].name} {read}): where "
        "the gauge was not set to zero, write 'unloaded: unknown' into experiment.yaml, and the zero of each pose is fitted"
    )


def against_the_load(experiment: Experiment) -> str:
    """What to say where most readings of a deflection go against a force along their own axis; empty where they do not.

    A machine yields along the force: another sign is one of the load's or of the readings'.
    """
    e = experiment
    alone = np.count_nonzero(e.wrench, axis=1) == 1
    work = e.wrench[:, :3] * np.where(np.isfinite(e.reading[:, :3]), e.reading[:, :3], 0.0)
    unsure = 5.0 * np.abs(e.wrench[:, :3]) * np.nan_to_num(e.sigma[:, :3])
    clear = (np.abs(work) > unsure) & alone[:, None]
    wrong = clear & (work < 0)
    if e.quantity != "deflection" or 2 * wrong.sum() <= clear.sum():
        return ""
    row, axis = np.argwhere(wrong)[0]
    return (
        f"{wrong.sum()} of {clear.sum()} readings go against their force (row {e.ids[row]}: {e.wrench[row, axis]:.4g} N along "
        f'{"xyz"[axis]} and {1e6 * e.reading[row, axis]:.4g} µm): give the other sign, as in --map "f{"xyz"[axis]}=-HEADER" or '
        "--difference target-minus-actual"
    )


def sums(values: Floats | Mask, number: Integers) -> Floats:
    """(k, c) sums of values (n, c) over the rows of each number (n,)."""
    return np.stack([np.bincount(number, v) for v in values.T], axis=1)


def _within(
    experiment: Experiment, rows: Mask | None, alike: Integers | None = None
) -> tuple[Floats, Integers, Floats]:
    """Sum of squares of rows within conditions, its degrees of freedom, and the declared standard deviation, per axis."""
    condition = experiment.conditions if alike is None else alike
    read = experiment.read if rows is None else experiment.read & rows[:, None]
    values = np.where(read, experiment.reading, 0.0)
    count = sums(read, condition)
    mean = sums(values, condition) / np.maximum(count, 1)
    away = mean[condition]
    np.subtract(values, away, out=away, where=read)  # in place: rows may be millions
    away *= away
    squares = away.sum(axis=0, where=read)
    given = np.isfinite(experiment.sigma)
    stated = given.sum(axis=0)
    np.multiply(experiment.sigma, experiment.sigma, out=away)
    declared = np.sqrt(away.sum(axis=0, where=given) / np.where(stated > 0, stated, np.nan))
    return squares, np.maximum(count - 1, 0).sum(axis=0).astype(np.intp), declared
