"""One file per kind of effect: every module here that has an ``EFFECT`` is a kind of the library."""

from importlib import import_module
from pkgutil import iter_modules

from stiffmap.model.effects.types import EffectType

_MODULES = [import_module(f"{__name__}.{m.name}") for m in iter_modules(__path__)]
EFFECTS: tuple[EffectType, ...] = tuple(m.EFFECT for m in _MODULES if hasattr(m, "EFFECT"))
