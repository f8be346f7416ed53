"""JSON: texts of our data, and texts that others may have written or damaged."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Mapping
from dataclasses import asdict, is_dataclass
from typing import Any

import numpy as np


def plain(value: object) -> Any:
    """Data that JSON can hold: arrays as lists, paths as text, what is not finite as null."""
    if is_dataclass(value) and not isinstance(value, type):
        return {k: plain(v) for k, v in asdict(value).items()}
    if isinstance(value, Mapping):
        return {str(k): plain(v) for k, v in value.items()}
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    if isinstance(value, (list, tuple)):
        return [plain(v) for v in value]
    if isinstance(value, (np.ndarray, np.generic)):
        return plain(value.tolist())
    return None if isinstance(value, float) and not math.isfinite(value) else value


def json_text(data: object) -> str:
    """Data as JSON: keys in the order given, what is not finite as null."""
    return json.dumps(plain(data), indent=2, ensure_ascii=False, allow_nan=False)


def parse_json(text: str | bytes) -> Any:
    """The data of a text; ValueError for what is no JSON, and for what is nested too deep to be read."""
    try:
        return json.loads(text)
    except RecursionError:
        raise ValueError("nested too deep") from None
