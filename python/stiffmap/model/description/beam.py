"""What a beam spring was computed from, kept next to its compliance."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class BeamNumbers:
    """Numbers (SI) of a beam along a local axis by their keys in a machine file: ``length``, ``tube.outer``, ``material.E``, ``EA`` …"""

    along: str
    numbers: tuple[tuple[str, float], ...]
