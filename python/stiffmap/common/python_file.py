"""Python files of which each is one kind of thing, an effect, a reading or a measure: those of a folder, and those that users write."""

from __future__ import annotations

import hashlib
from importlib import import_module
from importlib.util import module_from_spec, spec_from_file_location
from os import PathLike
from pathlib import Path
from pkgutil import iter_modules
from types import ModuleType

from stiffmap.common.errors import FileError


def modules_of(package: ModuleType) -> list[ModuleType]:
    """Every module that lies in a package, by name; those with a leading underscore are helpers of the others."""
    names = sorted(m.name for m in iter_modules(package.__path__))
    return [import_module(f"{package.__name__}.{n}") for n in names if not n.startswith("_")]


_RUN: dict[str, str] = {}


def code_run() -> list[str]:
    """Names and digests (SHA-256) of the files that this process has run, each as it was last."""
    return [f"{Path(file).name} {digest}" for file, digest in sorted(_RUN.items())]


def run_python_file(path: str | PathLike[str], sort: str, defines: str) -> ModuleType:
    """The module of a file; ``sort`` names it, ``defines`` says what it is for. Raises `FileError` where it cannot be run."""
    file = Path(path)
    spec = spec_from_file_location(f"stiffmap_{sort}_{file.stem}", file)
    if spec is None or spec.loader is None or not file.is_file():
        raise FileError(f"cannot be read as a Python file that defines {defines}", file=str(path))
    module = module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
        _RUN[str(file.resolve())] = hashlib.sha256(file.read_bytes()).hexdigest()
    except Exception as error:
        raise FileError(f"cannot be run: {type(error).__name__}: {error}", file=str(path)) from error
    return module
