"""Reading machine files."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from stiffmap.common.errors import StiffmapError
from stiffmap.common.yaml_text import Document, parse, read
from stiffmap.model.description import MachineDescription
from stiffmap.model.effects import apply_records
from stiffmap.model.files.build import build, build_effect
from stiffmap.model.files.report import validated
from stiffmap.model.files.schema import MachineFile
from stiffmap.model.files.shipped import find
from stiffmap.model.files.templates import expanded

Source = str | PathLike[str] | Mapping[str, Any]
"""A shipped name, a path, the text of a machine file, or its plain data."""


def load_description(source: Source) -> MachineDescription:
    """Description of a shipped machine (by name), of a machine file (by path), of its text (several lines), or of its plain data.

    Link files that text and plain data name are looked for in the working directory.
    Raises `UnknownMachineError` where there is no such machine, `FileError` for anything wrong in it.
    """
    if isinstance(source, Mapping):
        return describe_document(Document(_plain(source)), "dict", Path())
    if isinstance(source, str) and ("\n" in source or source.lstrip().startswith("{")):
        return description_from_text(source)
    if not isinstance(source, str | PathLike):
        raise StiffmapError(
            "expected a machine: a shipped name, a path, the text of a machine file or its plain data as a dict, "
            f"got {type(source).__name__}"
        )
    path = find(source)
    return describe_document(read(path), str(path), path.parent)


_POWER = re.compile(r"[-+]?\d+(\.\d*)?[eE][-+]?\d+")
"""A number such as ``7.0e4``, which readers of YAML 1.1 take for text."""


def _plain(data: object) -> object:
    """Plain data with text keys; arrays and numbers of NumPy as Python has them, every part a copy of its own."""
    if isinstance(data, Mapping):
        return {str(k): _plain(v) for k, v in data.items()}
    if isinstance(data, np.ndarray | np.generic):
        return data.tolist()
    if isinstance(data, list | tuple):
        return [_plain(v) for v in data]
    if isinstance(data, str) and _POWER.fullmatch(data):
        return float(data)
    return data


def description_from_text(text: str, file: str = "text") -> MachineDescription:
    """Description from the text of a machine file, whose link files are in the working directory."""
    return describe_document(parse(text, file), file, Path())


def describe_document(document: Document, file: str, folder: Path) -> MachineDescription:
    """Schema, then SI, then effects."""
    if isinstance(document.data, dict):
        document = expanded(document, file)
    model = validated(MachineFile, document, file, "a machine file is a mapping with name, units and legs")
    base = build(model, document, file, folder)
    if not model.effects:
        return base
    applied = apply_records(base, tuple(build_effect(e) for e in model.effects))
    return applied if applied.declared is not None else replace(applied, declared=base)
