"""All kinds of effects that are known, by name: those of the library, and those that users register."""

from __future__ import annotations

from difflib import get_close_matches
from functools import cache
from os import PathLike
from types import ModuleType

from stiffmap.common.errors import FileError, StiffmapError
from stiffmap.common.python_file import modules_of, run_python_file
from stiffmap.model.effects.evidence import RECORDS
from stiffmap.model.effects.synonyms import found_by
from stiffmap.model.effects.types import EffectType


@cache
def _library() -> dict[str, EffectType]:
    import stiffmap.model.effects.library as library

    return {e.kind: e for module in modules_of(library) for e in _effects_of(module)}


def _effects_of(module: ModuleType) -> tuple[EffectType, ...]:
    """Its ``EFFECT``, or each of its ``EFFECTS``."""
    one = getattr(module, "EFFECT", None)
    return tuple(getattr(module, "EFFECTS", ())) or ((one,) if isinstance(one, EffectType) else ())


@cache
def _known() -> dict[str, EffectType]:
    return dict(_library())


def kinds() -> tuple[str, ...]:
    """Names of all kinds, those of the machine first, those of the measurement last."""
    ordered = sorted(_known().values(), key=lambda e: (e.measurement, e.precedence, e.kind))
    return tuple(effect.kind for effect in ordered)


def get(kind: str) -> EffectType:
    """The kind of that name; StiffmapError lists those that exist."""
    if kind not in _known():
        near = [*found_by(str(kind), kinds())[:2], *get_close_matches(str(kind), kinds(), 1)]
        hint = f" (did you mean {' or '.join(map(repr, dict.fromkeys(near)))}?)" if near else ""
        raise StiffmapError(f"no effect {kind!r}{hint}; there are: {', '.join(kinds())}")
    return _known()[kind]


def register(effect: EffectType) -> EffectType:
    """Make a kind known to everything: machines, files, command line, diagnosis. Returns it.

    Raises StiffmapError where the library has a kind of that name, or where the definition contradicts itself. A
    kind that was registered before is replaced.
    """
    if effect.kind in _library():
        raise StiffmapError(f"effect {effect.kind!r}: the library has a kind of that name")
    _check(effect)
    _known()[effect.kind] = effect
    return effect


def unregister(kind: str) -> None:
    """Forget a kind that was registered."""
    _known().pop(kind, None)


def load_effects(path: str | PathLike[str]) -> tuple[EffectType, ...]:
    """Run a Python file and register its ``EFFECT``, or each of its ``EFFECTS``.

    Raises `FileError` where it cannot be run or defines none.
    """
    found = _effects_of(run_python_file(path, "effect", "an effect"))
    if not found:
        raise FileError("defines no effect: expected EFFECT = EffectType(...)", file=str(path))
    return tuple(register(e) for e in found)


def _check(effect: EffectType) -> None:
    unknown = [n for n in (*effect.needs, *effect.better_with) if n not in RECORDS]
    if unknown:
        raise StiffmapError(f"effect {effect.kind!r}: needs {unknown[0]!r}; known: {', '.join(RECORDS)}")
    if effect.apply is None and not (effect.load or effect.reading or effect.drive):
        raise StiffmapError(f"effect {effect.kind!r}: give one of apply, load, reading, drive")
    for p in effect.parameters:
        if not p.lower <= (p.lower if p.null is None else p.null) <= p.upper or not p.scale > 0:
            raise StiffmapError(
                f"effect {effect.kind!r}: {p.name}: expected lower ≤ null ≤ upper and a positive scale"
            )
