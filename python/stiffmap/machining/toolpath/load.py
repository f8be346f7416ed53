"""Paths by built-in name or from a file."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from math import pi
from os import PathLike
from pathlib import Path

from stiffmap.common.errors import FileError
from stiffmap.machining.toolpath.gcode.load import load_gcode
from stiffmap.machining.toolpath.outlines import outline, outline_names
from stiffmap.machining.toolpath.path import Toolpath
from stiffmap.machining.toolpath.tables import read_cl, read_points
from stiffmap.model.files.schema.base import suggestion

GCODE = (".ngc", ".nc", ".gcode", ".tap", ".cnc", ".mpf", ".g")
CL = (".cl", ".cls", ".apt", ".cldata", ".aptsource")


def load_path(
    name_or_file: str | PathLike[str],
    *,
    size: tuple[float, ...] | None = None,
    feed: float | None = None,
    spindle: float | None = None,
    offsets: Mapping[str, Sequence[float]] | None = None,
    progress: Callable[[int], None] | None = None,
) -> Toolpath:
    """A built-in outline by name (washbasin, bathtub, rectangle, circle, pocket; size in m), or a file: G-code (.ngc …),
    a CL file of APT (.cl, .apt …) or a table of points (.csv).

    feed (m/s) and spindle (rad/s): of a built-in outline. offsets: work offsets of G-code by name, m. progress: called with the number of lines read. Raises FileError.
    """
    if str(name_or_file) in outline_names():
        speeds = {"feed": feed, "rpm": None if spindle is None else spindle * 30 / pi}
        return outline(str(name_or_file), size, **{k: v for k, v in speeds.items() if v is not None})
    path = Path(name_or_file)
    if not path.is_file():
        raise FileError(
            f"no such file, and no built-in outline of that name{suggestion(path.stem, outline_names())}; "
            f"these are: {', '.join(outline_names())}",
            file=str(name_or_file),
        )
    if size is not None:
        raise FileError("size: only a built-in outline takes one", file=str(path))
    suffix = path.suffix.lower()
    if suffix in GCODE:
        return load_gcode(path, offsets=offsets, progress=progress)
    if suffix in CL:
        return read_cl(path)
    if suffix == ".csv":
        return read_points(path)
    known = ", ".join((*GCODE, *CL, ".csv"))
    raise FileError(f"unknown kind of path {suffix!r}; known: {known}", file=str(path))
