"""Printing that the commands share."""

from __future__ import annotations

import json
from typing import Annotated, Any

import typer

JsonOption = Annotated[bool, typer.Option("--json", help="Print JSON instead of text (SI units).")]


def print_json(data: Any) -> None:
    """JSON on standard output: one document, keys in the order given, no NaN."""
    text = json.dumps(data, indent=2, ensure_ascii=False, allow_nan=False)
    print(text, flush=True)  # a program that reads a pipe waits for it
