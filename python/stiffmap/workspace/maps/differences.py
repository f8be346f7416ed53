"""In what two maps differ, for the message that refuses to mix them."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from stiffmap.common.errors import FileError, StiffmapError
from stiffmap.common.json_text import parse_json

WORDS = {"machine_digest": "the machine's description", "stiffmap_version": "the version of stiffmap"}
LEFT_OUT = (
    "coordinates",
    "title",
    "machine_title",
    "effects",
    "extremes_method",
    "turning_force",
    "turning_force_N",
)
"""What follows from another attribute."""
LONG = 60


def kept_attributes(path: Path, attributes: Callable[[Any], Any] = lambda whole: whole) -> dict[str, Any]:
    """Attributes of an unfinished map in a JSON file, where `attributes` finds them; FileError where it is damaged."""
    try:
        kept = attributes(parse_json(path.read_bytes()))
        if not isinstance(kept, dict) or not isinstance(parse_json(kept["call"]), dict):
            raise TypeError
    except (OSError, ValueError, LookupError, TypeError) as error:
        raise FileError(
            "is damaged: expected the attributes of an unfinished map; without them it is unknown whose values "
            "these are: start again without resume (--resume)",
            file=str(path),
        ) from error
    return kept


def refuse_another_map(folder: Path, kept: Mapping[str, Any], wanted: Mapping[str, Any]) -> None:
    """StiffmapError, by what differs, where an unfinished map in `folder` is not the one wanted."""
    found = difference(kept, wanted)
    if found:
        raise StiffmapError(
            f"{folder}: holds part of another map: {found}; delete it, or choose another file"
        )


def difference(kept: Mapping[str, Any], wanted: Mapping[str, Any]) -> str:
    """What differs between the attributes of two maps, in words; empty: nothing."""
    old, new = _flat(kept), _flat(wanted)
    names = [n for n in {**old, **new} if old.get(n) != new.get(n)]
    return "; ".join(f"{WORDS.get(n, n)} {_both(old.get(n), new.get(n))}" for n in names)


def _flat(attrs: Mapping[str, Any]) -> dict[str, Any]:
    plain = json.loads(json.dumps(dict(attrs), default=lambda v: v.tolist()))
    call = json.loads(plain.pop("call", "{}"))
    return {k: v for k, v in {**plain, **call}.items() if k not in LEFT_OUT}


def _both(old: Any, new: Any) -> str:
    if isinstance(old, list) and isinstance(new, list) and old and new and not isinstance(old[0], list):
        return f"was {len(old)} numbers from {old[0]} to {old[-1]}, is {len(new)} from {new[0]} to {new[-1]}"
    texts = [json.dumps(v, ensure_ascii=False) for v in (old, new)]
    return "differs" if max(map(len, texts)) > LONG else f"was {texts[0]}, is {texts[1]}"
