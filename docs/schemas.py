"""Writes the schemas of what commands print with --json: python docs/schemas.py [COMMAND ...]

Each is inferred from the calls in tests/python/project/docs/json_calls.py: types of all values, keys that every call has as `required`.
A key that a newer version adds breaks no reader; one that is gone or of another type is a change that the tests notice.
"""

from __future__ import annotations

import contextlib
import io
import json
import os
import shlex
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
FOLDER = ROOT / "docs/schemas"
DRAFT = "https://json-schema.org/draft/2020-12/schema"


def printed(arguments: Sequence[str]) -> Any:
    """What a call with --json prints."""
    from stiffmap.ui.cli import main

    text = io.StringIO()
    with contextlib.redirect_stdout(text):
        code = main([*arguments, "--json"])
    if code not in (0, 1):
        raise SystemExit(f"stiffmap {' '.join(arguments)} --json: exit code {code}")
    return json.loads(text.getvalue())


def inferred(values: Sequence[Any]) -> dict[str, Any]:
    """Schema that all these values obey."""
    kinds = sorted({_kind(v) for v in values})
    out: dict[str, Any] = {"type": kinds[0] if len(kinds) == 1 else kinds} if kinds else {}
    if items := [i for v in values if isinstance(v, list) for i in v]:
        out["items"] = inferred(items)
    objects = [v for v in values if isinstance(v, dict)]
    if not objects:
        return out
    keys = list(dict.fromkeys(k for o in objects for k in o))
    if keys and (_named(keys) or _disjoint(objects)):
        out["additionalProperties"] = inferred([v for o in objects for v in o.values()])
        return out
    out["properties"] = {k: inferred([o[k] for o in objects if k in o]) for k in keys}
    out["required"] = [k for k in keys if all(k in o for o in objects)]
    return out


def _kind(value: Any) -> str:
    if value is None:
        return "null"
    if isinstance(value, bool):
        return "boolean"
    return {int: "number", float: "number", str: "string", list: "array", dict: "object"}[type(value)]


def _named(keys: list[str]) -> bool:
    """Whether keys are names of a machine's parts rather than words of ours: those differ from machine to machine."""
    return any("." in k for k in keys) or all(len(k) == 1 or k[:1].isdigit() for k in keys)


def _disjoint(objects: list[dict[str, Any]]) -> bool:
    return len(objects) > 1 and not set.intersection(*(set(o) for o in objects)) and all(objects)


def schema_of(name: str, calls: Sequence[str]) -> dict[str, Any]:
    """Published schema of a command: one form for each of its calls."""
    forms = []
    for form in dict.fromkeys(json.dumps(inferred([printed(shlex.split(c))])) for c in calls):
        forms.append(json.loads(form))
    out = _together(forms)
    return {"$schema": DRAFT, "title": f"stiffmap {name} --json", **out}


def _together(forms: list[dict[str, Any]]) -> dict[str, Any]:
    return forms[0] if len(forms) == 1 else {"anyOf": forms}


def main() -> None:
    """Run the calls in a fresh workshop and write the schemas."""
    sys.path.insert(0, str(ROOT))
    from tests.python.project.docs.json_calls import CALLS
    from tests.python.project.docs.test_help import make_workshop

    FOLDER.mkdir(exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        make_workshop(Path(folder))
        os.chdir(folder)
        for name in sys.argv[1:] or CALLS:
            try:
                text = json.dumps(schema_of(name, CALLS[name]), indent=1)
            except SystemExit as refused:
                print(refused, file=sys.stderr)
                continue
            (FOLDER / f"{name}.json").write_text(text + "\n", encoding="utf-8")
            print(name, flush=True)


if __name__ == "__main__":
    main()
