"""What makes an experiment unusable, and what it cannot tell."""

from __future__ import annotations

import numpy as np

from stiffmap.common.errors import StiffmapError
from stiffmap.experiment.experiment import WRENCH, Experiment, Floats
from stiffmap.experiment.noise.level import Noise
from stiffmap.experiment.poses.commanded import rows_in_words
from stiffmap.experiment.poses.handeye import SAME
from stiffmap.solve.machine import Machine

FEWEST = 6
"""Readings: as many as the parameters of the largest effect."""
NEARLY_ALL, BEYOND, FLAT = 0.99, 1.1, 0.1
"""Quantile of a load that counts as its largest; times that, from which more is commanded than is reached;
slope of the load over its command below which it no longer follows."""


def refuse(experiment: Experiment, base: Floats) -> None:
    """Raises StiffmapError for poses that the machine cannot reach, for places of another machine and for too few readings."""
    refuse_unreachable(experiment, base)
    for text in _elsewhere(experiment):
        raise StiffmapError(f"{experiment.name}: {text}")
    number = int(experiment.read.sum())
    if number < FEWEST:
        raise StiffmapError(
            f"{experiment.name}: {number} readings are fewer than the parameters of an effect "
            f"and its test need ({FEWEST})"
        )


def refuse_unreachable(experiment: Experiment, base: Floats) -> None:
    """Raises StiffmapError naming the rows whose readings `base` (n, c) has no prediction for."""
    failed = np.asarray((experiment.read & ~np.isfinite(base)).any(axis=1))
    if failed.any():
        text = rows_in_words(experiment, failed, "the machine has no equilibrium at")
        raise StiffmapError(f"{experiment.name}: {text}")


def limitations(experiment: Experiment, noise: Noise, machine: Machine) -> list[str]:
    """What the reader must know, in sentences."""
    e = experiment
    out = _elsewhere(e) + [f"left out: {told}" for told in e.out_of_reach]
    out += saturated(e)
    out += [*noise.coarse(), *(f"contradictory repeats: {c}" for c in noise.contradictions())]
    if int(e.read.sum()) < FEWEST:
        out.append(
            f"{int(e.read.sum())} readings show a residual, but are too few for a diagnosis ({FEWEST})"
        )
    if e.groups.max() == 0:
        out.append(
            "all rows are one pose: what changes over the workspace cannot be determined"
            + ("" if e.runs.max() > 0 else ", nothing is held out")
        )
    if not (noise.freedom > 0).any():
        out.append("no repeats: only the stated noise says how large it is")
    outside = _outside(e, machine)
    if outside:
        out.append(f"{outside} row{'s lie' if outside > 1 else ' lies'} outside the workspace of the file")
    if e.quantity == "deflection" and not e.branch:
        out.append("no branch column: friction is judged as if every load came from zero")
    return out + _inside_the_loop(e)


def _elsewhere(e: Experiment) -> list[str]:
    """That places do not follow the commands although frames were found to fit."""
    read = np.isfinite(e.reading[:, :3]).all(axis=1) & np.isfinite(e.position).all(axis=1)
    if e.frame == "known" or not e.registration or read.sum() < FEWEST:
        return []
    off = float(np.median(np.linalg.norm(e.reading[read, :3], axis=1)))
    reach = float(np.linalg.norm(e.position[read], axis=1).max())  # places in one socket hardly differ
    if not off > SAME * reach:
        return []
    return [
        f"the places read do not follow the commands: {1e3 * off:.0f} mm off in the median, of {1e3 * reach:.0f} mm from the base; look "
        "first at the machine's geometry (of a table of Denavit and Hartenberg its convention) and at order, signs, zeros and units of "
        "what was commanded"
    ]


def saturated(e: Experiment) -> list[str]:
    """Loads that stop growing while more is commanded, in sentences."""
    out = []
    for i, name in enumerate(WRENCH if e.asked is not None else ()):
        assert e.asked is not None
        asked, got = e.asked[:, i], e.wrench[:, i]
        known = np.isfinite(asked)
        reached = float(np.quantile(np.abs(got[known]), NEARLY_ALL)) if known.any() else 0.0
        beyond = known & (np.abs(asked) > BEYOND * reached)
        if reached == 0.0 or beyond.sum() < FEWEST or np.ptp(np.abs(asked[beyond])) == 0.0:
            continue
        grows = float(np.polyfit(np.abs(asked[beyond]), np.abs(got[beyond]), 1)[0])
        if grows < FLAT:
            unit = "N" if name[0] == "f" else "N·m"
            out.append(
                f"{name} saturates at ±{reached:.3g} {unit}: up to {np.nanmax(np.abs(asked)):.3g} {unit} is commanded "
                f"({int(beyond.sum())} rows beyond); the measured load is used"
            )
    return out


def _inside_the_loop(e: Experiment) -> list[str]:
    """What the metrology loop hides."""
    out = []
    if e.loop.instrument_on == "base":
        out.append("the instrument stands on the base: the base's compliance cannot be seen")
    elif e.loop.force_against == "base" and e.wrench.any():
        out.append("the force reacts on the base: the base's compliance cannot be seen")
    if e.loop.target_on == "platform":
        out.append("the target is on the platform: the tool holder's compliance cannot be seen")
    return out


def _outside(e: Experiment, machine: Machine) -> int:
    box = machine.description.workspace
    if box is None:
        return 0
    low, high = np.array(box)
    return int(((e.position < low - 1e-9) | (e.position > high + 1e-9)).any(axis=1).sum())
