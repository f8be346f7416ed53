"""JSON: texts of our data, and texts that others may have written or damaged."""

from __future__ import annotations

import json
from typing import Any

from stiffmap.common.plain import plain


def json_text(data: Any) -> str:
    """Data as JSON: keys in the order given, what is not finite as null."""
    return json.dumps(plain(data), indent=2, ensure_ascii=False, allow_nan=False)


def parse_json(text: str | bytes) -> Any:
    """The data of a text; ValueError for what is no JSON, and for what is nested too deep to be read."""
    try:
        return json.loads(text)
    except RecursionError:
        raise ValueError("nested too deep") from None
