"""What an effect says of itself: its parameters; how it acts on measured data, how it shows in them, what hides it."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from typing import Any, Protocol

import numpy as np

from stiffmap.common.broadcasting import Floats, Integers
from stiffmap.model.description import AppliedEffect


@dataclass(frozen=True)
class Parameter:
    """One number of an effect, in SI.

    ``null`` is the value at which the effect vanishes (``None``: there is no fixed one), ``scale`` a
    typical size for steps and plots, ``default`` the value of a parameter that is left out (``None``:
    it must be given). A parameter that is not ``fitted`` says how the effect is meant (a pivot, a
    recorded temperature) and is known beforehand. ``angular`` is the unit on a joint that turns, with an upper
    bound and a typical size of its own where those of a length mean nothing.
    """

    name: str
    unit: str
    lower: float
    upper: float
    null: float | None
    scale: float
    doc: str
    default: float | None = None
    fitted: bool = True
    angular: str = ""
    angular_upper: float | None = None
    angular_scale: float | None = None
    plausible: tuple[float, float] | None = None
    recorded: str = ""

    @cached_property
    def turning(self) -> Parameter:
        """The parameter on a joint that turns."""
        return replace(
            self,
            unit=self.angular or self.unit,
            upper=self.angular_upper or self.upper,
            scale=self.angular_scale or self.scale,
        )


@dataclass(frozen=True)
class Option:
    """A choice in words; the first one is the default. ``recorded``: an experiment says it row by row."""

    name: str
    choices: tuple[str, ...]
    doc: str
    recorded: bool = False


RECORDS = ("temperature", "order", "hours", "approach", "branch", "setup", "motor")
"""What an effect may need of an experiment besides pose, load and reading; ``motor``: an encoder on the motor's side."""


class Plan(Protocol):
    """What an effect may know of an experiment: n rows, c channels; SI, base axes."""

    @property
    def name(self) -> str: ...
    @property
    def quantity(self) -> str:
        """``deflection`` or ``position``."""

    @property
    def position(self) -> Floats:
        """(n, 3) m, commanded."""

    @property
    def rotation(self) -> Floats | None:
        """(n, 3, 3) commanded; None: that of home."""

    @property
    def wrench(self) -> Floats:
        """(n, 6) N, N·m, noted."""

    @property
    def load_point(self) -> str: ...
    @property
    def temperature(self) -> Floats | None:
        """(n,) K."""

    @property
    def order(self) -> Floats | None:
        """(n,)."""

    @property
    def load_direction(self) -> Integers | None:
        """(n,) which way the load of each row was reached; None where loads do not run."""

    @property
    def hours(self) -> Floats | None:
        """(n,) h."""

    @property
    def frame(self) -> str:
        """Whether the instrument's frame is ``known``."""

    @property
    def loop(self) -> Any:
        """Metrology loop: `instrument_on`, `target_on`, `force_against`."""

    @property
    def extra(self) -> Sequence[Any]:
        """Channels after the six axes, each with `name`, `joint` and `side`."""


class Probe(Protocol):
    """A machine under a plan, to be asked how it would read."""

    @property
    def plan(self) -> Plan: ...
    @property
    def base(self) -> Floats:
        """(n, c) prediction of the machine without the effect."""

    def change(self, term: AppliedEffect) -> Floats:
        """(n, c) m, rad: what another effect adds to every reading."""

    def coordinate(self, element: str, leg: str) -> Floats:
        """(n,) m, rad: commanded coordinate of a drive from its home; `leg` is empty behind or before the legs."""

    def compliance(self) -> Floats:
        """(n, c, 3) change of every reading per newton along x, y, z at the loaded point."""


@dataclass(frozen=True)
class Tried:
    """An effect at a place, as a diagnosis tries it."""

    element: str
    legs: tuple[str, ...]
    parameters: tuple[Parameter, ...]
    """Those that a fit may move, with the units and bounds of the place."""


class Many(Protocol):
    """An effect at many values of a parameter without a null: columns that are made where they are asked for, never kept."""

    @property
    def changes(self) -> Sequence[Floats]:
        """(n, c) changes of the readings, of which columns are made."""

    @property
    def size(self) -> int:
        """Columns at each value."""

    def columns(self, k: int, rows: Integers, channel: Integers) -> Floats:
        """(size, N) change of N readings at the k-th value."""


@dataclass(frozen=True, eq=False)
class Periods:
    """At many frequencies: sine and cosine of 2π f u, u a coordinate of each row, times a change of its readings; the sum over
    several such coordinates."""

    travels: Sequence[Floats]
    """(n,) coordinates u, m or rad."""
    changes: Sequence[Floats]
    """With each of them."""
    frequencies: Floats
    """(F,) equally spaced, 1/m or 1/rad."""
    size: int = 2

    def columns(self, k: int, rows: Integers, channel: Integers) -> Floats:
        """(2, N)."""
        out = np.zeros((2, len(rows)))
        turn = 2.0 * np.pi * self.frequencies[k]
        for travel, change in zip(self.travels, self.changes, strict=True):
            angle, slope = turn * travel[rows], change[rows, channel]
            out += slope * np.stack([np.sin(angle), np.cos(angle)])
        return out


@dataclass(frozen=True, eq=False)
class Onsets:
    """Since many readings: changes that those of an order and later have."""

    changes: Sequence[Floats]
    order: Floats
    """(n,)."""
    first: Floats
    """(F,) orders."""

    @property
    def size(self) -> int:
        """One column for each change."""
        return len(self.changes)

    def columns(self, k: int, rows: Integers, channel: Integers) -> Floats:
        """(size, N)."""
        return np.where(self.order[rows] < self.first[k], 0.0, [c[rows, channel] for c in self.changes])


@dataclass(frozen=True, eq=False)
class Signature:
    """How an effect shows in the readings to first order, for one choice of its parameters without a null.

    values
        SI values of the parameters that this choice holds: all those without a null, but for what `start` gives.
    columns
        (n, c, p) change of the readings per unit of p strengths. None: one strength for each parameter with a null,
        by differences of predictions.
    start
        SI values of further parameters from the (p,) strengths that fit the readings best. None: each parameter
        with a null stands at its null plus strength times scale.
    grows
        Whether strengths can only be positive.
    most
        Largest strength that a machine can have.
    one_of
        In place of columns: all values that are tried alike, and the number of this one.
    """

    values: Mapping[str, float]
    columns: Floats | None = None
    start: Callable[[Floats], Mapping[str, float]] | None = None
    grows: bool = False
    most: float = np.inf
    one_of: tuple[Many, int] | None = None


Load = Callable[[Floats, Plan, AppliedEffect], Floats]
"""(n, 6) wrench that acts, from the one that acts without the effect."""
Reading = Callable[[Floats, Floats, Plan, AppliedEffect], Floats]
"""(n, c) what is read: from what is read without the effect, and the true motion (n, c)."""
Drive = Callable[[Floats, float, Mapping[str, float]], Floats]
"""(n,) deflection of a drive while its force (n,) runs, from its compliance and the effect's values."""
Signatures = Callable[[Probe, Tried], Iterator[Signature]]
STEPS = (0.1, 0.3, 1.0, 3.0, 10.0)
MOST = 25


def signatures_on_a_grid(probe: Probe, tried: Tried) -> Iterator[Signature]:
    """Parameters without a null at a few multiples of their scale, within bounds: what an effect that says nothing
    of its signature gets. One grid for up to two of them; beyond, each alone with typical values of the others."""
    free = [p for p in tried.parameters if p.null is None]
    sizes = [list(dict.fromkeys(min(max(s * p.scale, p.lower), p.upper) for s in STEPS)) for p in free]
    typical = [min(max(p.scale, p.lower), p.upper) for p in free]
    points: Iterable[Sequence[float]] = product(*sizes)
    if math.prod(map(len, sizes)) > MOST:
        points = [[*typical[:i], v, *typical[i + 1 :]] for i, s in enumerate(sizes) for v in s]
    for point in points:
        yield Signature({p.name: v for p, v in zip(free, point, strict=True)})


def shares_of_load(probe: Probe, tried: Tried, name: str, shares: Sequence[float]) -> Iterator[Signature]:
    """A parameter without a null at shares of the largest force of the plan, or moment where that is its unit."""
    parameter = next(p for p in tried.parameters if p.name == name)
    part = slice(3, 6) if parameter.unit == "N·m" else slice(0, 3)
    largest = float(np.abs(probe.plan.wrench[:, part]).max())
    for share in shares if largest > 0.0 else ():
        yield Signature({name: share * largest})
