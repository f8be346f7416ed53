"""Where a map grows: in memory, or in a folder of plain arrays that an interrupted run leaves behind."""

from __future__ import annotations

import json
from pathlib import Path
from tokenize import TokenError
from typing import Any

import numpy as np
from numpy.lib.format import open_memmap
from numpy.typing import NDArray

from stiffmap.common.errors import FileError
from stiffmap.common.outputs import mapped_array, write_text
from stiffmap.workspace.maps.differences import kept_attributes, refuse_another_map
from stiffmap.workspace.maps.plan import MapPlan

BLOCKS_PER_FLUSH = 32
"""Blocks that a power cut may cost; writing back after each would take a third of the time."""
UNREADABLE = (OSError, ValueError, TypeError, SyntaxError, TokenError)
"""What numpy raises for a damaged array: its header is Python's text."""
FILL = {"u1": 255, "u4": 0, "f8": np.nan}


class Store:
    """Arrays (rows, x, ...) of all variables, and which rows are done."""

    def __init__(self, arrays: dict[str, Any], done: NDArray[np.bool_]) -> None:
        self.arrays, self.done = arrays, done
        self._waiting: list[slice] = []

    def put(self, rows: slice, block: dict[str, Any]) -> None:
        """Keep a block."""
        for name, values in block.items():
            target = self.arrays[name][rows]
            target[...] = values.reshape(target.shape)
        self._waiting.append(rows)
        if len(self._waiting) >= BLOCKS_PER_FLUSH:
            self.flush()

    def flush(self) -> None:
        """Rows count as done only once their values are on the disk."""
        for array in self.arrays.values():
            flush(array)
        for rows in self._waiting:
            self.done[rows] = True
        flush(self.done)
        self._waiting.clear()


def flush(array: Any) -> None:
    """Write a mapped array back; plain ones have nothing to write."""
    if isinstance(array, np.memmap):
        array.flush()


def memory_store(plan: MapPlan) -> Store:
    """A map that lives in memory."""
    arrays = {
        v.name: np.full((plan.rows, plan.x.size, *plan.tail(v)), FILL[v.dtype], v.dtype)
        for v in plan.variables
    }
    return Store(arrays, np.zeros(plan.rows, dtype=bool))


def folder_store(plan: MapPlan, folder: Path, resume: bool) -> Store:
    """A map that lives in a folder; taken up again where an earlier run of the same call left it."""
    key = folder / "key.json"
    if not (resume and key.exists()):
        return _new(plan, folder, json.dumps(plan.attrs, sort_keys=True, default=lambda v: v.tolist()))
    refuse_another_map(folder, kept_attributes(key), plan.attrs)
    return _mapped(plan, folder, "r+")


def _new(plan: MapPlan, folder: Path, key: str) -> Store:
    (folder / "key.json").unlink(missing_ok=True)
    store = _mapped(plan, folder, "w+")
    write_text(folder / "key.json", key)
    return store


def _mapped(plan: MapPlan, folder: Path, mode: Any) -> Store:
    def array(name: str, dtype: str, shape: tuple[int, ...]) -> Any:
        if mode == "w+":
            return mapped_array(folder / f"{name}.npy", dtype, shape)
        path = folder / f"{name}.npy"
        try:
            kept = open_memmap(path, mode)
        except UNREADABLE as error:
            raise _damaged(path, shape, "none") from error
        if (kept.shape, kept.dtype) != (shape, np.dtype(dtype)):
            raise _damaged(path, shape, f"{kept.shape} {kept.dtype}")
        return kept

    arrays = {v.name: array(v.name, v.dtype, (plan.rows, plan.x.size, *plan.tail(v))) for v in plan.variables}
    return Store(arrays, array("done", "?", (plan.rows,)))


def _damaged(path: Path, shape: tuple[int, ...], found: str) -> FileError:
    return FileError(
        f"is damaged: expected an array {shape} of an unfinished map, found {found}; start again without resume "
        "(--resume)",
        file=str(path),
    )
