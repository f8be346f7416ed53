"""Public names of a package, listed once, in the stub next to it."""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any

import lazy_loader


def attached(
    package: str, file: str, *, check: bool = False
) -> tuple[Callable[[str], Any], Callable[[], list[str]], list[str]]:
    """``__getattr__``, ``__dir__`` and ``__all__`` of a package whose stub imports its public names: each is loaded when it is first
    used; with `check`, functions check their arguments first."""
    load, names, every = lazy_loader.attach_stub(package, file)

    def one(name: str) -> Any:
        if name not in every:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        value = load(name)
        if check and callable(value) and not isinstance(value, type):
            from stiffmap.common.arguments import checked

            value = checked(value)
            value.__module__ = package  # where it is found again when it is pickled
        setattr(sys.modules[package], name, value)
        return value

    return one, names, every
