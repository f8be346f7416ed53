"""The answer of a diagnosis."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from typing import Any

from stiffmap.common.json_text import json_text, plain
from stiffmap.experiment.comparison.summary import Summary
from stiffmap.experiment.experiment import Experiment, Floats, Mask
from stiffmap.experiment.noise.checks import Check
from stiffmap.identification.candidates.candidates import words
from stiffmap.identification.diagnosis.report.separation import Separation
from stiffmap.identification.diagnosis.slips.slip import Slip
from stiffmap.identification.inference.machines import HeldOut
from stiffmap.solve.machine import Machine

APART = ("verdict", "held_out", "shares", "machine", "declared", "experiment", "calibration", "seed")
"""Fields that JSON has in another form, or not at all."""


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
class FoundNumber:
    """A declared number as the readings have it, SI."""

    name: str
    group: str
    leg: str
    unit: str
    value: float
    """What it is off by."""
    sigma: float
    """Its standard uncertainty before any reading."""
    u: float
    """After them."""
    share: float
    """Of the squares of the difference from the declared machine."""


@dataclass(frozen=True)
class FoundNumbers:
    """What the readings say of all declared numbers together."""

    verdict: str
    """``adjusted within tolerance`` or ``beyond tolerance: NAME, ...``."""
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


@dataclass(frozen=True, eq=False)
class Findings:
    """What a diagnosis found; every number in SI, base axes."""

    verdict: str
    """``none``, ``effects``, ``ambiguous``, ``unattributed`` or ``effects+unattributed``; ``readings`` where a unit, a sign, a
    swap or a shift in the readings comes first (`slips`), and all else is of readings without it."""
    effects: list[Effect]
    alternatives: list[list[Effect]]
    separations: list[Separation]
    """Per alternative the measurement that tells it from `effects` best."""
    before: Summary
    after: Summary
    held_out: HeldOut | None
    noise: NoiseReport
    detectable: list[Detectability]
    unobservable: list[str]
    outliers: list[str]
    checks_before: list[Check]
    checks_after: list[Check]
    unexplained: list[Rest]
    """What is left that has no name; nothing where noise is all."""
    limitations: list[str]
    shares: dict[str, float]
    """How the squares of the readings' difference from the declared machine are shared out: noise, declared numbers, each effect,
    gaps, poses, time; together 1."""
    machine: Machine
    """The machine that is handed over: corrected, calibrated or as declared, whichever predicts readings best that it has not
    seen; `after` is what it does."""
    declared: Machine
    experiment: Experiment
    residual_before: Floats = field(repr=False)
    residual_after: Floats = field(repr=False)
    set_aside: Mask = field(repr=False)
    gap: Floats | None = field(repr=False, default=None)
    """(n, c) m, rad: what nobody can name, at the readings that were compared; NaN elsewhere."""
    calibration: FoundNumbers | None = None
    """Declared numbers, where the readings say that they are off; None where they are as declared."""
    seconds: dict[str, float] = field(default_factory=dict)
    """What each step took."""
    refused: list[str] = field(default_factory=list)
    """Effects that the readings seemed to demand and that are not named, and why."""
    which: str = "declared"
    """What `machine` is: ``declared``, ``calibrated`` or ``corrected``."""
    stopped: bool = False
    """Whether a time budget or Ctrl-C ended it early: the answer is the best so far."""
    not_tried: list[str] = field(default_factory=list)
    """What was left out for that."""
    slips: list[Slip] = field(default_factory=list)
    """Mistakes of writing or mounting that the readings show, named before any cause."""
    seed: int | None = None
    """Of folds and simulated noise."""

    def to_json(self) -> str:
        """All fields but arrays and machines, SI; NaN is null."""
        return json_text(self.as_plain())

    def as_plain(self) -> dict[str, Any]:
        """JSON data."""
        out: dict[str, Any] = {"verdict": self.verdict, "units": "SI (m, rad, N, N·m, kg), base axes"}
        out |= {"machine": self.declared.name, "experiment": self.experiment.name}
        out |= {f.name: plain(getattr(self, f.name)) for f in fields(self) if f.repr and f.name not in APART}
        out["shares"] = [{"part": name, "share": share} for name, share in self.shares.items()]
        h = self.held_out
        out["held_out"] = {"folds": h.folds, "by": h.by} if h else None
        out["calibration"] = plain(self.calibration)
        return out
