"""A drive that moves with another joint: gears of a wrist, a screw that turns with its universal joint."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np

from stiffmap.model.description import Cable, CommandError, Joint
from stiffmap.model.description.tree import Elements
from stiffmap.model.effects.library.command import of_command
from stiffmap.model.effects.sites import at_sites
from stiffmap.model.effects.types import EffectType, Parameter, Placed

PER_TURN = Parameter(
    "per_turn",
    "m",
    -0.1,
    0.1,
    0.0,
    1e-4,
    "how much further the drive stands per turn of the other joint from home",
    angular="rad",
    angular_upper=2.0 * math.pi,
)
PARALLEL = 1e-6
"""Sine of the angle between a screw and the joint that turns it."""


def pairs(elements: Elements) -> dict[str, tuple[int, ...]]:
    """Each actuated joint with each other joint of its sequence that turns about one axis: ``j3.j2``."""
    drives = [(i, e) for i, e in enumerate(elements) if isinstance(e, Joint) and e.actuated]
    turning = [e for e in elements if isinstance(e, Joint) and _turns(e)]
    return {
        f"{e.name}.{o.name}": (i,)
        for i, e in drives
        if not isinstance(e, Cable)
        for o in turning
        if o.name != e.name
    }


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


def _turns(e: Joint) -> bool:
    return e.kind == "revolute" and len(e.axes) == 1


def coupled(placed: Placed) -> CommandError:
    """A command error that grows with the other joint's coordinate."""
    slope = placed.values["per_turn"] / (2.0 * math.pi)
    return CommandError(slope=slope, reference=None, of=placed.element.partition(".")[2])


EFFECT = EffectType(
    kind="joint_coupling",
    precedence=115,
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
