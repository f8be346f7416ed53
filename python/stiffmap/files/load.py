"""Reading machine files."""

from __future__ import annotations

from dataclasses import replace
from os import PathLike
from pathlib import Path

from stiffmap.description import MachineDescription
from stiffmap.effects import apply_records
from stiffmap.files.build import build, build_effect
from stiffmap.files.report import validated
from stiffmap.files.schema import MachineFile
from stiffmap.files.shipped import find
from stiffmap.files.templates import expanded
from stiffmap.yaml_text import Document, parse, read


def load_description(name_or_path: str | PathLike[str]) -> MachineDescription:
    """Description of a shipped machine (by name) or of a machine file (by path).

    Raises `UnknownMachineError` where there is neither, `FileError` for anything wrong in the file.
    """
    path = find(name_or_path)
    return describe_document(read(path), str(path), path.parent)


def description_from_text(text: str, file: str = "text", folder: Path = Path()) -> MachineDescription:
    """Description from the text of a machine file; ``folder`` is where its link files are."""
    return describe_document(parse(text, file), file, folder)


def describe_document(document: Document, file: str, folder: Path) -> MachineDescription:
    """Schema, then SI, then effects."""
    if isinstance(document.data, dict):
        document = expanded(document, file)
    model = validate(document, file)
    base = build(model, document, file, folder)
    if not model.effects:
        return base
    applied = apply_records(base, tuple(build_effect(e) for e in model.effects))
    return applied if applied.declared is not None else replace(applied, declared=base)


def validate(document: Document, file: str) -> MachineFile:
    """Plain data against the schema; raises `FileError` with every problem."""
    return validated(MachineFile, document, file, "a machine file is a mapping with name, units and legs")
