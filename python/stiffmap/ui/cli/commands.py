"""The table of commands; each lives in a file of its own, which is imported only when it is run, and what it computes with only then:
help and bad options cost no numerics."""

from __future__ import annotations

import builtins
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import wraps
from importlib import import_module
from inspect import Parameter, Signature, signature
from types import SimpleNamespace
from typing import Any, NamedTuple, cast

import typer

from stiffmap.common.errors import MissingPartError
from stiffmap.ui.cli.options import TABLE, Json, typed_for


class Command(NamedTuple):
    """Name on the command line, the module whose function ``command`` it is, and the line in ``stiffmap --help``."""

    name: str
    module: str
    summary: str


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
    Command(name, f"stiffmap.ui.cli.{'importing' if name == 'import' else name}", summary)
    for name, summary in SUMMARIES.items()
)  # `import` is a word of Python's own

HERE = f"{__package__}."
NUMERICS = ("matplotlib", "numpy", "pandas", "scipy", "xarray")
_waiting: list[dict[str, Any]] = []
"""Names of modules in which something still waits to be imported."""


def load(command: Command) -> Callable[..., Any]:
    """A command's function with the option ``--json`` and, of a table, those of `TABLE`: it imports what it needs when it is called, shows the answer and exits with
    1 where that is a finding; raises `MissingPartError` for what is not installed.

    A function that does something else under ``--json`` has the option itself.
    """
    with _all_installed(command), imports_wait():
        function: Callable[..., Any] = import_module(command.module).command
    parameters = dict(signature(function, eval_str=True).parameters)
    own = "as_json" in parameters
    table = ""
    for name, typed in [(n, t) for n, p in parameters.items() if (t := typed_for(p.annotation))]:
        table, parameters[name] = name, parameters[name].replace(annotation=typed)
        for field, (of, default) in TABLE.items():
            parameters[field] = Parameter(field, Parameter.KEYWORD_ONLY, default=default, annotation=of)
    parameters.setdefault(
        "as_json", Parameter("as_json", Parameter.KEYWORD_ONLY, default=False, annotation=Json)
    )

    @wraps(function)
    def called(as_json: bool, **given: Any) -> None:
        from stiffmap.ui.cli.inputs import as_table
        from stiffmap.ui.cli.output import show

        with _all_installed(command):
            import_all()
        if table:
            said = {name: given.pop(name) for name in TABLE}
            given[table] = as_table(given[table], **said) if any(said.values()) else given[table]
        answer = function(**given, as_json=as_json) if own else function(**given)
        if answer is not None:  # else the command has shown it
            show(as_json, answer)
            raise typer.Exit(int(answer.finding))

    called.__signature__ = Signature([*parameters.values()])  # type: ignore[attr-defined]
    called.__annotations__ = {name: p.annotation for name, p in parameters.items()}
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


class _Waits(NamedTuple):
    """Stands for a module, or a name in one, until it is imported: nothing can be done with it before."""

    module: str
    name: str | None = None

    def imported(self) -> Any:
        """What it stands for."""
        module, name = self
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
                names[key] = value.imported()
        _waiting.pop()


@contextmanager
def imports_wait() -> Iterator[None]:
    """Inside, modules of commands get stand-ins for numerics and for what lies below the user interface.

    A module that is loaded already needs none.
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
