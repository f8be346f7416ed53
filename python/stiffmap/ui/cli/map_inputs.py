"""What the text of ``stiffmap map`` asks for: axes, forces, formats."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from stiffmap.common.errors import StiffmapError
from stiffmap.solve.machine import Machine
from stiffmap.ui.cli.inputs import MM, force_given
from stiffmap.workspace.maps.inputs import magnitude, plane_axes
from stiffmap.workspace.maps.workspace_grid import grid_of


def grid(machine: Machine, planes: dict[str, list[float] | None], points: int) -> dict[str, Any]:
    """Axes (m) over the workspace box; a coordinate that is not commanded has one value, its home."""
    given = {a: MM * np.array(v) for a, v in planes.items() if v}
    if len(given) > 1:
        raise StiffmapError(f"--{' and --'.join(given)}: expected planes across one axis")
    return grid_of(machine, given, points)


def named_formats(text: str, option: str, known: Sequence[str]) -> list[str]:
    """Endings of files, separated by commas."""
    kinds = [k.strip().lower() for k in text.split(",")]
    if not set(kinds) <= set(known):
        several = ",".join(known[:2])
        raise StiffmapError(f"{option}: expected {', '.join(known)}, or several as {several}; got '{text}'")
    return kinds


def cases(plane: str, text: str) -> dict[str, list[float]]:
    """The force that is given as a vector; of a size, forces along the axes of the plane."""
    size, vector = force_given(text)
    magnitude(size, "--force", "N")
    if vector is not None:
        return {"F": [*vector, 0.0, 0.0, 0.0]}
    return {f"F{'xyz'[i]}": [size if k == i else 0.0 for k in range(6)] for i in plane_axes(plane)}
