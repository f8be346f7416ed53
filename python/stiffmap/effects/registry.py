"""All kinds of effects that are known, by name."""

from __future__ import annotations

from difflib import get_close_matches
from functools import cache

from stiffmap.effects.synonyms import found_by
from stiffmap.effects.types import EffectType
from stiffmap.errors import StiffmapError


@cache
def _known() -> dict[str, EffectType]:
    from stiffmap.effects.library import EFFECTS

    return {effect.kind: effect for effect in EFFECTS}


def kinds() -> tuple[str, ...]:
    """Names of all kinds, those of the machine first, those of the measurement last."""
    return tuple(_known())


def get(kind: str) -> EffectType:
    """The kind of that name; StiffmapError lists those that exist."""
    if kind not in _known():
        near = [*found_by(str(kind), kinds())[:2], *get_close_matches(str(kind), kinds(), 1)]
        hint = f" (did you mean {' or '.join(map(repr, dict.fromkeys(near)))}?)" if near else ""
        raise StiffmapError(f"no effect {kind!r}{hint}; there are: {', '.join(kinds())}")
    return _known()[kind]
