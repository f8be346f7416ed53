"""Rods of unequal length in a parallelogram."""

from __future__ import annotations

from stiffmap.model.description import Block, Branch, Element, Spring
from stiffmap.model.description.numbers import with_entry
from stiffmap.model.effects.library.bars import on_branches, stands_apart
from stiffmap.model.effects.library.length import longer
from stiffmap.model.effects.sites import links
from stiffmap.model.effects.types import EffectType, Parameter, Placed


def has_rods(e: Element) -> bool:
    """Whether it is a parallelogram whose bars have a length."""
    return isinstance(e, Block) and stands_apart(e) and all(_rod(b) is not None for b in e.branches)


def _rod(b: Branch) -> int | None:
    found = [i for at in links(b.elements).values() for i in at]
    springs = [e for e in b.elements if isinstance(e, Spring)]
    return found[0] if len(found) == 1 and len(springs) == 1 else None


def lengthened(block: Block, b: Branch, share: float, placed: Placed) -> Branch:
    """The first rod shorter by half of the difference, the second longer."""
    i = _rod(b)
    assert i is not None  # the place has been checked
    rod = longer(b.elements[i], share * placed.values["difference"])
    changed: Branch = with_entry(b, "elements", i, rod)
    return changed


EFFECT = EffectType(
    kind="length_difference",
    precedence=140,
    title="rods of unequal length",
    doc=(
        "The second rod of a parallelogram is built longer by half of `difference`, the first one shorter by "
        "half; their mean is as declared (its error is `length`)."
    ),
    parameters=(Parameter("difference", "m", -0.1, 0.1, 0.0, 1e-4, "second rod minus first rod"),),
    **on_branches(lengthened, has_rods),
    pivot="near end of each rod",
    frame="direction of the rods",
    moves="all behind each rod; the block's end turns with the two rods",
)
