"""The table of commands; each lives in a file of its own, which is imported only when it is run, and what it computes with only then:
help and bad options cost no numerics."""

from __future__ import annotations

import builtins
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import wraps
from importlib import import_module
from importlib.util import find_spec
from types import SimpleNamespace
from typing import Any, NamedTuple, cast

from stiffmap.common.errors import MissingPartError


class Command(NamedTuple):
    """Name on the command line, module and function behind it, and the line in ``stiffmap --help``."""

    name: str
    module: str
    function: str
    summary: str

    def exists(self) -> bool:
        """Whether this installation has the module (it is not imported)."""
        try:
            return find_spec(self.module) is not None
        except ModuleNotFoundError:
            return False


SUMMARIES = {
    "machines": "List the machines that come with stiffmap.",
    "new": "Start a machine file from a template that explains itself.",
    "check": "Validate a machine file.",
    "show": "Draw a machine and print what it is made of.",
    "view": "A machine and its map, live in a browser.",
    "effects": "List the effects that a machine can have.",
    "solve": "Deflection and stiffness at one pose under one wrench.",
    "map": "Error maps of z-planes under a force.",
    "polar": "Deflection against the direction of a force.",
    "wrench": "Wrench that holds a machine at a displacement.",
    "stress": "Internal wrenches without load: errors, preload.",
    "import": "Machine file from a URDF.",
    "sweep": "Deflection against the size of a force.",
    "measures": "Performance measures against requirements.",
    "efforts": "Efforts of the drives along a motion.",
    "optimize": "Best designs under several measures.",
    "paper": "Reproduce the figures and statements of the paper.",
    "link": "Spring of a link from a part or a field.",
    "experiment": "Experiment folder from a spreadsheet.",
    "residual": "Readings of an experiment against a machine.",
    "diagnose": "Which physical effect a machine lacks.",
    "calibrate": "All uncertain numbers of a machine.",
    "simulate": "Write a virtual experiment.",
    "plan": "Which poses, loads and readings are most informative.",
    "monitor": "What changed between two experiments.",
    "compensate": "Commands that cancel what a machine lacks.",
    "mill": "The part as it is cut, and a program that makes it right.",
    "process": "Force coefficients from a dynamometer's table.",
    "lobes": "Which depth of cut chatters at which speed.",
    "taps": "Which effect explains frequencies of tap tests.",
    "bench": "Speed of this installation on this computer.",
}
COMMANDS = tuple(
    Command(name, f"stiffmap.ui.cli.{'importing' if name == 'import' else name}", "command", summary)
    for name, summary in SUMMARIES.items()
)  # `import` is a word of Python's own

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
