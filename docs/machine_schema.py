"""JSON schema of machine files, kept in docs/machine.schema.json for editors.

``python -m stiffmap.model.files.json_schema docs/machine.schema.json`` writes it anew.
"""

from __future__ import annotations

import json
import sys

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
    write_text(sys.argv[1], schema_text())
