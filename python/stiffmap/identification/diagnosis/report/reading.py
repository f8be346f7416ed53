"""What a diagnosis that was written names."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from stiffmap.common.errors import FileError, reading
from stiffmap.common.json_text import parse_json
from stiffmap.model.description import AppliedEffect


def diagnosed(path: Path) -> list[AppliedEffect]:
    """Effects that the diagnosis of a ``diagnosis.json`` names; raises `FileError` for another file, and where it names none."""
    with reading(path):
        try:
            data: Any = parse_json(path.read_text(encoding="utf-8"))
            terms = []
            for e in data["effects"]:
                values = tuple((n, float(v[0])) for n, v in e["parameters"].items())
                terms.append(AppliedEffect(e["kind"], e["element"], tuple(e["legs"]), values))
        except (ValueError, KeyError, TypeError, IndexError, AttributeError, OverflowError):
            raise FileError(
                "expected a diagnosis as `stiffmap diagnose --json` writes it", file=str(path)
            ) from None
    if not terms:
        raise FileError("the diagnosis names no effect that could be followed", file=str(path))
    return terms
