"""Motions as files: a table over time or along a path (CSV), or a described path (YAML), every number with its unit."""

from __future__ import annotations

from dataclasses import dataclass
from os import PathLike
from pathlib import Path as FilePath
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field
from scipy.interpolate import make_interp_spline

from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import FileError, StiffmapError
from stiffmap.common.tables.pose_table import read_pose_table
from stiffmap.common.tables.table_file import refuse_options
from stiffmap.common.yaml_text import Document, read
from stiffmap.model.files.report import validated
from stiffmap.model.files.schema.base import FileModel, Name
from stiffmap.solve.machine import Machine
from stiffmap.workspace.performance.motion.trajectory import (
    Path,
    Trajectory,
    at_feed,
    circle,
    fastest,
    line,
    through,
    timed,
    way_along,
)
from stiffmap.workspace.performance.quantities import Duration, Force, Length, Speed, under

LEAST_ROWS = 6  # of a table over time: its spline of degree 5 wants that many


class LineModel(FileModel):
    """Straight path."""

    start: list[Length] = Field(min_length=3, max_length=3)
    end: list[Length] = Field(min_length=3, max_length=3)


class CircleModel(FileModel):
    """One turn."""

    centre: list[Length] = Field(min_length=3, max_length=3)
    radius: Length
    plane: Literal["xy", "xz", "yz"] = "xy"


class MotionFile(FileModel):
    """The keys of a motion file: one of line, circle, points; a duration, or as fast as the drives can."""

    name: Name
    line: LineModel | None = None
    circle: CircleModel | None = None
    points: list[list[Length]] | None = None
    samples: int = Field(default=401, ge=5)
    duration: Duration | None = None
    speed: Speed | None = None
    force: list[Force] = Field(default=[0.0, 0.0, 0.0], min_length=3, max_length=3)


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
    """(3,) N on the tool, or (n, 3) along the path."""
    feed: float | None = None
    """m/s along the path, all the way; None: as `duration` and `speed` say."""

    def places(self) -> tuple[Floats, Floats]:
        """Positions (n, 3) m along the path and the force (n, 3) N on the tool there."""
        if self.timed is not None:
            return self.timed.position, self.timed.force
        assert self.path is not None
        return self.path.position, np.broadcast_to(self.force, self.path.position.shape)

    def trajectory(
        self,
        machine: Machine,
        *,
        duration: float | None = None,
        gravity: ArrayLike | None = None,
        feed: float | None = None,
    ) -> Trajectory:
        """The motion over time; `duration` (s) or `feed` (m/s, all the way) in place of the file's. StiffmapError where it cannot be run."""
        if self.path is None:
            assert self.timed is not None
            if duration is not None or feed is not None:
                word = "duration" if feed is None else "feed"
                raise StiffmapError(f"{self.name}: the table has times, so no {word} can be given")
            return self.timed
        if duration is not None and feed is not None:
            raise StiffmapError(f"{self.name}: give a duration or a feed, not both")
        span, speed = (self.duration, self.feed) if duration is None and feed is None else (duration, feed)
        if span is not None:
            run = timed(self.path, span)
        elif speed is not None:
            run = at_feed(self.path, speed)
        else:
            run = fastest(machine, self.path, gravity=gravity, speed=self.speed, force=self.force)
        if self.force.ndim == 1:
            return run.with_force(self.force)
        way, own = way_along(run.position), way_along(self.path.position)
        return run.with_force(_between(way / way[-1], own / own[-1], self.force))


def load_motion(file: str | PathLike[str]) -> Motion:
    """A motion of the tool from a CSV or YAML file, or a shipped one by name: ``trim`` (docs/measures.md).

    A table (`stiffmap.common.tables.pose_table`), a `TableFile` as well: columns ``x [mm]``, ``y [mm]``, ``z [mm]``, perhaps ``fx [N]`` …, which may vary; with ``t [s]`` a
    motion over time, with ``feed [mm/min]`` a path at this speed, without either a path. YAML: ``line``, ``circle`` or ``points``, ``duration`` or ``speed``, ``force``.
    Raises FileError naming file, line, what was expected and what was found.
    """
    place = given_or_shipped(FilePath(file), SHIPPED)
    if place.suffix.lower() in (".yaml", ".yml"):
        refuse_options(file, "a motion file")
        document = read(place)
        return _described(document, str(place))
    return _table(file if place == FilePath(file) else place)


SHIPPED = FilePath(__file__).with_name("motions")


def given_or_shipped(given: FilePath, folder: FilePath) -> FilePath:
    """The file itself, or the one of that name that ships in a folder."""
    shipped = folder / (given.name if given.suffix else f"{given.name}.yaml")
    return shipped if not given.is_file() and len(given.parts) == 1 and shipped.is_file() else given


def near_or_shipped(name: str, folder: FilePath) -> str:
    """What a file in this folder calls its motion: one next to it, else as `load_motion` finds it."""
    near = folder / name
    return str(near) if near.is_file() or not given_or_shipped(FilePath(name), SHIPPED).is_file() else name


def _described(document: Document, file: str) -> Motion:
    expected = "a motion file is a mapping with name and line, circle or points"
    m = validated(MotionFile, document, file, expected)
    given = [k for k in ("line", "circle", "points") if getattr(m, k) is not None]
    if len(given) != 1:
        found = " and ".join(given) or "none"
        raise FileError(f"expected one of line, circle, points; found {found}", file=file)
    if m.duration is not None and m.speed is not None:
        raise FileError("give duration or speed, not both", file=file, line=document.line(("speed",)))
    with under(document, file, given[0]):
        if m.line is not None:
            path = line(m.line.start, m.line.end, m.samples)
        elif m.circle is not None:
            path = circle(m.circle.centre, m.circle.radius, m.circle.plane, m.samples)
        else:
            path = through(m.points or [], m.samples)
    speed = np.inf if m.speed is None else m.speed
    return Motion(m.name, path, None, m.duration, speed, np.array(m.force))


def _table(place: str | PathLike[str]) -> Motion:
    table = read_pose_table(place)
    if table.orientation is not None:
        table.fail("expected no orientations: the tool of a motion is turned as at home")
    for name in ("mx", "my", "mz", "rx", "ry", "rz"):
        table.check(name, lambda v: v == 0, "0: a motion has no moment, its tool is turned as at home")
    file, p, f = table.file, table.position, table.wrench[:, :3]
    name = FilePath(place).stem
    feed = table.values.get("feed")
    if "t" not in table.values:
        if len(p) < 2:
            raise FileError(f"expected two or more rows, found {len(p)}", file=file)
        table.check("feed", lambda v: v > 0, "a feed above zero")
        try:
            path = through(p)
        except StiffmapError as error:
            raise FileError(str(error), file=file) from None
        along = way_along(p) / way_along(p)[-1]
        force = f[0] if not np.ptp(f, axis=0).any() else _between(path.s, along, f)
        if feed is None:
            return Motion(name, path, None, None, np.inf, force)
        if np.ptp(feed) > 1e-9 * feed[0]:
            table.fail("expected one feed for the whole path (or times, a column t [s])", "feed")
        return Motion(name, path, None, None, np.inf, force, feed=float(feed[0]))
    t = table.values["t"]
    if feed is not None:
        table.fail("give times or a feed, not both")
    if len(t) < LEAST_ROWS:
        raise FileError(f"a motion over time needs {LEAST_ROWS} or more rows, found {len(t)}", file=file)
    back = np.flatnonzero(np.diff(t) <= 0)
    if len(back):
        i = int(back[0])
        table.fail(f"times must increase; {t[i + 1]:g} s follows {t[i]:g} s", "t", i + 1)
    spline = make_interp_spline(t, p, k=5)
    motion = Trajectory(t, p, spline(t, 1), spline(t, 2), f)
    return Motion(name, None, motion, None, np.inf, np.zeros(3))


def _between(s: Floats, at: Floats, values: Floats) -> Floats:
    """(n, 3) values given at some places of a path, straight between them."""
    return np.stack([np.interp(s, at, v) for v in values.T], axis=1)
