"""Writes the schemas of what commands print with --json: python docs/schemas.py [COMMAND ...]

Each is inferred from the calls in tests/python/project/docs/json_calls.py: types of all values, keys that every call has as `required`.
Objects whose keys are names of parts, channels or columns stand in MAPS there: their keys are the reader's.
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
from fnmatch import fnmatchcase
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


def inferred(values: Sequence[Any], maps: Sequence[str] = (), at: str = "") -> dict[str, Any]:
    """Schema that all these values obey; ``maps`` are the places of objects whose keys are names of the reader's own things.

    Null is allowed everywhere: it stands for what could not be computed.
    """
    kinds = sorted({_kind(v) for v in values} - {"null"})
    out: dict[str, Any] = {"type": [*kinds, "null"]} if kinds else {}
    if items := [i for v in values if isinstance(v, list) for i in v]:
        out["items"] = inferred(items, maps, f"{at}[]")
    objects = [v for v in values if isinstance(v, dict)]
    if not objects:
        return out
    if any(fnmatchcase(at, place.replace("[", "[[]")) for place in maps):
        out["additionalProperties"] = inferred([v for o in objects for v in o.values()], maps, f"{at}.*")
        return out
    keys = dict.fromkeys(k for o in objects for k in o)
    out["properties"] = {k: inferred([o[k] for o in objects if k in o], maps, f"{at}.{k}") for k in keys}
    out["required"] = [k for k in keys if all(k in o for o in objects)]
    return out


def _kind(value: Any) -> str:
    if value is None:
        return "null"
    if isinstance(value, bool):
        return "boolean"
    return {int: "number", float: "number", str: "string", list: "array", dict: "object"}[type(value)]


def schema_of(name: str, documents: Sequence[Any]) -> dict[str, Any]:
    """Published schema of a command from what its calls print: one form for each set of keys."""
    from tests.python.project.docs.json_calls import MAPS

    forms: dict[Any, list[Any]] = {}
    for document in documents:
        forms.setdefault(frozenset(document) if isinstance(document, dict) else None, []).append(document)
    found = [inferred(alike, MAPS.get(name, ())) for alike in forms.values()]
    out = found[0] if len(found) == 1 else {"anyOf": found}
    return {"$schema": DRAFT, "title": f"stiffmap {name} --json", **out}


def main() -> None:
    """Run the calls in a fresh workshop and write the schemas."""
    sys.path.insert(0, str(ROOT))
    from tests.python.project.docs.json_calls import CALLS
    from tests.python.project.docs.test_help import make_workshop

    from stiffmap.ui.view.open import View

    View.wait = View.close  # type: ignore[method-assign]  # serves until it is interrupted
    FOLDER.mkdir(exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        make_workshop(Path(folder))
        os.chdir(folder)
        for name in sys.argv[1:] or CALLS:
            try:
                text = json.dumps(
                    schema_of(name, [printed(shlex.split(call)) for call in CALLS[name]]), indent=1
                )
            except SystemExit as refused:
                print(refused, file=sys.stderr)
                continue
            (FOLDER / f"{name}.json").write_text(text + "\n", encoding="utf-8")
            print(name, flush=True)


if __name__ == "__main__":
    main()
