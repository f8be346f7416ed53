"""Parallelism of the two pins at one end of a parallelogram."""

from __future__ import annotations

from dataclasses import replace

from stiffmap.model.description import Block, Branch, Joint, Pose
from stiffmap.model.effects.edit import built, splice
from stiffmap.model.effects.library.bars import on_branches
from stiffmap.model.effects.library.geometry import rotation_of, rotations
from stiffmap.model.effects.types import EffectType, Option, Placed


def turned(block: Block, b: Branch, share: float, placed: Placed) -> Branch:
    """Half of the angle on each pin; only the pins' directions change."""
    pins = [i for i, e in enumerate(b.elements) if isinstance(e, Joint) and not e.actuated]
    i = pins[0] if placed.options["end"] == "proximal" else pins[-1]
    e = b.elements[i]
    turn = Pose.of(rotation=rotation_of(placed.values, share))
    name = f"{e.name}_parallelism"
    piece = (built(name, turn), e, built(f"{name}_back", turn.inverse()))
    return replace(b, elements=splice(b.elements, i, piece))


EFFECT = EffectType(
    kind="parallelogram_parallelism",
    precedence=210,
    title="parallelism of a parallelogram's pins",
    doc=(
        "The axes of the two pins at one `end` are not parallel: the second branch's pin is turned by half "
        "of the angles, the first one's by minus half. The directions of the axes alone change."
    ),
    **rotations("angle of the second pin against the first"),
    **on_branches(turned),
    pivot="centre of each pin",
    frame="local axes before the pin",
    moves="nothing: the bars stay where they are at home",
    options=(Option("end", ("proximal", "distal"), "which pins"),),
    excludes=("parallelogram_parallelism",),
    stage=40,
)
