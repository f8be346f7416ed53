"""Distance of the pins at one end of a parallelogram."""

from __future__ import annotations

import numpy as np

from stiffmap.model.description import Block, Branch, Offset
from stiffmap.model.description.numbers import with_entry
from stiffmap.model.effects.edit import shifted
from stiffmap.model.effects.library.bars import ends, on_branches, width
from stiffmap.model.effects.types import EffectType, Option, Parameter, Placed


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


EFFECT = EffectType(
    kind="parallelogram_width",
    precedence=200,
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
