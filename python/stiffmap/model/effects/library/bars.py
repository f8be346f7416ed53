"""What the errors of parallelograms share: the two branches of a block."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stiffmap.model.description import Block, Branch, Element, Joint, Offset
from stiffmap.model.description.tree import Elements
from stiffmap.model.effects.sites import each, named
from stiffmap.model.effects.types import Placed


def stands_apart(e: Element) -> bool:
    """Whether it is a block of two branches that begin with different offsets: the pins stand apart."""
    if not isinstance(e, Block) or len(e.branches) != 2:
        return False
    return all(map(ends, e.branches)) and bool(np.linalg.norm(width(e)) > 0.0)


def ends(b: Branch) -> dict[str, int]:
    """Indices of the offsets between the block's frames and the pins, by end; none where no joint is between."""
    at = [i for i, e in enumerate(b.elements) if isinstance(e, Offset)]
    joints = [i for i, e in enumerate(b.elements) if isinstance(e, Joint) and not e.actuated]
    fits = len(at) > 1 and len(joints) > 1 and at[0] < joints[0] and joints[-1] < at[-1]
    return {"proximal": at[0], "distal": at[-1]} if fits else {}


def width(e: Block, end: str = "proximal") -> NDArray[np.float64]:
    """(3,) m: from the first branch's pin to the second's, as declared."""
    pins = [b.elements[ends(b)[end]] for b in e.branches]
    first, second = (pin.nominal.p for pin in pins if isinstance(pin, Offset))
    return second - first if end == "proximal" else first - second


def on_branches(
    change: Callable[[Block, Branch, float, Placed], Branch],
    match: Callable[[Element], bool] = stands_apart,
) -> dict[str, Any]:
    """``places`` and ``apply`` of an effect that changes both branches of the blocks that match, with the share -1/2 for
    the first and +1/2 for the second."""

    def block(e: Block, placed: Placed) -> Elements:
        pairs = zip(e.branches, (-0.5, 0.5), strict=True)
        return (replace(e, branches=tuple(change(e, b, share, placed) for b, share in pairs)),)

    return each(named(match), block)
