"""The template of ``stiffmap new``."""

from __future__ import annotations

from pathlib import Path


def starter_text(name: str) -> str:
    """Text of a small machine file that loads, with every key explained; ``name`` is the machine's."""
    text = (Path(__file__).parent / "starter.yaml").read_text(encoding="utf-8")
    return text.replace("name: my-machine", f"name: {name}", 1)
