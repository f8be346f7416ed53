"""The JSON schema in the docs is current; the starter and the guide name every key."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest
from docs.machine_schema import machine_schema, schema_text

from stiffmap.model.files import description_from_text
from stiffmap.model.files.shipped import starter_text
from stiffmap.solve.compiled.lowering import home_gaps

DOCS = Path(__file__).parents[4] / "docs"
GUIDE = DOCS / "machine_files.md"
WRITTEN_ON_SAVING = {"uncertainty", "notes", "extra", "entries", "rows", "diagonal"}


def keys(schema: dict[str, Any]) -> set[str]:
    """Every key that a machine file may have."""
    found = set(schema.get("properties", {}))
    for definition in schema.get("$defs", {}).values():
        found |= set(definition.get("properties", {}))
        for option in definition.get("anyOf", []):
            found |= set(option.get("properties", {}))
    return found


def test_schema_file_is_current() -> None:
    path = DOCS / "machine.schema.json"
    assert path.read_text(encoding="utf-8") == schema_text(), "run: python docs/machine_schema.py"


def test_starter_loads_and_closes() -> None:
    machine = description_from_text(starter_text("mine"))
    assert machine.name == "mine"
    assert max(gap.translation for gap in home_gaps(machine)) < 1e-5  # four digits, which loading closes


@pytest.mark.parametrize("key", sorted(keys(machine_schema()) - WRITTEN_ON_SAVING))
def test_every_key_is_explained(key: str) -> None:
    for page, text in (("starter", starter_text("mine")), ("guide", GUIDE.read_text(encoding="utf-8"))):
        assert re.search(rf"\b{key}\b", text), f"the {page} does not explain '{key}'"


def test_machine_in_the_guide_loads() -> None:
    example = re.search(r"```yaml\n(name: .*?)```", GUIDE.read_text(encoding="utf-8"), re.DOTALL)
    assert example is not None
    machine = description_from_text(example[1])
    assert max(gap.translation for gap in home_gaps(machine)) < 1e-15
