"""The published schemas of what commands print with --json."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

SCHEMAS = Path(__file__).parents[4] / "docs/schemas"


def schema(name: str) -> Any:
    """The schema of a command."""
    return json.loads((SCHEMAS / f"{name}.json").read_text(encoding="utf-8"))


def obeys(name: str, printed: str) -> None:
    """What a command printed fits its schema."""
    jsonschema = pytest.importorskip("jsonschema")
    jsonschema.Draft202012Validator(schema(name)).validate(json.loads(printed))
