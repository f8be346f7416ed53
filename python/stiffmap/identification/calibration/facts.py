"""The answer of a calibration."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from stiffmap.common.plain import plain
from stiffmap.experiment.experiment import Experiment, Floats, Integers
from stiffmap.experiment.noise.over_time import OverTime
from stiffmap.identification.calibration.groups import Choice
from stiffmap.identification.calibration.pulls import Pulls
from stiffmap.identification.calibration.travel import Travel
from stiffmap.identification.calibration.unknowns import Unknown
from stiffmap.solve.machine import Machine
from stiffmap.solve.validity import Validity


@dataclass(frozen=True)
class Row:
    """One unknown: declared standard uncertainty, posterior, and whether the readings determine it."""

    name: str
    group: str
    leg: str
    unit: str
    """``m``, ``rad``, ``1`` or ``ln`` (logarithm of a factor)."""
    value: float
    """Posterior mean of its error."""
    u: float
    sigma: float
    """Posterior standard deviation."""
    pull: float
    """Value over the standard deviation that it should have if `u` is right."""
    identifiable: bool
    """Whether the readings say more of it than its uncertainty does."""
    observability: float
    """u / sigma: how many times the readings sharpen it."""
    minimal: bool
    """Whether it belongs to the minimal set that spans all that the readings determine."""


@dataclass(frozen=True)
class Beyond:
    """An unknown that its standard uncertainty cannot account for."""

    name: str
    value: float
    sigma: float
    unit: str
    nats: float
    """Evidence gained by letting it go beyond its tolerance."""
    rivals: tuple[str, ...] = ()
    """Others that would explain as much in its place."""


@dataclass(frozen=True)
class Wider:
    """A group whose unknowns are all off by more than their standard uncertainties say."""

    group: str
    factor: float
    """On its standard uncertainties."""
    nats: float
    """Evidence gained by it."""
    rivals: tuple[str, ...] = ()
    """Groups that would gain as much in its place."""


@dataclass(frozen=True)
class HeldOut:
    """Readings that no estimate saw; rms in m (rad where only angles are read)."""

    by: str
    before: float
    """Declared machine; unknown frames and zeros fitted."""
    after: float
    chosen: float
    """With the chosen groups only."""
    groups: dict[str, float]
    """With one group alone in addition to the base."""


@dataclass(frozen=True)
class Unseen:
    """What the machine file says of readings that no fit saw: made from all other folds, and predicted in full.

    Unknown frames, tools and zeros are those of the other folds, too, unless only the fold itself has them.
    """

    by: str
    """What is left out together: ``poses`` or ``set-ups``."""
    before: float
    """rms with the declared machine, m (rad where only angles are read)."""
    after: float
    """rms with the corrected machine of the other folds."""
    u: float
    """Standard uncertainty of `after`, by the scatter of the folds' mean squares."""

    @staticmethod
    def of(
        before: Floats, after: Floats, label: Integers, by: str, size: Callable[[Floats], float]
    ) -> Unseen:
        """From residuals (n, c) of rows in folds `label` (n,)."""
        whole = size(after)
        squares = np.array([size(after[label == k]) ** 2 for k in np.unique(label)])
        spread = float(np.nanstd(squares, ddof=1) / np.sqrt(len(squares)))
        return Unseen(by, size(before), whole, spread / (2.0 * whole) if whole > 0.0 else 0.0)


@dataclass(frozen=True, eq=False)
class Facts:
    """What a machine's numbers are, given their uncertainties and the readings; SI."""

    verdict: str
    """``as declared``, ``adjusted within tolerance``, ``adjusted beyond tolerance``, ``beyond tolerance: NAME`` or
    ``unattributed``."""
    rows: tuple[Row, ...]
    beyond: tuple[Beyond, ...]
    groups: Choice
    rank: int
    """Directions that the readings determine, of `len(rows)`."""
    held_out: HeldOut | None
    rms_before: float
    rms_after: float
    noise: float
    """Noise floor, m (rad where only angles are read)."""
    floor: float
    """Standard deviation of what the calibrated model leaves per pose beyond noise."""
    explained: float
    """Share of the misfit's squares that the calibration takes away."""
    rest: dict[str, float]
    """rms of what is left, by reading and by set-up, m or rad."""
    wider: tuple[Wider, ...]
    travel: Travel | None
    """Errors along the drives' travel, where they hold on readings that were not seen."""
    outliers: tuple[str, ...]
    failed: tuple[tuple[str, str], ...]
    stopped: bool
    """Whether the time budget ended it early: what follows is the best so far."""
    unit: str
    machine: Machine = field(repr=False)
    """The corrected machine: built as calibrated, with the axis positioning errors of its drives where they hold; its
    controller keeps the declared numbers."""
    unseen: Unseen | None
    """What `machine` says of readings that no fit saw; None where there are not two folds, or time was over."""
    experiment: Experiment = field(repr=False)
    residual: Floats = field(repr=False)
    """(n, c) reading minus prediction, less fitted frames and zeros."""
    unknowns: tuple[Unknown, ...] = field(repr=False, default=())
    values: Floats = field(repr=False, default_factory=lambda: np.zeros(0))
    """(p,) in standard uncertainties."""
    seconds: dict[str, float] = field(default_factory=dict)
    validity: Validity = field(kw_only=True)
    """What the readings covered; beyond it nothing vouches for `machine`."""
    pulls: Pulls = field(kw_only=True)
    """How far the numbers are beyond their standard uncertainties, without those that have a widened prior."""
    found_again: Mapping[str, float] = field(default_factory=dict)
    """Share of other draws of as many readings that would show each claim."""
    over_time: OverTime | None = None
    """What the calibrated machine leaves over time; None where no times were recorded."""
    refused: tuple[str, ...] = ()
    """Hypotheses beyond tolerance that the evidence supports and that were refused, and why."""

    def to_json(self) -> str:
        """All but arrays and machines, SI; NaN is null."""
        return json.dumps(self.as_plain(), indent=2, ensure_ascii=False, allow_nan=False)

    def as_plain(self) -> dict[str, Any]:
        """JSON data."""
        measures = ("rms_before", "rms_after", "noise", "floor", "explained", "rest")
        names = ("verdict", "rank", *measures, "outliers", "stopped", "unit", "seconds")
        out = {n: plain(getattr(self, n)) for n in names}
        out["held_out"] = plain(asdict(self.held_out)) if self.held_out else None
        out["unseen"] = plain(asdict(self.unseen)) if self.unseen else None
        v = self.validity
        out["validity"] = plain(
            {"poses": v.poses, "drives": dict(v.drives), "loads": dict(v.loads), "temperature": v.temperature}
        )
        out["found_again"] = dict(self.found_again)
        out["over_time"] = plain(asdict(self.over_time)) if self.over_time else None
        out["pulls"] = plain(asdict(self.pulls)) | {"within": self.pulls.within}
        out["groups"] = plain(asdict(self.groups))
        out["beyond"] = [plain(asdict(b)) for b in self.beyond]
        out["travel"] = self.travel.as_plain() if self.travel else None
        out["table"] = [plain(asdict(r)) for r in self.rows]
        out["refused"] = list(self.refused)
        out["failed"] = [list(f) for f in self.failed]
        return out
