"""Length of a link."""

from __future__ import annotations

import numpy as np

from stiffmap.model.description import Element, Offset
from stiffmap.model.description.tree import Elements
from stiffmap.model.effects.edit import shifted
from stiffmap.model.effects.sites import each, lengths
from stiffmap.model.effects.types import EffectType, Parameter, Placed


def longer(e: Element, error: float = 0.0, strain: float = 0.0) -> Offset:
    """An offset built longer along its own direction, by ``error`` (m) and by a share of its length."""
    assert isinstance(e, Offset)
    nominal = e.nominal.p
    return shifted(e, (error / np.linalg.norm(nominal) + strain) * nominal)


def changed(e: Element, placed: Placed) -> Elements:
    """Offsets along their own direction."""
    return (longer(e, placed.values["error"]),)


EFFECT = EffectType(
    kind="length",
    precedence=130,
    title="length of a link",
    doc=(
        "The link is built `error` longer than declared (both bars of a parallelogram alike); the "
        "controller computes with the declared length. The link is named by its spring or by the offset "
        "that is its length."
    ),
    parameters=(Parameter("error", "m", -0.1, 0.1, 0.0, 1e-4, "added to the declared length"),),
    **each(lengths, changed),
    pivot="the link's near end",
    frame="direction of the link",
    moves="all behind the link; nothing turns",
)
