"""Folders in which one file is one kind of thing: effects, readings, measures."""

from __future__ import annotations

from importlib import import_module
from pkgutil import iter_modules
from types import ModuleType


def modules_of(package: ModuleType) -> list[ModuleType]:
    """Every module that lies in a package, by name; those with a leading underscore are helpers of the others."""
    names = sorted(m.name for m in iter_modules(package.__path__))
    return [import_module(f"{package.__name__}.{n}") for n in names if not n.startswith("_")]
