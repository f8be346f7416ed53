"""Distance of the pins at one end of a parallelogram."""

from __future__ import annotations

import numpy as np

from stiffmap.model.description import Block, Branch, MachineDescription, Offset
from stiffmap.model.description.numbers import with_entry
from stiffmap.model.effects.edit import shifted
from stiffmap.model.effects.library.bars import change_branches, end_index, spread_blocks, width
from stiffmap.model.effects.sites import at_sites
from stiffmap.model.effects.types import EffectType, Option, Parameter, Placed


def apply(description: MachineDescription, placed: Placed) -> MachineDescription:
    """Half of the error on each pin, along the line between them."""
    end = placed.options["end"]

    def change(block: Block, b: Branch, share: float) -> Branch:
        for one in ("proximal", "distal") if end == "both" else (end,):
            apart, i = width(block, one), end_index(b, one)
            size = share * placed.values["error"] * (1.0 if one == "proximal" else -1.0)
            pin = b.elements[i]
            assert isinstance(pin, Offset)
            b = with_entry(b, "elements", i, shifted(pin, size * apart / np.linalg.norm(apart)))
        return b

    return change_branches(description, placed, change)


EFFECT = EffectType(
    kind="parallelogram_width",
    precedence=200,
    title="width of a parallelogram",
    doc=(
        "The two pins at one `end` of a parallelogram (proximal: nearer the base) stand `error` further "
        "apart than declared, half of it on each side; with `both` the bars stay parallel."
    ),
    parameters=(Parameter("error", "m", -0.1, 0.1, 0.0, 1e-4, "added to the declared width"),),
    places=at_sites(spread_blocks),
    apply=apply,
    pivot="middle between the pins",
    frame="line through the two pins",
    moves="each pin with its bar",
    options=(Option("end", ("proximal", "distal", "both"), "which pins"),),
)
