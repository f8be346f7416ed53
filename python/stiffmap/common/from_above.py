"""Functions of rooms above that a method below hands its work to: `Machine.view`, `Diagnosis.report`.

The face of the package, which knows all rooms, says where they are (`stiffmap/__init__.py`); they are imported when they
are called.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any, Protocol, Self


class OpenView(Protocol):
    """What `Machine.view` returns: a view that is open; `close` ends it, as the end of a ``with`` block does."""

    @property
    def url(self) -> str:
        """Address to open in a browser."""

    @property
    def link(self) -> str:
        """The address with machine, pose, load, plane and changed numbers."""

    def set(self, **values: object) -> None:
        """New values of the state, such as ``force=(0, 0, -500)``; SI."""

    def wait(self) -> None:
        """Until the program is interrupted."""

    def close(self) -> None:
        """End the view."""

    def __enter__(self) -> Self: ...

    def __exit__(self, *_: object) -> None: ...


PLACES: dict[str, tuple[str, str]] = {}
"""Module and function by the method that wants it."""


def from_above(method: str) -> Any:
    """The function behind a method."""
    module, function = PLACES[method]
    return getattr(import_module(module), function)
