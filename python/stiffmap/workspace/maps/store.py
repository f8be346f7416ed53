"""Where a map grows: in memory, in a folder of plain arrays that an interrupted run leaves behind, or in a Zarr folder, a chunk of every
variable per tile, which survives being killed.

While a Zarr map grows, its folder is called ``NAME.zarr.partial``. A tile is done where all of its chunks are there, each of which
holds its checksum; zarr puts a chunk in its place when it is whole. The finished folder's bytes don't depend on interruptions, threads
or the order of the tiles.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import cached_property, partial, reduce
from operator import getitem
from pathlib import Path
from tempfile import TemporaryDirectory
from tokenize import TokenError
from typing import Any

import numpy as np
import xarray as xr
from numpy.lib.format import open_memmap
from numpy.typing import NDArray

from stiffmap.common.errors import FileError, StiffmapError
from stiffmap.common.json_text import parse_json
from stiffmap.common.outputs import mapped_array, put_folder, write_text
from stiffmap.workspace.maps.files import onto_disk, write_zarr, zarr_package
from stiffmap.workspace.maps.plan import MapPlan

WORDS = {"machine_digest": "the machine's description", "stiffmap_version": "the version of stiffmap"}
LEFT_OUT = (
    "coordinates", "title", "machine_title", "effects", "extremes_method", "turning_force", "turning_force_N",
)  # fmt: skip
"""What follows from another attribute."""
LONG = 60


def refuse_another_map(wanted: Mapping[str, object], path: Path, *keys: str) -> None:
    """StiffmapError, by what differs, where an unfinished map is not the one wanted: its attributes are in a JSON file, under
    these keys. FileError where the file is damaged."""
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
    old, new = _flat(kept), _flat(wanted)
    names = [n for n in {**old, **new} if old.get(n) != new.get(n)]
    if names:
        found = "; ".join(f"{WORDS.get(n, n)} {_both(old.get(n), new.get(n))}" for n in names)
        raise StiffmapError(
            f"{path.parent}: holds part of another map: {found}; delete it, or choose another file"
        )


def _flat(attrs: Mapping[str, object]) -> dict[str, object]:
    plain = json.loads(json.dumps(dict(attrs), default=lambda v: v.tolist()))
    call = json.loads(plain.pop("call", "{}"))
    return {k: v for k, v in {**plain, **call}.items() if k not in LEFT_OUT}


def _both(old: object, new: object) -> str:
    if isinstance(old, list) and isinstance(new, list) and old and new and not isinstance(old[0], list):
        return f"was {len(old)} numbers from {old[0]} to {old[-1]}, is {len(new)} from {new[0]} to {new[-1]}"
    texts = [json.dumps(v, ensure_ascii=False) for v in (old, new)]
    return "differs" if max(map(len, texts)) > LONG else f"was {texts[0]}, is {texts[1]}"


UNREADABLE = (OSError, ValueError, TypeError, SyntaxError, TokenError)
"""What numpy raises for a damaged array: its header is Python's text."""


class Store:
    """Arrays (rows, x, ...) of all variables, and which rows are done."""

    def __init__(self, arrays: dict[str, np.ndarray], done: NDArray[np.bool_]) -> None:
        self.arrays, self.done = arrays, done

    def put(self, rows: slice, values: dict[str, np.ndarray]) -> None:
        """Keep some rows; they count as done only once their values are on the disk."""
        for name, new in values.items():
            target = self.arrays[name][rows]
            target[...] = new.reshape(target.shape)
            _flush(self.arrays[name])
        self.done[rows] = True
        _flush(self.done)


def _flush(array: np.ndarray) -> None:
    if isinstance(array, np.memmap):
        array.flush()


def memory_store(plan: MapPlan) -> Store:
    """A map that lives in memory."""
    return _store(plan, lambda _, dtype, shape: np.zeros(shape, dtype))


def folder_store(plan: MapPlan, folder: Path, resume: bool) -> Store:
    """A map that lives in a folder; taken up again where an earlier run of the same call left it."""
    key = folder / "key.json"
    if resume and key.exists():
        refuse_another_map(plan.attrs, key)
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


GROUP = "zarr.json"
FILL = {"u1": 255, "u4": 0, "f8": np.nan}


class ZarrMap:
    """An unfinished map on the disk; `open_zarr_map` makes it."""

    def __init__(self, plan: MapPlan, folder: Path) -> None:
        self.plan, self.folder = plan, folder
        self.done: NDArray[np.bool_] = np.zeros(plan.rows, dtype=bool)

    def put(self, tile: slice, values: dict[str, np.ndarray]) -> None:
        """Write a tile's chunks. FileError where the disk refuses."""
        done = [bool(self.done[rows].all()) for rows in self.plan.tiles]
        kept = f"; {sum(done)} of {len(done)} tiles are kept, resume=True (--resume) goes on with them"
        with onto_disk(self.folder, kept):
            for name, array in values.items():
                self._arrays[name][self.plan.place(tile)] = array
        self.done[tile] = True

    def chunk(self, name: str, tile: slice) -> Path:
        """File of a variable's chunk."""
        plane, y = self.plan.place(tile)
        tail = ["0"] * (1 + len(self._arrays[name].shape) - 3)
        return self.folder.joinpath(name, "c", str(plane), str(y.start // self.plan.tile_height), *tail)

    @cached_property
    def _arrays(self) -> Any:
        package = zarr_package()
        # Also chunks of nothing but fill values: a chunk that is missing is one that is not done.
        with package.config.set({"array.write_empty_chunks": True}):
            group = package.open_group(self.folder, mode="r+", zarr_format=3)
            return {v.name: group[v.name] for v in self.plan.variables}

    def finish(self, out: Path) -> None:
        """Put the complete map in its place."""
        put_folder(self.folder, out)

    def frame(self, folder: Path) -> None:
        """Write the empty map: metadata and coordinates."""
        package = zarr_package()
        write_zarr(xr.Dataset(coords=self.plan.coords, attrs=self.plan.attrs), folder)
        group = package.open_group(folder, mode="r+", zarr_format=3)
        from zarr.codecs import Crc32cCodec, ZstdCodec

        for v in self.plan.variables:
            tail = self.plan.tail(v)
            group.create_array(
                v.name, shape=(*self.plan.shape, *tail), chunks=(1, self.plan.tile_height, self.plan.x.size, *tail), dtype=v.dtype,
                fill_value=FILL[v.dtype], compressors=[ZstdCodec(level=1), Crc32cCodec()], dimension_names=self.plan.dims(v),
                attributes={k: a.tolist() if isinstance(a, np.ndarray) else a for k, a in v.attrs.items()},
            )  # fmt: skip

    def recover(self, frame: Path) -> None:
        """Take up what an earlier run left; metadata and coordinates that are damaged are those of the empty map again.

        StiffmapError where it belongs to another map, FileError for a chunk that is damaged.
        """
        refuse_another_map(self.plan.attrs, self.folder / GROUP, "attributes")
        for path in frame.rglob("*"):
            target = self.folder / path.relative_to(frame)
            if path.is_file() and not (target.is_file() and target.read_bytes() == path.read_bytes()):
                target.parent.mkdir(parents=True, exist_ok=True)
                shutil.copyfile(path, target)
        for scrap in self.folder.rglob("*.partial"):  # chunks that zarr had not put in their place
            scrap.unlink()
        for tile in self.plan.tiles:
            chunks = {n: self.chunk(n, tile) for n in self._arrays}
            self.done[tile] = there = all(path.exists() for path in chunks.values())
            for name, path in chunks.items() if there else ():
                try:
                    self._arrays[name][self.plan.place(tile)]
                except Exception as error:  # whatever zarr meets in it
                    raise FileError(
                        f"is damaged: {error}; delete this chunk, and resume=True (--resume) computes it again",
                        file=str(path),
                    ) from error


def open_zarr_map(plan: MapPlan, folder: Path, resume: bool) -> ZarrMap:
    """The unfinished map in `folder`, new or taken up."""
    zarr_package()
    out = ZarrMap(plan, folder)
    with onto_disk(folder), TemporaryDirectory(dir=folder.parent, prefix=f"{folder.name}.") as place:
        frame = Path(place) / "frame"
        out.frame(frame)
        if resume and (folder / GROUP).exists():
            out.recover(frame)
        else:
            shutil.rmtree(folder)
            frame.rename(folder)
    return out
