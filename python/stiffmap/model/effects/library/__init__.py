"""One file per kind of effect: every module here that has an ``EFFECT`` is a kind of the library."""

import sys

from stiffmap.common.python_file import modules_of
from stiffmap.model.effects.types import EffectType

EFFECTS: tuple[EffectType, ...] = tuple(
    m.EFFECT for m in modules_of(sys.modules[__name__]) if hasattr(m, "EFFECT")
)
