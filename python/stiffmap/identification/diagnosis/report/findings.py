"""What a diagnosis finds, piece by piece."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from stiffmap.identification.calibration.result import FoundNumber
from stiffmap.identification.candidates.candidates import words
from stiffmap.identification.inference.shares import WideGroup


@dataclass(frozen=True)
class Effect:
    """A named effect, SI."""

    kind: str
    element: str
    legs: tuple[str, ...]
    parameters: dict[str, tuple[float, float, float, str]]
    """Name -> (value, lower and upper end of the 95 % interval, unit)."""
    aliases: list[dict[str, Any]]
    """Kind, element, legs of what this plan cannot distinguish from it."""
    evidence: dict[str, float]
    definition: str = ""
    """Definition, pivot, frame and what moves with it."""
    open_ends: tuple[str, ...] = ()
    """Ends of intervals that were not found, as ``scale upper``: the machine cannot be solved beyond them, or the
    readings hardly change; the number given is then no limit."""

    @property
    def place(self) -> tuple[str, str, tuple[str, ...]]:
        """Kind, element, legs."""
        return (self.kind, self.element, self.legs)

    def __str__(self) -> str:
        values = "; ".join(
            f"{n} {v:.5g} [{a:.5g}, {b:.5g}] {u}" for n, (v, a, b, u) in self.parameters.items()
        )
        return f"{words(*self.place)}: {values}"


@dataclass(frozen=True)
class Rest:
    """What nobody can name: smooth gaps, common errors of a pose, noise that is larger than declared."""

    what: str
    share: float
    """Of the squares of all readings' difference from the declared machine."""
    axis: str = ""
    """Where it is largest, in noise."""
    position: tuple[float, float, float] | None = None
    """Commanded position of the pose where it is largest, m."""
    size: float = float("nan")
    """rms of it there, m or rad."""


@dataclass(frozen=True)
class FoundNumbers:
    """What the readings say of all declared numbers together."""

    verdict: str
    """``adjusted within tolerance``, ``adjusted beyond tolerance`` or ``beyond tolerance: NAME, ...``."""
    wide: tuple[WideGroup, ...]
    """Groups that are further off than their standard uncertainties say, whichever of their numbers it is."""
    beyond: tuple[FoundNumber, ...]
    """Those that no tolerance allows, the largest share first."""
    table: tuple[FoundNumber, ...]
    """All that the readings show."""


@dataclass(frozen=True)
class NoiseReport:
    """SI, per axis read."""

    floor: dict[str, float]
    repeats: dict[str, float]
    declared: dict[str, float]
    consistency: dict[str, float]
    """p-value of repeats that differ so much from the stated noise."""
    lack_of_fit_before: float
    lack_of_fit_after: float
    rms: float
    scale: float = 1.0
    """Noise of the readings over `floor`, as the inference has it."""


@dataclass(frozen=True)
class Detectability:
    """Smallest size of an effect's parameters that this experiment would have revealed (95 % power)."""

    kind: str
    element: str
    legs: tuple[str, ...]
    sizes: dict[str, float | None]
    """SI change from the null value; None: not observable."""
    aliases: list[dict[str, Any]]
