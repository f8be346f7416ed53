"""A validated experiment: what was commanded, what pulled, what was read."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Integers = NDArray[np.intp]
AXES = ("dx", "dy", "dz", "rx", "ry", "rz")
WRENCH = ("fx", "fy", "fz", "mx", "my", "mz")
BRANCHES = ("", "loading", "unloading")


@dataclass(frozen=True)
class Loop:
    """Metrology loop: decides whether base, fixture or holder compliance can be seen."""

    instrument_on: str = "floor"
    target_on: str = "tool"
    force_against: str = "floor"


@dataclass(frozen=True, eq=False)
class Experiment:
    """Rows of one experiment, SI, base axes. n rows; axes as in `AXES`, wrenches as in `WRENCH`.

    ``deflection``: loaded minus unloaded reading at the same commanded pose, the unloaded state being
    the centre of every dead zone. ``position``: measured minus commanded.
    """

    name: str
    machine: str
    quantity: str
    ids: tuple[str, ...]
    position: Floats
    """(n, 3) m, commanded TCP."""
    wrench: Floats
    """(n, 6) N, N·m at `load_point`."""
    reading: Floats
    """(n, 6) m, rad; NaN where nothing was read."""
    sigma: Floats
    """(n, 6) declared standard deviation of one reading; NaN where none is declared."""
    rotation: Floats | None = None
    """(n, 3, 3) commanded orientation; None: as at home."""
    repeat: Integers | None = None
    order: Floats | None = None
    temperature: Floats | None = None
    """(n,) °C or K; only differences to `reference_temperature` count."""
    reference_temperature: float | None = None
    branch: tuple[str, ...] = ()
    setup: tuple[str, ...] = ()
    point: str = "tcp"
    load_point: str = "tcp"
    gravity: tuple[float, float, float] | None = None
    zero_sigma: Floats = field(default_factory=lambda: np.zeros(6))
    """(6,) standard deviation of the zero that the readings of one pose share."""
    unloaded: str = "centre"
    frame: str = "known"
    loop: Loop = Loop()
    title: str = ""
    source: str = ""

    @property
    def axis_read(self) -> NDArray[np.bool_]:
        """(6,) which axes were read at all."""
        return np.asarray(np.any(self.read, axis=0))

    def __len__(self) -> int:
        return len(self.ids)

    @property
    def read(self) -> NDArray[np.bool_]:
        """(n, 6) which values were read."""
        return np.isfinite(self.reading)

    @property
    def axes(self) -> tuple[str, ...]:
        """Names of the axes that were read at all."""
        return tuple(a for a, any_ in zip(AXES, self.axis_read, strict=True) if any_)

    @cached_property
    def groups(self) -> Integers:
        """(n,) number of the commanded pose of each row."""
        key = (
            self.position
            if self.rotation is None
            else np.hstack([self.position, self.rotation.reshape(-1, 9)])
        )
        return np.unique(np.round(key, 12), axis=0, return_inverse=True)[1].reshape(-1)

    @cached_property
    def conditions(self) -> Integers:
        """(n,) number of the condition (pose, wrench, branch, temperature, set-up): repeats share it."""
        parts = [self.groups[:, None].astype(float), np.round(self.wrench, 9)]
        if self.branch:
            parts.append(np.array([BRANCHES.index(b) for b in self.branch], dtype=float)[:, None])
        if self.temperature is not None:
            parts.append(self.temperature[:, None])
        if self.setup:
            parts.append(np.unique(self.setup, return_inverse=True)[1].reshape(-1, 1).astype(float))
        return np.unique(np.hstack(parts), axis=0, return_inverse=True)[1].reshape(-1)

    def rows(self, keep: NDArray[np.bool_] | Integers) -> Experiment:
        """The experiment with some of its rows."""
        index = np.flatnonzero(keep) if np.asarray(keep).dtype == bool else np.asarray(keep)

        def pick(values: Floats | None) -> Floats | None:
            return None if values is None else values[index]

        return replace(
            self,
            ids=tuple(self.ids[i] for i in index),
            position=self.position[index],
            wrench=self.wrench[index],
            reading=self.reading[index],
            sigma=self.sigma[index],
            rotation=pick(self.rotation),
            repeat=None if self.repeat is None else self.repeat[index],
            order=pick(self.order),
            temperature=pick(self.temperature),
            branch=tuple(self.branch[i] for i in index) if self.branch else (),
            setup=tuple(self.setup[i] for i in index) if self.setup else (),
        )

    def with_readings(self, reading: Floats) -> Experiment:
        """The same plan with other readings (n, 6)."""
        return replace(self, reading=np.where(self.read, reading, np.nan))
