"""The answer of a diagnosis."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from stiffmap.common.plain import plain
from stiffmap.experiment.comparison.summary import Summary
from stiffmap.experiment.experiment import Experiment, Floats
from stiffmap.experiment.noise.checks import Check
from stiffmap.experiment.noise.level import Mask
from stiffmap.identification.calibration import Calibration
from stiffmap.identification.diagnosis.decision.cross_validation import HeldOut
from stiffmap.identification.diagnosis.decision.empirical import Empirical
from stiffmap.identification.diagnosis.decision.patterns import Pattern
from stiffmap.identification.diagnosis.rivals.separation import Separation
from stiffmap.identification.diagnosis.slips.slip import Slip
from stiffmap.solve.machine import Machine

Place = Mapping[str, Any]


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
        legs = f", leg{'s' if len(self.legs) > 1 else ''} {', '.join(self.legs)}" if self.legs else ""
        values = "; ".join(
            f"{n} {v:.5g} [{a:.5g}, {b:.5g}] {u}" for n, (v, a, b, u) in self.parameters.items()
        )
        return f"{self.kind} of {self.element}{legs}: {values}"


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
    unexplained: list[Pattern]
    limitations: list[str]
    significance: dict[str, float]
    machine: Machine
    """The corrected machine: its effects, and what a calibration below them found; `after` is what it does."""
    declared: Machine
    experiment: Experiment
    residual_before: Floats = field(repr=False)
    residual_after: Floats = field(repr=False)
    set_aside: Mask = field(repr=False)
    empirical: Empirical | None = None
    calibration: Calibration | None = None
    """Below the effects, where many small errors explain the readings better than exact numbers do; its own
    machine has no effects."""
    refused: list[str] = field(default_factory=list)
    """Effects that the readings seemed to demand and that are not named, and why."""
    stopped: bool = False
    """Whether a time budget, the bound on what is tried, or Ctrl-C ended it early: the answer is the best so far."""
    not_tried: list[str] = field(default_factory=list)
    """What the bound left out."""
    explained: float = 0.0
    """Share of the misfit beyond noise (and calibration) that the effects take away."""
    slips: list[Slip] = field(default_factory=list)
    """Mistakes of writing or mounting that the readings show, named before any cause."""
    seed: int | None = None
    """Of folds and simulated noise."""
    seconds: dict[str, float] = field(default_factory=dict)
    """What each step took; ``null bootstrap`` is done once per plan and kept while the process lives."""

    def to_json(self) -> str:
        """All fields but arrays and machines, SI; NaN is null."""
        return json.dumps(self.as_plain(), indent=2, ensure_ascii=False, allow_nan=False)

    def as_plain(self) -> dict[str, Any]:
        """JSON data."""
        names = (
            "effects",
            "alternatives",
            "separations",
            "before",
            "after",
            "noise",
            "detectable",
            "unobservable",
        )
        more = (
            "outliers",
            "checks_before",
            "checks_after",
            "unexplained",
            "limitations",
            "significance",
            "seconds",
            "refused",
            "stopped",
            "not_tried",
            "explained",
            "slips",
        )
        out: dict[str, Any] = {"verdict": self.verdict, "units": "SI (m, rad, N, N·m, kg), base axes"}
        out |= {"machine": self.declared.name, "experiment": self.experiment.name}
        out |= {n: plain(getattr(self, n)) for n in (*names, *more)}
        if self.held_out:
            h = self.held_out
            out["held_out"] = {"folds": h.folds, "by": h.by, "chosen": h.chosen}
        out["calibration"] = self.calibration.as_plain() if self.calibration else None
        if self.empirical:
            e = self.empirical
            out["empirical_correction"] = plain(
                {"rms_before": e.before, "rms_after": e.after, "length": e.length}
            )
        return out
