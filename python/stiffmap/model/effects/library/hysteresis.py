"""What a drive remembers: friction, play and stiffening along a sequence of loads.

Theory L5. The spring's force s follows the drive's force F as a play operator does, |F - s| <= level; deflection is a
function of s. That is Coulomb friction parallel to a spring, exactly, for any monotone law; many elements with levels of their
own are a Prandtl-Ishlinskii model, which obeys Masing's rule.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import ArrayLike

from stiffmap.common.broadcasting import Floats
from stiffmap.model.effects.evidence import shares_of_load
from stiffmap.model.effects.library.dead_zone import HALF_WIDTH
from stiffmap.model.effects.sites import at_sites, elastic_drives
from stiffmap.model.effects.types import EffectType, Parameter

PARAMETERS = (
    Parameter("level", "N", 0.0, 1e6, 0.0, 1.0, "Coulomb level", default=0.0, angular="N·m"),
    Parameter("spread", "1", 0.0, 1.0, 0.0, 0.1, "half width of the levels about it, relative", default=0.0),
    Parameter("breakaway", "1", 1.0, 10.0, 1.0, 0.1, "level at standstill over it", default=1.0),
    replace(HALF_WIDTH, doc="play to each side", default=0.0),
    Parameter(
        "seat", "N", 1e-6, 1e6, None, 1.0, "force over which the play is crossed", default=1e-3, angular="N·m"
    ),
    Parameter("ratio", "1", 1e-3, 1e3, 1.0, 0.1, "compliance at large loads over that at small ones", default=1.0),
    Parameter("knee", "N", 1e-6, 1e6, None, 100.0, "force where it changes", default=100.0, angular="N·m"),
)  # fmt: skip
ELEMENTS = 16
"""Elements that stand for a spread of levels."""
SEATS = (0.003, 0.03, 0.1)
"""Shares of the largest load within which play is crossed."""


def spring_force(force: Floats, level: ArrayLike, breakaway: float = 1.0) -> Floats:
    """(n, ...) force s that the spring feels while the drive's `force` (n,) runs, from rest at s = 0, with
    elements of these levels (...)."""
    levels = np.asarray(level, dtype=float)
    each = [_of_one(force.tolist(), float(v), breakaway) for v in levels.ravel()]
    return np.stack(each, axis=1).reshape(len(force), *levels.shape)


def _of_one(force: list[float], level: float, breakaway: float) -> list[float]:
    """`spring_force` of one element, on plain numbers."""
    s, sliding, out = 0.0, 0.0, []
    for f in force:
        gap = f - s
        ahead = sliding * gap
        if abs(gap) > (level if ahead > 0 else level * breakaway):
            sliding = 1.0 if gap > 0 else -1.0
            s = f - sliding * level
        elif ahead < level * (1 - 1e-12):
            sliding = 0.0
        out.append(s)
    return out


def deflection(force: Floats, compliance: float, values: Mapping[str, float]) -> Floats:
    """(n,) deflection of a drive while `force` (n,) runs, theory L5."""
    level, spread = values["level"], values["spread"]
    levels = level * (1 + spread * np.linspace(-1, 1, ELEMENTS)) if spread > 0 else np.array([level])
    ratio, knee = values["ratio"], values["knee"]
    s = spring_force(force, levels, values["breakaway"])
    bent = ratio * s + (1 - ratio) * knee * np.tanh(s / knee)
    return np.asarray((compliance * bent + values["half_width"] * np.tanh(s / values["seat"])).mean(axis=1))


EFFECT = EffectType(
    kind="hysteresis",
    precedence=70,
    reverses=True,
    title="friction, play and stiffening of a drive along a sequence of loads",
    doc=(
        "Rows in order of time; a set-up starts afresh. The force s that the drive's spring feels follows the drive's "
        "force F within the friction: |F - s| is at most `level`, or `level` times `breakaway` while s stands still; "
        "with `spread` it is the mean of many such elements, levels evenly between (1 - spread) and (1 + spread) "
        "times `level`. The deflection is then the drive's own at s, its compliance c changed from c to ratio·c at the "
        "`knee`, plus play: c·(ratio·s + (1 - ratio)·knee·tanh(s/knee)) + half_width·tanh(s/seat)."
    ),
    parameters=PARAMETERS,
    places=at_sites(elastic_drives),
    apply=None,
    signature=partial(shares_of_load, name="seat", shares=SEATS),
    hidden=lambda plan: plan.load_direction is None,  # memory is nothing to see where loads jump
    tried=at_sites(elastic_drives),
    moved=("level", "half_width", "seat"),
    frame="the drive's coordinate",
    moves="what the drive moves",
    excludes=("hysteresis", "friction"),
    needs=("order",),
    drive=deflection,
)
