"""Numbers as they are written in tables and on command lines."""

from __future__ import annotations


def number_in(text: str) -> float:
    """The number that a text is; ValueError for what only Python takes for one: ``1_0``, digits of other scripts."""
    if "_" in text or not text.isascii():
        raise ValueError(f"could not convert string to float: {text!r}")
    return float(text)
