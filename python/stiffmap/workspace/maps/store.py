"""Where a map grows: in memory, or in a folder of plain arrays that an interrupted run leaves behind."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import partial, reduce
from operator import getitem
from pathlib import Path
from tokenize import TokenError

import numpy as np
from numpy.lib.format import open_memmap
from numpy.typing import NDArray

from stiffmap.common.errors import FileError, StiffmapError
from stiffmap.common.json_text import parse_json
from stiffmap.common.outputs import mapped_array, write_text
from stiffmap.workspace.maps.plan import MapPlan

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


def kept_attributes(path: Path, *keys: str) -> dict[str, object]:
    """Attributes of an unfinished map in a JSON file, under these keys; FileError where it is damaged."""
    try:
        kept = reduce(getitem, keys, parse_json(path.read_bytes()))
        if not isinstance(kept, dict) or not isinstance(parse_json(kept["call"]), dict):
            raise TypeError
    except (OSError, ValueError, LookupError, TypeError) as error:
        raise FileError(
            "is damaged: expected the attributes of an unfinished map; without them it is unknown whose values "
            "these are: start again without resume (--resume)",
            file=str(path),
        ) from error
    return kept


def refuse_another_map(folder: Path, kept: Mapping[str, object], wanted: Mapping[str, object]) -> None:
    """StiffmapError, by what differs, where an unfinished map in `folder` is not the one wanted."""
    found = difference(kept, wanted)
    if found:
        raise StiffmapError(
            f"{folder}: holds part of another map: {found}; delete it, or choose another file"
        )


def difference(kept: Mapping[str, object], wanted: Mapping[str, object]) -> str:
    """What differs between the attributes of two maps, in words; empty: nothing."""
    old, new = _flat(kept), _flat(wanted)
    names = [n for n in {**old, **new} if old.get(n) != new.get(n)]
    return "; ".join(f"{WORDS.get(n, n)} {_both(old.get(n), new.get(n))}" for n in names)


def _flat(attrs: Mapping[str, object]) -> dict[str, object]:
    plain = json.loads(json.dumps(dict(attrs), default=lambda v: v.tolist()))
    call = json.loads(plain.pop("call", "{}"))
    return {k: v for k, v in {**plain, **call}.items() if k not in LEFT_OUT}


def _both(old: object, new: object) -> str:
    if isinstance(old, list) and isinstance(new, list) and old and new and not isinstance(old[0], list):
        return f"was {len(old)} numbers from {old[0]} to {old[-1]}, is {len(new)} from {new[0]} to {new[-1]}"
    texts = [json.dumps(v, ensure_ascii=False) for v in (old, new)]
    return "differs" if max(map(len, texts)) > LONG else f"was {texts[0]}, is {texts[1]}"


BLOCKS_PER_FLUSH = 32
"""Blocks that a power cut may cost; writing back after each would take a third of the time."""
UNREADABLE = (OSError, ValueError, TypeError, SyntaxError, TokenError)
"""What numpy raises for a damaged array: its header is Python's text."""


class Store:
    """Arrays (rows, x, ...) of all variables, and which rows are done."""

    def __init__(self, arrays: dict[str, np.ndarray], done: NDArray[np.bool_]) -> None:
        self.arrays, self.done = arrays, done
        self._waiting: list[slice] = []

    def put(self, rows: slice, block: dict[str, np.ndarray]) -> None:
        """Keep a block."""
        for name, values in block.items():
            target = self.arrays[name][rows]
            target[...] = values.reshape(target.shape)
        self._waiting.append(rows)
        if len(self._waiting) >= BLOCKS_PER_FLUSH:
            self.flush()

    def flush(self) -> None:
        """Rows count as done only once their values are on the disk."""
        mapped = [a for a in self.arrays.values() if isinstance(a, np.memmap)]
        for array in mapped:
            array.flush()
        for rows in self._waiting:
            self.done[rows] = True
        if isinstance(self.done, np.memmap):
            self.done.flush()
        self._waiting.clear()


def memory_store(plan: MapPlan) -> Store:
    """A map that lives in memory."""
    return _store(plan, lambda _, dtype, shape: np.zeros(shape, dtype))


def folder_store(plan: MapPlan, folder: Path, resume: bool) -> Store:
    """A map that lives in a folder; taken up again where an earlier run of the same call left it."""
    key = folder / "key.json"
    if resume and key.exists():
        refuse_another_map(folder, kept_attributes(key), plan.attrs)
        return _store(plan, partial(_kept, folder))
    key.unlink(missing_ok=True)
    store = _store(plan, lambda name, dtype, shape: mapped_array(folder / f"{name}.npy", dtype, shape))
    write_text(key, json.dumps(plan.attrs, sort_keys=True, default=np.ndarray.tolist))
    return store


def _store(plan: MapPlan, array: Callable[[str, str, tuple[int, ...]], np.ndarray]) -> Store:
    """Arrays are made, or found, by name, type and shape."""
    shape = (plan.rows, plan.x.size)
    arrays = {v.name: array(v.name, v.dtype, (*shape, *plan.tail(v))) for v in plan.variables}
    return Store(arrays, array("done", "?", shape[:1]))


def _kept(folder: Path, name: str, dtype: str, shape: tuple[int, ...]) -> np.ndarray:
    """The array that an earlier run left; FileError where it is none of this map."""
    path, found = folder / f"{name}.npy", "none"
    with suppress(*UNREADABLE):
        kept = open_memmap(path, "r+")
        if (kept.shape, kept.dtype) == (shape, np.dtype(dtype)):
            return kept
        found = f"{kept.shape} {kept.dtype}"
    raise FileError(
        f"is damaged: expected an array {shape} of an unfinished map, found {found}; start again without resume "
        "(--resume)",
        file=str(path),
    )
