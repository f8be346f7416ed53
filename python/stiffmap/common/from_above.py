"""Functions of rooms above that a method below hands its work to: `Machine.view`, `Diagnosis.report`.

The face of the package, which knows all rooms, says where they are (`stiffmap/__init__.py`); they are imported when they
are called.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

PLACES: dict[str, tuple[str, str]] = {}
"""Module and function by the method that wants it."""


def from_above(method: str) -> Any:
    """The function behind a method."""
    module, function = PLACES[method]
    return getattr(import_module(module), function)
