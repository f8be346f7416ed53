"""A command is loaded without what it computes with, which is imported when the command runs: help and bad options cost no numerics."""

from __future__ import annotations

import builtins
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import wraps
from importlib import import_module
from types import SimpleNamespace
from typing import Any, cast

from stiffmap.common.errors import MissingPartError
from stiffmap.ui.cli.commands import Command

HERE = f"{__package__}."
NUMERICS = ("matplotlib", "numpy", "pandas", "scipy", "xarray")
_waiting: list[dict[str, Any]] = []
"""Names of modules in which something still waits to be imported."""


def load(command: Command) -> Callable[..., Any]:
    """A command's function, which imports what it needs when it is called; raises `MissingPartError` for what is not installed."""
    with _all_installed(command), imports_wait():
        function: Callable[..., Any] = getattr(import_module(command.module), command.function)

    @wraps(function)
    def called(*args: object, **options: object) -> None:
        with _all_installed(command):
            import_all()
        function(*args, **options)

    return called


@contextmanager
def _all_installed(command: Command) -> Iterator[None]:
    try:
        yield
    except ModuleNotFoundError as error:
        missing = error.name or command.module
        if missing.split(".")[0] == "stiffmap":
            advice = "which this installation of stiffmap lacks"
        else:
            advice = "which is not installed: pip install 'stiffmap[all]'"
        raise MissingPartError(f"'stiffmap {command.name}' needs {missing}, {advice}") from error


class _Waits:
    """A module, or a name in one, that is imported when something is done with it."""

    def __init__(self, module: str, name: str | None = None) -> None:
        self._of = (module, name)

    def __getattr__(self, name: str) -> Any:
        return getattr(imported(self), name)

    def __call__(self, *args: object, **options: object) -> Any:
        return imported(self)(*args, **options)

    def __getitem__(self, key: object) -> Any:
        return imported(self)[key]

    def __iter__(self) -> Iterator[Any]:
        return iter(imported(self))


def imported(waits: _Waits) -> Any:
    """What has waited, imported now."""
    module, name = waits._of
    home = import_module(module)
    if name is None:
        return home
    return getattr(home, name) if hasattr(home, name) else import_module(f"{module}.{name}")


def import_all() -> None:
    """Import whatever still waits; ModuleNotFoundError for what is not installed."""
    while _waiting:
        names = _waiting[-1]
        for key, value in list(names.items()):
            if isinstance(value, _Waits):
                names[key] = imported(value)
        _waiting.pop()


@contextmanager
def imports_wait() -> Iterator[None]:
    """Inside, modules of commands get stand-ins for numerics and for what lies below the user interface.

    A stand-in that is used, as in the declaration of an option, is imported at once; modules that are loaded already are
    no stand-ins.
    """
    usual = builtins.__import__

    def to_wait(
        name: str,
        globals: Mapping[str, object] | None = None,
        locals: Mapping[str, object] | None = None,
        fromlist: Sequence[str] | None = (),
        level: int = 0,
    ) -> Any:
        top = name.partition(".")[0]
        below = top in NUMERICS or (top == "stiffmap" and not f"{name}.".startswith(HERE))
        asks = isinstance(globals, dict) and str(globals.get("__name__")).startswith(HERE)
        if asks and below and name not in sys.modules and (fromlist or name == top):
            _waiting.append(cast(dict[str, Any], globals))
            waiting = SimpleNamespace(**{part: _Waits(name, part) for part in fromlist or ()})
            return waiting if fromlist else _Waits(name)
        return usual(name, globals, locals, fromlist, level)

    builtins.__import__ = to_wait
    try:
        yield
    finally:
        builtins.__import__ = usual
