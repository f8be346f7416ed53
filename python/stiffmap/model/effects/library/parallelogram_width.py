"""Distance of the pins at one end of a parallelogram."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from stiffmap.model.description import Block, Branch, MachineDescription, Offset, Pose
from stiffmap.model.effects.library.bars import change_branches, end_index, spread_blocks, width
from stiffmap.model.effects.sites import at_sites
from stiffmap.model.effects.types import EffectType, Option, Parameter, Placed


def apply(description: MachineDescription, placed: Placed) -> MachineDescription:
    """Half of the error on each pin, along the line between them."""
    end = placed.options["end"]

    def change(block: Block, b: Branch, share: float) -> Branch:
        for one in ("proximal", "distal") if end == "both" else (end,):
            b = _moved(block, b, one, share * placed.values["error"])
        return b

    return change_branches(description, placed, change)


def _moved(block: Block, b: Branch, end: str, step: float) -> Branch:
    i = end_index(b, end)
    e = b.elements[i]
    assert isinstance(e, Offset)
    apart = width(block, end)
    towards = step * apart / np.linalg.norm(apart) * (1.0 if end == "proximal" else -1.0)
    actual = e.actual or e.nominal
    moved = replace(e, actual=Pose.of(actual.p + towards, actual.r))
    return replace(b, elements=(*b.elements[:i], moved, *b.elements[i + 1 :]))


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
