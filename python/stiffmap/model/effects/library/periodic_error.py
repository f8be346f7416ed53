"""Periodic error of a screw or gear: amplitude, period and phase, of which two are unknown without it."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from stiffmap.common.broadcasting import Floats
from stiffmap.model.description import AppliedEffect, CommandError
from stiffmap.model.effects.evidence import Periods, Probe, Signature, Tried
from stiffmap.model.effects.library.command import of_command
from stiffmap.model.effects.types import EffectType, Parameter, Placed

SHORTEST = 2e-3
PER_WIDTH = 2.5  # periods tried per resolvable frequency
PARAMETERS = (
    Parameter("amplitude", "m", 0.0, 0.01, 0.0, 1e-5, "half of peak to peak", angular="rad"),
    Parameter("period", "m", 1e-5, 10.0, None, 0.01, "travel after which the error repeats", angular="rad"),
    Parameter(
        "phase",
        "rad",
        -2 * math.pi,
        2 * math.pi,
        None,
        1.0,
        "of the sine at the home coordinate",
        default=0.0,
    ),
)


def wave(placed: Placed) -> CommandError:
    """amplitude sin(2 pi (u - home) / period + phase)."""
    a, period, phase = (placed.values[n] for n in ("amplitude", "period", "phase"))
    return CommandError(amplitude=a, period=period, phase=phase, reference=None)


def signature(probe: Probe, tried: Tried) -> Iterator[Signature]:
    """For every period worth trying two columns, sine and cosine.

    To first order the reading changes by that of a zero offset times sin(2 pi (u - home)/period + phase), u the
    commanded coordinate.
    """
    scale = tried.parameters[0].scale
    legs = tried.legs or ("",)  # none: a drive before or behind the legs
    travel = {leg: probe.coordinate(tried.element, leg) for leg in legs}
    each = {leg: _offset(probe, tried.element, leg) * scale for leg in legs}
    if not max(float(np.nanmax(np.abs(c))) for c in each.values()) > 0.0:
        return
    reach = max(float(np.ptp(u)) for u in travel.values())

    def start(strengths: Floats) -> dict[str, float]:
        sine, cosine = strengths
        return {"amplitude": float(np.hypot(sine, cosine)) * scale, "phase": float(np.arctan2(cosine, sine))}

    tried_ones = frequencies(reach, next(iter(travel.values())))
    periods = Periods(list(travel.values()), [each[g] for g in legs], tried_ones)
    for k, frequency in enumerate(tried_ones):
        yield Signature({"period": 1.0 / frequency}, None, start, period=(periods, k))


def frequencies(reach: float, travel: Floats) -> Floats:
    """From half a period in the travel up to what the number of poses can hold apart."""
    if reach <= 0.0:
        return np.zeros(0)
    highest = min(1.0 / SHORTEST, len(np.unique(np.round(travel, 9))) * 1.5 / reach)
    return np.arange(0.5 / reach, highest, 1.0 / (PER_WIDTH * reach))


def _offset(probe: Probe, element: str, leg: str) -> Floats:
    """(n, c) change of the readings per unit of a zero offset of one drive."""
    step = 1e-5
    return (
        probe.change(AppliedEffect("zero_offset", element, (leg,) if leg else (), (("error", step),))) / step
    )


EFFECT = EffectType(
    kind="periodic_error",
    precedence=110,
    title="periodic error of a screw or gear",
    doc=(
        "The drive stands amplitude·sin(2π(u - u_home)/period + phase) further than commanded at the "
        "coordinate u."
    ),
    parameters=PARAMETERS,
    **of_command(wave),
    signature=signature,
    pivot="the drive's home coordinate",
)
