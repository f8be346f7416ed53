"""Python files that users write: kinds of effects and of readings of their own."""

from __future__ import annotations

from importlib.util import module_from_spec, spec_from_file_location
from os import PathLike
from pathlib import Path
from types import ModuleType

from stiffmap.errors import FileError


def run_python_file(path: str | PathLike[str], sort: str, defines: str) -> ModuleType:
    """The module of a file; ``sort`` names it, ``defines`` says what it is for. Raises `FileError` where it cannot be run."""
    file = Path(path)
    spec = spec_from_file_location(f"stiffmap_{sort}_{file.stem}", file)
    if spec is None or spec.loader is None or not file.is_file():
        raise FileError(f"cannot be read as a Python file that defines {defines}", file=str(path))
    module = module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except Exception as error:
        raise FileError(f"cannot be run: {type(error).__name__}: {error}", file=str(path)) from error
    return module
