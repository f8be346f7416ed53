"""Lengths of links, and errors of parallelograms, whose bars are the two branches of a block."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stiffmap.model.description import Block, Branch, Element, Joint, Offset, Pose, Spring
from stiffmap.model.description.numbers import with_entry
from stiffmap.model.description.tree import Elements
from stiffmap.model.effects.edit import built, shifted, splice
from stiffmap.model.effects.library.geometry import rotation_of, rotations
from stiffmap.model.effects.sites import each, lengths, links, named
from stiffmap.model.effects.types import EffectType, Option, Parameter, Placed


def longer(e: Element, error: float = 0.0, strain: float = 0.0) -> Offset:
    """An offset built longer along its own direction, by ``error`` (m) and by a share of its length."""
    assert isinstance(e, Offset)
    nominal = e.nominal.p
    return shifted(e, (error / np.linalg.norm(nominal) + strain) * nominal)


def with_error(e: Element, placed: Placed) -> Elements:
    """Offsets along their own direction."""
    return (longer(e, placed.values["error"]),)


LENGTH = EffectType(
    kind="length",
    title="length of a link",
    doc=(
        "The link is built `error` longer than declared (both bars of a parallelogram alike); the "
        "controller computes with the declared length. The link is named by its spring or by the offset "
        "that is its length."
    ),
    parameters=(Parameter("error", "m", -0.1, 0.1, 0.0, 1e-4, "added to the declared length"),),
    **each(lengths, with_error),
    pivot="the link's near end",
    frame="direction of the link",
    moves="all behind the link; nothing turns",
)


GROWTH = (
    Parameter(
        "coefficient", "1/K", -1e-3, 1e-3, 0.0, 1e-5, "growth per length and kelvin",
        plausible=(-5e-5, 5e-5),  # metals, ceramics and composites
    ),
    Parameter(
        "temperature_difference", "K", -200.0, 200.0, None, 1.0,
        "temperature above that of the declared length; left out, the coefficient is the strain",
        default=1.0, fitted=False, recorded="temperature",
    ),
)  # fmt: skip


def grown(e: Element, placed: Placed) -> Elements:
    """Longer by the share of its length that all links grow."""
    strain = placed.values["coefficient"] * placed.values["temperature_difference"]
    return (longer(e, strain=strain),)


THERMAL_GROWTH = EffectType(
    kind="thermal_growth",
    title="thermal growth of a link",
    doc="The link is longer by coefficient·temperature_difference times its declared length.",
    parameters=GROWTH,
    **each(lengths, grown),
    pivot="the link's near end",
    frame="direction of the link",
    moves="all behind the link; nothing turns",
    needs=("temperature",),
)


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
    change: Callable[[Block, Branch, float, Placed], Branch], match: Callable[[Element], bool] = stands_apart
) -> dict[str, Any]:
    """``places`` and ``apply`` of an effect that changes both branches of the blocks that match, with the share -1/2 for
    the first and +1/2 for the second."""

    def block(e: Block, placed: Placed) -> Elements:
        pairs = zip(e.branches, (-0.5, 0.5), strict=True)
        return (replace(e, branches=tuple(change(e, b, share, placed) for b, share in pairs)),)

    return each(named(match), block)


def has_rods(e: Element) -> bool:
    """Whether it is a parallelogram whose bars have a length."""
    return isinstance(e, Block) and stands_apart(e) and all(_rod(b) is not None for b in e.branches)


def _rod(b: Branch) -> int | None:
    found = [i for at in links(b.elements).values() for i in at]
    springs = [e for e in b.elements if isinstance(e, Spring)]
    return found[0] if len(found) == 1 and len(springs) == 1 else None


def unequal(block: Block, b: Branch, share: float, placed: Placed) -> Branch:
    """The first rod shorter by half of the difference, the second longer."""
    i = _rod(b)
    assert i is not None  # the place has been checked
    rod = longer(b.elements[i], share * placed.values["difference"])
    changed: Branch = with_entry(b, "elements", i, rod)
    return changed


LENGTH_DIFFERENCE = EffectType(
    kind="length_difference",
    title="rods of unequal length",
    doc=(
        "The second rod of a parallelogram is built longer by half of `difference`, the first one shorter by "
        "half; their mean is as declared (its error is `length`)."
    ),
    parameters=(Parameter("difference", "m", -0.1, 0.1, 0.0, 1e-4, "second rod minus first rod"),),
    **on_branches(unequal, has_rods),
    pivot="near end of each rod",
    frame="direction of the rods",
    moves="all behind each rod; the block's end turns with the two rods",
)


def widened(block: Block, b: Branch, share: float, placed: Placed) -> Branch:
    """Half of the error on each pin, along the line between them."""
    end = placed.options["end"]
    for one in ("proximal", "distal") if end == "both" else (end,):
        apart, i = width(block, one), ends(b)[one]
        size = share * placed.values["error"] * (1.0 if one == "proximal" else -1.0)
        pin = b.elements[i]
        assert isinstance(pin, Offset)
        b = with_entry(b, "elements", i, shifted(pin, size * apart / np.linalg.norm(apart)))
    return b


PARALLELOGRAM_WIDTH = EffectType(
    kind="parallelogram_width",
    title="width of a parallelogram",
    doc=(
        "The two pins at one `end` of a parallelogram (proximal: nearer the base) stand `error` further "
        "apart than declared, half of it on each side; with `both` the bars stay parallel."
    ),
    parameters=(Parameter("error", "m", -0.1, 0.1, 0.0, 1e-4, "added to the declared width"),),
    **on_branches(widened),
    pivot="middle between the pins",
    frame="line through the two pins",
    moves="each pin with its bar",
    options=(Option("end", ("proximal", "distal", "both"), "which pins"),),
)


def turned(block: Block, b: Branch, share: float, placed: Placed) -> Branch:
    """Half of the angle on each pin; only the pins' directions change."""
    pins = [i for i, e in enumerate(b.elements) if isinstance(e, Joint) and not e.actuated]
    i = pins[0] if placed.options["end"] == "proximal" else pins[-1]
    e = b.elements[i]
    turn = Pose.of(rotation=rotation_of(placed.values, share))
    name = f"{e.name}_parallelism"
    piece = (built(name, turn), e, built(f"{name}_back", turn.inverse()))
    return replace(b, elements=splice(b.elements, i, piece))


PARALLELOGRAM_PARALLELISM = EffectType(
    kind="parallelogram_parallelism",
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
