"""A validated experiment: what was commanded, what pulled, what was read."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from stiffmap.common.broadcasting import Floats, Integers, one_of, refused, trailing
from stiffmap.common.errors import StiffmapError
from stiffmap.common.short import short_repr
from stiffmap.experiment.channels import AXES, AXIS_CHANNELS, Channel
from stiffmap.experiment.notebook import experiment_html
from stiffmap.experiment.ramps import directions

__all__ = ["AXES", "BRANCHES", "WRENCH", "Channel", "Experiment", "Floats", "Integers", "Loop"]

WRENCH = ("fx", "fy", "fz", "mx", "my", "mz")
ASKED = tuple(f"{c}_cmd" for c in WRENCH)
"""Columns of loads that were commanded, in addition to those that were measured."""
BRANCHES = ("", "loading", "unloading")
PER_ROW = (
    *("ids", "position", "wrench", "reading", "sigma", "rotation", "other", "other_rotation", "command"),
    *("approach", "repeat", "order", "hours", "temperature", "branch", "setup", "points", "load_points"),
    *("joints", "near", "other_command", "other_joints", "gravity_of", "instrument", "target"),
    *("seen", "seen_rotation", "asked"),
)
"""Fields with one entry per row; None or empty where the experiment has none."""
Quantity = Literal["deflection", "position"]
Unloaded = Literal["centre", "approach", "unknown"]
HowKnown = Literal["known", "offset_unknown", "unknown"]
WORDS = {"quantity": Quantity, "unloaded": Unloaded, "surface": HowKnown, "frame": HowKnown, "tool": HowKnown}
"""Fields that are one of some words."""


@dataclass(frozen=True)
class Loop:
    """Metrology loop: decides whether base, fixture or holder compliance can be seen.

    instrument_on, force_against
        ``floor``, ``base`` or a named point of the body that carries the instrument, or takes the
        reaction of the force.
    target_on
        ``tool`` or ``platform`` (before the tool's holder).
    """

    instrument_on: str = "floor"
    target_on: str = "tool"
    force_against: str = "floor"


@short_repr
@dataclass(frozen=True, eq=False)
class Experiment:
    """Rows of one experiment, SI, base axes. n rows, c channels; wrenches as in `WRENCH`.

    ``deflection``: loaded minus unloaded reading at the same commanded pose.
    ``position``: measured minus commanded.

    Raises StiffmapError for a field that has not one entry for each row, for an unknown word and for noise below 0.
    """

    name: str
    machine: str
    quantity: str
    ids: tuple[str, ...]
    position: Floats
    """(n, 3) m, commanded TCP; NaN until `located` where actuator coordinates are commanded."""
    wrench: Floats
    """(n, 6) N, N·m at the load point."""
    reading: Floats
    """(n, c) m, rad; NaN where nothing was read. The six `AXES`, then `extra`."""
    sigma: Floats
    """(n, c) declared standard deviation of one reading; NaN where none is declared."""
    asked: Floats | None = None
    """(n, 6) N, N·m: the wrench that was commanded where `wrench` was measured; NaN where none was."""
    extra: tuple[Channel, ...] = ()
    """Channels after the six axes: kinds of readings, joint coordinates."""
    rotation: Floats | None = None
    """(n, 3, 3) commanded orientation, of the TCP or against home; None: as at home."""
    other: Floats | None = None
    """(n, 3) m, second commanded pose of a distance; NaN where a row reads none."""
    other_rotation: Floats | None = None
    rotation_against: str = "base"
    """``base``: rotations are those of the TCP; ``home``: R = rotation · R_home (as files say, `located`
    resolves it)."""
    command: Floats | None = None
    """(n, actuators) m, rad: commanded coordinates instead of poses, in the order of `command_of`."""
    command_of: tuple[Channel, ...] = ()
    joints: Floats | None = None
    """(n, j) m, rad: coordinates of `joint_names` of the rigid machine at `command`, once `located`."""
    joint_names: tuple[str, ...] = ()
    near: Floats | None = None
    """(n, j): where all coordinates `near_names` of the declared rigid machine stand, for machines near it to close
    from; None: from home."""
    near_names: tuple[str, ...] = ()
    other_command: Floats | None = None
    """(n, actuators): second command of a distance."""
    other_joints: Floats | None = None
    seen: Floats | None = None
    """(n, 3) m: coordinates of the target in the instrument's own frame; NaN where not seen."""
    seen_rotation: Floats | None = None
    """(n, 3, 3) of the target in the instrument's own frame."""
    absolute: Mapping[str, Floats] = field(default_factory=dict)
    """(n,) readings in coordinates of their own by the name of their channel, as a distance; NaN where unread."""
    normal: tuple[float, float, float] = (0.0, 0.0, 1.0)
    """Of the surface that heights are measured against, base axes."""
    surface: str = "known"
    """The surface: ``known``, its height ``offset_unknown``, or ``unknown`` with two tilts; per set-up."""
    anchor: tuple[float, float, float] | None = None
    """m, base axes, from which lengths are read; None: unknown, per set-up."""
    instrument: tuple[str, ...] = ()
    """Instrument of each row; each has a frame of its own."""
    target: tuple[str, ...] = ()
    """Target of each row; each sits at a place of its own on the tool. Empty: one per set-up."""
    gravity_of: Floats | None = None
    """(n, 3) m/s² where gravity differs from row to row, base axes; else `gravity`."""
    registration: tuple[tuple[str, Floats, Floats], ...] = ()
    """Frames and tools that `resolved` found: name, rotation (3, 3), translation (3,) m."""
    out_of_reach: tuple[str, ...] = ()
    """Rows that the declared machine has no state for, set aside by `located` and `Predictor`."""
    approach: Floats | None = None
    """(n, 3) direction of the last travel to the pose, any length; zero where unknown."""
    repeat: Integers | None = None
    order: Floats | None = None
    """(n,) order of measurement; only differences count."""
    hours: Floats | None = None
    """(n,) h, when each row was read; only differences count."""
    temperature: Floats | None = None
    """(n,) °C or K; only differences to `reference_temperature` count."""
    reference_temperature: float | None = None
    branch: tuple[str, ...] = ()
    setup: tuple[str, ...] = ()
    """Rows of one set-up were taken without touching the instrument between."""
    point: str = "tcp"
    load_point: str = "tcp"
    points: tuple[str, ...] = ()
    """Named point read in each row; empty: `point` in all."""
    load_points: tuple[str, ...] = ()
    gravity: tuple[float, float, float] | None = None
    zero_sigma: Floats = field(default_factory=lambda: np.zeros(6))
    """(6,) standard deviation of the zero that the readings of one pose share."""
    unloaded: str = "centre"
    """State without load: ``centre`` of every gap, side of the last ``approach``, or ``unknown``."""
    frame: str = "known"
    tool: str = "known"
    """Point on the tool: ``known``, off by an ``offset_unknown`` in the tool's axes, or ``unknown`` with a turn."""
    certificate: tuple[tuple[str, float], ...] = ()
    """Standard uncertainties of the instrument: of its ``scale`` (1), ``tool`` point and known ``frame`` (m),
    ``frame_direction`` (rad)."""
    loop: Loop = Loop()
    title: str = ""
    record: tuple[tuple[str, str], ...] = ()
    """Operator, instrument, certificate, date, temperature, source (of a sheet) with its sha256, notes: in words, of a report."""
    source: str = ""

    def __post_init__(self) -> None:
        for name, words in WORDS.items():
            one_of(getattr(self, name), get_args(words), name)
        for name in PER_ROW:
            value = getattr(self, name)
            shape = (len(value),) if isinstance(value, tuple) else np.shape(value)
            absent = value is None or (shape == (0,) and isinstance(value, tuple))
            if (name in PER_ROW[:5] or not absent) and shape[:1] != (len(self),):
                raise refused(name, f"{len(self)} entries, one for each row", f"the shape {shape}")
        if np.any(self.sigma < 0):
            raise refused("sigma", "standard deviations of 0 or more, or NaN", f"{np.nanmin(self.sigma):g}")

    def _repr_html_(self) -> str:
        return experiment_html(self)

    def __len__(self) -> int:
        return len(self.ids)

    @property
    def channels(self) -> tuple[Channel, ...]:
        """The columns of `reading`."""
        return (*AXIS_CHANNELS, *self.extra)

    @property
    def axis_read(self) -> NDArray[np.bool_]:
        """(c,) which channels were read at all."""
        return np.asarray(np.any(self.read, axis=0))

    @property
    def read(self) -> NDArray[np.bool_]:
        """(n, c) which values were read."""
        return np.isfinite(self.reading)

    @property
    def axes(self) -> tuple[str, ...]:
        """Names of the channels that were read at all."""
        return tuple(c.name for c, any_ in zip(self.channels, self.axis_read, strict=True) if any_)

    @property
    def zeros(self) -> Floats:
        """(c,) m, rad: `zero_sigma` of every channel; none for joints and distances."""
        return np.append(self.zero_sigma, np.zeros(len(self.channels) - len(self.zero_sigma)))

    @property
    def recorded(self) -> frozenset[str]:
        """What the experiment records besides pose, load and reading, in the words of effects."""
        columns = ("temperature", "order", "hours", "approach", "branch", "setup")
        given = {c for c in columns if getattr(self, c) is not None and len(getattr(self, c))}
        return frozenset(given | {c.side for c in self.extra if c.joint})

    @cached_property
    def groups(self) -> Integers:
        """(n,) number of the commanded pose (or pair of poses) of each row."""
        place = self.position if self.command is None else self.command
        return numbered([place, self.rotation, self.other, self.other_rotation])

    @cached_property
    def runs(self) -> Integers:
        """(n,) number of the set-up of each row; all 0 where no set-ups are named."""
        return np.unique(self.setup or ("",) * len(self), return_inverse=True)[1].reshape(-1)

    @cached_property
    def distinct(self) -> tuple[Experiment, Integers]:
        """The rows of each different (pose, wrench) once, and (n,) which of them stands for each row."""
        back = numbered([self.groups, self.wrench])
        return self.rows(np.unique(back, return_index=True)[1].astype(np.intp)), back

    @cached_property
    def each_pose(self) -> Experiment:
        """The first row of each commanded pose, in the order of `groups`."""
        return self.rows(np.unique(self.groups, return_index=True)[1].astype(np.intp))

    @cached_property
    def without_load(self) -> Experiment:
        """The same rows without their wrenches."""
        return replace(self, wrench=np.zeros(self.wrench.shape)) if self.wrench.any() else self

    @cached_property
    def conditions(self) -> Integers:
        """(n,) number of the condition (pose, load, how it was reached): repeats share it."""
        loads = self.wrench, self.temperature, self.load_direction
        return numbered([self.states, *loads])

    @cached_property
    def states(self) -> Integers:
        """(n,) number of the pose and how it was reached and read; load and temperature apart."""
        words = self.branch, self.setup, self.points, self.load_points
        return numbered([self.groups, self.approach, *words])

    @cached_property
    def load_direction(self) -> Integers | None:
        """(n,) +1 going up, -1 going down, where loads run in order of time; None where they jump or no order is
        recorded."""
        if self.order is None or len(self) == 0:
            return None
        return directions(self.wrench, self.order, self.runs)

    def rows(self, keep: NDArray[np.bool_] | Integers) -> Experiment:
        """The experiment with some of its rows: (n,) of which to keep, or (k,) their numbers."""
        try:
            index = np.arange(len(self))[np.atleast_1d(keep) if np.size(keep) else []]
        except IndexError:
            raise StiffmapError(
                f"keep: expected truth values or numbers of {len(self)} rows, got {keep!r}"
            ) from None
        picked = {name: _pick(getattr(self, name), index) for name in PER_ROW}
        return replace(self, **picked, absolute={k: v[index] for k, v in self.absolute.items()})

    def with_readings(self, reading: Floats) -> Experiment:
        """The same plan with other readings (n, c) m, rad."""
        given = trailing(reading, self.read.shape, "reading", "readings")
        return replace(self, reading=np.where(self.read, given, np.nan))


def _pick(values: Any, index: Integers) -> Any:
    if values is None or (isinstance(values, tuple) and not values):
        return values
    return tuple(values[i] for i in index) if isinstance(values, tuple) else values[index]


def numbered(parts: Sequence[Any]) -> Integers:
    """(n,) number of each different row of the parts, numbers (n, ...) or words (n,); None and no words are left out."""
    given = [p for p in parts if p is not None and len(p)]
    if not given:
        raise StiffmapError("experiment: expected at least one row, got none")
    columns = [np.unique(p, return_inverse=True)[1] if isinstance(p, tuple) else p for p in given]
    key = np.concatenate([np.asarray(c, dtype=float).reshape(len(c), -1).T for c in columns])
    np.nan_to_num(np.round(key, 9, out=key), copy=False, nan=np.inf)
    key += 0.0  # no -0
    order = np.lexsort(key[::-1])  # as np.unique along an axis, in half its time
    new = np.zeros(max(len(order) - 1, 0), dtype=bool)
    for row in key:
        in_order = row[order]
        new |= in_order[1:] != in_order[:-1]
    number = np.zeros(len(order), dtype=np.intp)
    number[order[1:]] = np.cumsum(new)
    return number
