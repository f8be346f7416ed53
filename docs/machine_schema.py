"""JSON schema of machine files, kept in docs/machine.schema.json for editors: ``python docs/machine_schema.py`` writes it anew."""

from __future__ import annotations

import json
from pathlib import Path

from stiffmap.common.outputs import write_text
from stiffmap.model.files.schema import MachineFile


def machine_schema() -> dict[str, object]:
    """JSON schema (draft 2020-12)."""
    schema = MachineFile.model_json_schema()
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        **schema,
        "title": "stiffmap machine file",
    }


def schema_text() -> str:
    """The text of docs/machine.schema.json."""
    return json.dumps(machine_schema(), indent=2, sort_keys=True) + "\n"


if __name__ == "__main__":
    write_text(Path(__file__).with_name("machine.schema.json"), schema_text())
