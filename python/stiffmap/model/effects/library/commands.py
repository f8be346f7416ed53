"""Errors of a commanded coordinate, and of the guide along which it runs."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np

from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import StiffmapError
from stiffmap.model.description import AppliedEffect, Cable, CommandError, GuideError, Joint
from stiffmap.model.description.tree import Elements
from stiffmap.model.effects.edit import Sites
from stiffmap.model.effects.evidence import Periods, Probe, Signature, Tried
from stiffmap.model.effects.sites import at_sites, drives, each, guides
from stiffmap.model.effects.types import EffectType, Option, Parameter, Placed


def of_command(error: Callable[[Placed], CommandError], sites: Sites = drives) -> dict[str, Any]:
    """What effects share that add an error to the commands of drives, which `sites` name."""

    def with_error(e: Joint, placed: Placed) -> Elements:
        return (replace(e, command_errors=(*e.command_errors, error(placed))),)

    return {**each(sites, with_error), "frame": "the drive's axis", "moves": "all that the drive carries"}


ZERO_OFFSET = EffectType(
    kind="zero_offset",
    title="zero of a drive",
    doc="The drive stands `error` further along (or about) its axis than commanded, at every stroke.",
    parameters=(
        Parameter("error", "m", -0.1, 0.1, 0.0, 1e-4, "added to the commanded coordinate", angular="rad"),
    ),
    **of_command(lambda placed: CommandError(offset=placed.values["error"])),
)


LEAD_ERROR = EffectType(
    kind="lead_error",
    title="lead error of a drive",
    doc="The drive travels `slope` more per unit of commanded travel; no error at its home coordinate.",
    parameters=(
        Parameter(
            "slope", "m/m", -0.1, 0.1, 0.0, 1e-4, "error per commanded travel from home", angular="rad/rad"
        ),
    ),
    **of_command(lambda placed: CommandError(slope=placed.values["slope"], reference=None)),
    pivot="the drive's home coordinate",
)


SHORTEST = 2e-3
PER_WIDTH = 2.5  # periods tried per resolvable frequency
IN_STEP = 0.85
"""Mean of the waves' pointers over the poses from which on these stand in steps of a period."""
WAVE = (
    Parameter("amplitude", "m", 0.0, 0.01, 0.0, 1e-5, "half of peak to peak", angular="rad"),
    Parameter("period", "m", 1e-5, 10.0, None, 0.01, "travel after which the error repeats", angular="rad"),
    Parameter(
        "phase", "rad", -2 * math.pi, 2 * math.pi, None, 1.0, "of the sine at the home coordinate",
        default=0.0,
    ),
)  # fmt: skip


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
        yield Signature({"period": 1.0 / frequency}, None, start, one_of=(periods, k))


def frequencies(reach: float, travel: Floats) -> Floats:
    """From half a period in the travel up to what the number of poses can hold apart; where these stand in equal steps, to half a
    period in each: shorter ones show what longer ones do."""
    if reach <= 0.0:
        return np.zeros(0)
    once = np.unique(np.round(travel, 9))
    highest = min(1.0 / SHORTEST, len(once) * 1.5 / reach)
    tried = np.arange(0.5 / reach, 2.0 * highest, 1.0 / (PER_WIDTH * reach))
    alike = np.abs(np.mean(np.exp(2j * np.pi * np.outer(tried, once)), axis=1)) > IN_STEP
    repeats = tried[alike & (tried > 0.75 / reach)]
    return np.asarray(tried[tried < min([highest, *0.5 * (repeats[:1] + 1.0 / reach)])])


def _offset(probe: Probe, element: str, leg: str) -> Floats:
    """(n, c) change of the readings per unit of a zero offset of one drive."""
    step = 1e-5
    return (
        probe.change(AppliedEffect("zero_offset", element, (leg,) if leg else (), (("error", step),))) / step
    )


PERIODIC_ERROR = EffectType(
    kind="periodic_error",
    title="periodic error of a screw or gear",
    doc=(
        "The drive stands amplitude·sin(2π(u - u_home)/period + phase) further than commanded at the "
        "coordinate u."
    ),
    parameters=WAVE,
    **of_command(wave),
    signature=signature,
    pivot="the drive's home coordinate",
)


ACROSS = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
AMPLITUDE, PERIOD, PHASE = WAVE
DEVIATION = (
    replace(AMPLITUDE, doc="largest deviation", angular=""),
    replace(PERIOD, scale=1.0, doc="travel after which the deviation repeats", angular=""),
    PHASE,
)


def bent(e: Joint, placed: Placed) -> Elements:
    """One harmonic of the deviation, on each guide of the place."""
    axis = ACROSS[placed.options["across"]]
    along = sum(a * b for a, b in zip(axis, e.axes[0], strict=True))
    if abs(along) > 1e-9:
        raise StiffmapError(f"across={placed.options['across']} is not across the guide {e.axes[0]}")
    error = GuideError(axis, wave(placed))
    return (replace(e, guide_errors=(*e.guide_errors, error)),)


STRAIGHTNESS = EffectType(
    kind="straightness",
    title="straightness of a guide",
    doc=(
        "The carriage stands amplitude·sin(2π(u - u_home)/period + phase) off its guide at the commanded coordinate u, "
        "along the axis `across` of the guide's frame. One harmonic of the deviation; several add up. A bow over a "
        "stroke s is the half wave period = 2s."
    ),
    parameters=DEVIATION,
    **each(guides, bent),
    pivot="the drive's home coordinate",
    frame="axes of the guide before it moves",
    moves="all that the drive carries, without turning",
    options=(Option("across", ("y", "z", "x"), "direction of the deviation, at right angles to the guide"),),
    stage=5,
    tried=lambda description: [],
)


PER_TURN = Parameter(
    "per_turn", "m", -0.1, 0.1, 0.0, 1e-4,
    "how much further the drive stands per turn of the other joint from home",
    angular="rad", angular_upper=2.0 * math.pi,
)  # fmt: skip
PARALLEL = 1e-6
"""Sine of the angle between a screw and the joint that turns it."""


def pairs(elements: Elements) -> dict[str, tuple[int, ...]]:
    """Each actuated joint with each other joint of its sequence that turns about one axis: ``j3.j2``."""
    driven = {i: e for i, e in enumerate(elements) if isinstance(e, Joint) and e.actuated}
    drives = [(i, e) for i, e in driven.items() if not isinstance(e, Cable)]
    turning = [e for e in elements if isinstance(e, Joint) and e.kind == "revolute" and len(e.axes) == 1]
    return {f"{e.name}.{o.name}": (i,) for i, e in drives for o in turning if o.name != e.name}


def likely(elements: Elements) -> dict[str, tuple[int, ...]]:
    """Of these, a drive that turns with the drive before it, and one that slides along the axis of a passive joint at its side, which
    no ball joint leaves free to spin."""
    out, found = {}, pairs(elements)
    joints = [e for e in elements if isinstance(e, Joint)]
    for before, after in pairwise(joints):
        names = [f"{after.name}.{before.name}", f"{before.name}.{after.name}"]
        if before.actuated and after.actuated and after.kind == "revolute":
            out.update({n: found[n] for n in names[:1] if n in found})
        elif (
            max(len(j.axes) for j in joints) < 3
            and np.linalg.norm(np.cross(before.axes[0], after.axes[0])) < PARALLEL
        ):
            sliding = [j.actuated and j.kind == "prismatic" for j in (after, before)]
            out.update({n: found[n] for n, s in zip(names, sliding, strict=True) if s and n in found})
    return out


def coupled(placed: Placed) -> CommandError:
    """A command error that grows with the other joint's coordinate."""
    slope = placed.values["per_turn"] / (2.0 * math.pi)
    return CommandError(slope=slope, reference=None, of=placed.element.partition(".")[2])


JOINT_COUPLING = EffectType(
    kind="joint_coupling",
    title="coupling of a drive to another joint",
    doc=(
        "The drive stands `per_turn` further for each turn of the other joint away from home, at `j3.j2` the drive j3 by "
        "the joint j2, in the closed configuration without load: gears of a wrist, a linkage that carries a joint along, a "
        "screw that turns with its universal joint."
    ),
    parameters=(PER_TURN,),
    **of_command(coupled, pairs),
    tried=at_sites(likely),
    pivot="home coordinate of the other joint",
)
