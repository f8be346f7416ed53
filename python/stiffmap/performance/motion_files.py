"""Motions as files: a table over time or along a path (CSV), or a described path (YAML), every number with its unit."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from os import PathLike
from pathlib import Path as FilePath
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field
from scipy.interpolate import make_interp_spline

from stiffmap.broadcasting import Floats
from stiffmap.errors import FileError, StiffmapError
from stiffmap.files.report import validated
from stiffmap.files.schema.base import FileModel, Name
from stiffmap.machine import Machine
from stiffmap.number_text import number_in
from stiffmap.performance.quantities import quantity, quantity_in
from stiffmap.performance.trajectory import Path, Trajectory, circle, line, through, timed
from stiffmap.units import name_and_unit
from stiffmap.yaml_text import Document, read

Written = str | float | int
COLUMNS = {"t": "s", "x": "m", "y": "m", "z": "m", "fx": "N", "fy": "N", "fz": "N"}
LEAST_ROWS = 6
"""Of a table over time: its spline of degree 5 wants that many."""


class LineModel(FileModel):
    """Straight path."""

    start: list[Written] = Field(min_length=3, max_length=3)
    end: list[Written] = Field(min_length=3, max_length=3)


class CircleModel(FileModel):
    """One turn."""

    centre: list[Written] = Field(min_length=3, max_length=3)
    radius: Written
    plane: Literal["xy", "xz", "yz"] = "xy"


class MotionFile(FileModel):
    """The keys of a motion file: one of line, circle, points; a duration, or as fast as the drives can."""

    name: Name
    line: LineModel | None = None
    circle: CircleModel | None = None
    points: list[list[Written]] | None = None
    samples: int = Field(default=401, ge=5)
    duration: Written | None = None
    speed: Written | None = None
    force: list[Written] = Field(default=["0 N", "0 N", "0 N"], min_length=3, max_length=3)


@dataclass(frozen=True, eq=False)
class Motion:
    """What a motion file says, SI: a trajectory that is timed already, or a path and how to run it."""

    name: str
    path: Path | None
    timed: Trajectory | None
    duration: float | None
    """s, from rest to rest; None: as fast as the drives can."""
    speed: float
    """m/s, most along the path when it is run as fast as the drives can."""
    force: Floats
    """(3,) N on the tool."""

    def places(self) -> tuple[Floats, Floats]:
        """Positions (n, 3) m along the path and the force (n, 3) N on the tool there."""
        if self.timed is not None:
            return self.timed.position, self.timed.force
        assert self.path is not None
        return self.path.position, np.broadcast_to(self.force, self.path.position.shape)

    def trajectory(
        self, machine: Machine, *, duration: float | None = None, gravity: ArrayLike | None = None
    ) -> Trajectory:
        """The motion over time; `duration` (s) in place of the file's. StiffmapError where it cannot be run."""
        from stiffmap.performance.efforts import fastest

        if self.path is None:
            assert self.timed is not None
            if duration is not None:
                raise StiffmapError(f"{self.name}: the table has times, so no duration can be given")
            return self.timed
        span = self.duration if duration is None else duration
        if span is not None:
            return timed(self.path, span).with_force(self.force)
        run = fastest(machine, self.path, gravity=gravity, speed=self.speed, force=self.force)
        return run.with_force(self.force)


def load_motion(file: str | PathLike[str]) -> Motion:
    """A motion of the tool from a CSV or YAML file, or a shipped one by name: ``trim`` (docs/measures.md).

    CSV: columns ``x [mm]``, ``y [mm]``, ``z [mm]``, perhaps ``fx [N]`` …; with ``t [s]`` a motion over time,
    without it a path. YAML: ``line``, ``circle`` or ``points``, ``duration`` or ``speed``, ``force``.
    Raises FileError naming file, line, what was expected and what was found.
    """
    place = _place(FilePath(file))
    if place.suffix.lower() in (".yaml", ".yml"):
        document = read(place)
        return _described(document, str(place))
    return _table(place)


SHIPPED = FilePath(__file__).with_name("motions")


def _place(given: FilePath) -> FilePath:
    """The file itself, or the shipped one of that name."""
    shipped = SHIPPED / (given.name if given.suffix else f"{given.name}.yaml")
    return shipped if not given.is_file() and len(given.parts) == 1 and shipped.is_file() else given


def near_or_shipped(name: str, folder: FilePath) -> str:
    """What a file in this folder calls its motion: one beside it, else as `load_motion` finds it."""
    near = folder / name
    return str(near) if near.is_file() or not _place(FilePath(name)).is_file() else name


def _described(document: Document, file: str) -> Motion:
    expected = "a motion file is a mapping with name and line, circle or points"
    m = validated(MotionFile, document, file, expected)
    si = partial(quantity_in, document, file)

    def row(values: Sequence[Any], unit: str, *keys: str | int) -> list[float]:
        return [si(v, unit, *keys, i) for i, v in enumerate(values)]

    given = [k for k in ("line", "circle", "points") if getattr(m, k) is not None]
    if len(given) != 1:
        found = " and ".join(given) or "none"
        raise FileError(f"expected one of line, circle, points; found {found}", file=file)
    if m.duration is not None and m.speed is not None:
        raise FileError("give duration or speed, not both", file=file, line=document.line(("speed",)))
    try:
        if m.line is not None:
            start, end = row(m.line.start, "m", "line", "start"), row(m.line.end, "m", "line", "end")
            path = line(start, end, m.samples)
        elif m.circle is not None:
            centre = row(m.circle.centre, "m", "circle", "centre")
            radius = si(m.circle.radius, "m", "circle", "radius")
            path = circle(centre, radius, m.circle.plane, m.samples)
        else:
            path = through([row(p, "m", "points", i) for i, p in enumerate(m.points or [])], m.samples)
    except FileError:
        raise
    except (StiffmapError, ValueError) as error:
        raise FileError(str(error), file=file, line=document.line((given[0],)), key=given[0]) from None
    span = None if m.duration is None else si(m.duration, "s", "duration")
    speed = np.inf if m.speed is None else si(m.speed, "m/s", "speed")
    for name, value in (("duration", span), ("speed", speed)):
        if value is not None and not value > 0:
            raise FileError(f"expected a positive {name}", file=file, line=document.line((name,)), key=name)
    return Motion(m.name, path, None, span, speed, np.array(row(m.force, "N", "force")))


def _table(place: FilePath) -> Motion:
    values, lines = _columns(place)
    file = str(place)
    missing = [c for c in ("x", "y", "z") if c not in values]
    if missing:
        raise FileError(
            f"no column {', '.join(missing)}; expected x [mm], y [mm], z [mm] and perhaps t [s], fx [N], fy [N], fz [N]",
            file=file, line=1,
        )  # fmt: skip
    p = np.stack([values[c] for c in "xyz"], axis=1)
    f = np.stack([values.get(c, np.zeros(len(p))) for c in ("fx", "fy", "fz")], axis=1)
    if "t" not in values:
        if np.ptp(f, axis=0).any():
            raise FileError("forces that vary need times: a column t [s]", file=file, line=1)
        if len(p) < 2:
            raise FileError(f"expected two or more rows, found {len(p)}", file=file)
        return Motion(place.stem, _through(p, file), None, None, np.inf, f[0])
    t = values["t"]
    if len(t) < LEAST_ROWS:
        raise FileError(f"a motion over time needs {LEAST_ROWS} or more rows, found {len(t)}", file=file)
    back = np.flatnonzero(np.diff(t) <= 0)
    if len(back):
        i = int(back[0])
        raise FileError(
            f"times must increase; {t[i + 1]:g} s follows {t[i]:g} s", file=file, line=lines[i + 1]
        )
    spline = make_interp_spline(t, p, k=5)
    motion = Trajectory(t, p, spline(t, 1), spline(t, 2), f)
    return Motion(place.stem, None, motion, None, np.inf, np.zeros(3))


def _through(points: Floats, file: str) -> Path:
    try:
        return through(points)
    except StiffmapError as error:
        raise FileError(str(error), file=file) from None


def _columns(place: FilePath) -> tuple[dict[str, Floats], list[int]]:
    """SI values by column, and the line of each row."""
    file = str(place)
    try:
        with place.open(newline="", encoding="utf-8-sig") as stream:
            reader = csv.reader(stream)
            rows = [(reader.line_num, row) for row in reader if any(cell.strip() for cell in row)]
    except (OSError, UnicodeDecodeError) as error:
        raise FileError(f"cannot be read: {getattr(error, 'strerror', None) or error}", file=file) from error
    if not rows:
        raise FileError("the file is empty", file=file)
    heads = [_head(cell, file, rows[0][0]) for cell in rows[0][1]]
    if len({n for n, _ in heads}) < len(heads):
        raise FileError("a column is there twice", file=file, line=rows[0][0])
    out = np.zeros((len(rows) - 1, len(heads)))
    for i, (number, row) in enumerate(rows[1:]):
        for j, (name, scale) in enumerate(heads):
            text = row[j].strip() if j < len(row) else ""
            try:
                out[i, j] = scale * number_in(text)
            except ValueError:
                raise FileError(
                    f"expected a number, found '{text}'", file=file, line=number, key=name
                ) from None
            if not np.isfinite(out[i, j]):
                raise FileError(f"expected a finite number, found '{text}'", file=file, line=number, key=name)
    return {name: out[:, j] for j, (name, _) in enumerate(heads)}, [number for number, _ in rows[1:]]


def _head(cell: str, file: str, number: int) -> tuple[str, float]:
    head, unit = name_and_unit(cell)
    name = head.lower()
    if name not in COLUMNS:
        raise FileError(
            f"unknown column '{cell.strip()}'; known: {', '.join(COLUMNS)}, each with its unit as in x [mm]",
            file=file, line=number,
        )  # fmt: skip
    if not unit:
        raise FileError(
            f"the unit is missing: write {name} [{_usual(name)}]", file=file, line=number, key=name
        )
    try:
        return name, quantity(f"1 {unit}", COLUMNS[name])
    except StiffmapError as error:
        raise FileError(str(error), file=file, line=number, key=name) from None


def _usual(name: str) -> str:
    return {"m": "mm"}.get(COLUMNS[name], COLUMNS[name])
