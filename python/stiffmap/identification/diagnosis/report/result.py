"""What `stiffmap.diagnose` returns: the answer, in words and as a report."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, fields
from html import escape
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from stiffmap.common.broadcasting import Mask
from stiffmap.common.errors import FileError, reading
from stiffmap.common.from_above import from_above
from stiffmap.common.json_text import json_text, parse_json, plain
from stiffmap.common.number_text import percent, place_text, with_uncertainty
from stiffmap.common.short import first_of, short_repr, titled
from stiffmap.experiment.comparison.residual import Summary
from stiffmap.experiment.experiment import Experiment, Floats
from stiffmap.experiment.noise.checks import Check
from stiffmap.identification.diagnosis.report.findings import (
    Detectability,
    Effect,
    FoundNumbers,
    NoiseReport,
    Rest,
)
from stiffmap.identification.diagnosis.report.sentences import (
    LISTED,
    effect_text,
    next_step,
    off_as_a_group,
    opening,
    separation_text,
)
from stiffmap.identification.diagnosis.report.separation import Separation
from stiffmap.identification.diagnosis.slips.axes import Slip
from stiffmap.identification.inference.constants import RARE
from stiffmap.identification.inference.machines import HeldOut
from stiffmap.identification.inference.shares import largest
from stiffmap.model import effects
from stiffmap.model.description import AppliedEffect
from stiffmap.solve.machine import Machine
from stiffmap.solve.validity import Validity

APART = ("verdict", "held_out", "shares", "machine", "declared", "experiment", "calibration", "seed")
"""Fields that JSON has in another form, or not at all."""
VERDICTS = {
    "none": "no effect above the limits of this experiment",
    "effects": "the declared machine lacks what is named below",
    "ambiguous": "more than one explanation fits the readings",
    "unattributed": "not as declared, and no known effect explains how",
    "effects+unattributed": "explained in part; real structure remains",
    "readings": "a mistake in the readings comes before any cause",
}
NUMBERS_OFF = "its numbers are further off than the file allows, and none of them alone can be named"


@short_repr
@dataclass(frozen=True, eq=False)
class Diagnosis:
    """What a diagnosis found; every number in SI, base axes. Printed, it is the verdict in five lines."""

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

    @property
    def noise_size(self) -> float:
        """Noise of the readings in the unit of their sizes, m or rad; what no model explains is not in it."""
        floors = np.array(list(self.noise.floor.values()))
        size = self.noise.rms if self.before.size[1] == "m" else float(np.sqrt(np.mean(floors**2)))
        return self.noise.scale * size

    def lines(self) -> list[str]:
        """Verdict, effects, before and after, noise, and what could not be seen; then the calibration, if any."""
        numbers = self.verdict == "unattributed" and off_as_a_group(self)
        return [
            f"verdict: {self.verdict} - {NUMBERS_OFF if numbers else VERDICTS[self.verdict]}",
            *(f"readings: {_slip(s)}" for s in self.slips),
            "effects: " + ("; ".join(effect_text(e) for e in self.effects) or "none") + _others(self),
            *(f"number: {n}" for n in (self.calibration.beyond if self.calibration else ())[:LISTED]),
            f"held-out readings: rms {_thousandth(*self.before.size)} before, {_thousandth(*self.after.size)} after "
            f"(noise {_thousandth(self.noise_size, self.before.size[1])}, ratio {self.after.size[0] / self.noise_size:.3f}, n = {self.after.n}){_promise(self)}",
            _left(self),
            _limits(self),
            *_more(self),
        ]

    def report(
        self,
        path: str | PathLike[str],
        *,
        date: str | None = None,
        inputs: Iterable[str | PathLike[str]] = (),
    ) -> None:
        """Write one self-contained HTML file. ``date`` (the caller's, as text) and digests of the files or folders
        ``inputs`` stand under its provenance."""
        from_above("Diagnosis.report")(self, path, date=date, inputs=inputs)

    def _repr_html_(self) -> str:
        lines = "".join(f"<li>{escape(line)}</li>" for line in self.lines())
        return titled(opening(self), f"<p>{escape(next_step(self))}</p><ul>{lines}</ul>")

    def __str__(self) -> str:
        return "\n".join(self.lines())


def _slip(s: Slip) -> str:
    undone = ["what follows is of readings with it undone"] if s.undone else []
    also = [f"or {a}: these readings cannot determine which" for a in s.also]
    return "; ".join([f"{s.check}: {s.seen}", *s.evidence, *undone, *also])


def _thousandth(value: float, unit: str) -> str:
    """``0.0123 mm`` or ``0.0123 mrad``."""
    return f"{1e3 * value:.4f} m{unit}"


def _more(d: Diagnosis) -> list[str]:
    """How the difference is shared out, which machine is handed over, what is not named and why."""
    out = []
    shared = largest(d.shares)
    if d.verdict != "none" and len(shared) > 1:
        out.append(f"shares of the squares: {'; '.join(shared)}")
    if d.effects and d.which != "corrected":
        out.append(
            f"machine.yaml is the {d.which} machine: none with effects predicts unseen readings better"
        )
    if d.calibration is not None:
        out += [f"declared numbers: {d.calibration.verdict}", *map(str, d.calibration.wide)]
    out += [f"not named: {why}" for why in d.refused]
    if d.stopped:
        what = f"; not tried: {first_of(d.not_tried, LISTED, '; ')}" if d.not_tried else ""
        out.append(f"stopped early: this is the best so far{what}")
    return out


def _promise(d: Diagnosis) -> str:
    """What a reading at a pose that was not read will differ by from the machine that is handed over."""
    v = Validity.of_machine(d.machine)
    if v is None or v.error is None:
        return ""
    return f"; machine.yaml ({d.which}) promises {with_uncertainty(1e3 * v.error, 1e3 * v.error_u)} m{v.unit}"


def _others(d: Diagnosis) -> str:
    if not d.alternatives:
        return ""
    other = " or ".join(
        " + ".join(f"{e.kind} of {e.element} {' '.join(e.legs)}" for e in a) for a in d.alternatives
    )
    return f" -- or instead: {other}"


def _left(d: Diagnosis) -> str:
    if d.unexplained:
        p = d.unexplained[0]
        return f"unexplained: {p.what}, {percent(p.share)} of the squares{_place(p)}"
    if d.separations:
        return f"to separate: {separation_text(d.separations[0])}"
    out = f"{len(d.outliers)} outliers listed" if d.outliers else "no outliers"
    chance = d.noise.lack_of_fit_after
    return f"nothing unexplained{f': lack of fit p = {chance:.2g}' if chance > RARE else ''}; {out}"


def _place(p: Rest) -> str:
    if p.position is None:
        return ""
    unit = "mrad" if p.axis.startswith("r") else "mm"
    return f"; largest in {p.axis} at {place_text(p.position, '.0f')}, {1e3 * p.size:.4g} {unit} rms"


def _limits(d: Diagnosis) -> str:
    if d.limitations:
        return "limits: " + "; ".join(d.limitations[:3])
    return (
        f"could see: {len(d.detectable)} effects; could not see: {len(d.unobservable)} (listed in the report)"
    )


def read_diagnosis(file: Path) -> tuple[str, list[Effect]]:
    """Verdict and effects of a ``diagnosis.json``; raises `FileError` for another file."""
    with reading(file):
        try:
            data: Any = parse_json(file.read_text(encoding="utf-8"))
            found = [
                Effect(
                    str(e["kind"]), str(e["element"]), tuple(map(str, e["legs"])),
                    {n: (*np.array([v, a, b], float).tolist(), str(s)) for n, (v, a, b, s) in e["parameters"].items()},
                    list(e.get("aliases", ())), {},
                )
                for e in data["effects"]
            ]  # fmt: skip
        except (ValueError, KeyError, TypeError, AttributeError, OverflowError):
            what = "expected a diagnosis as `stiffmap diagnose --json` writes it"
            raise FileError(what, file=str(file)) from None
    return str(data.get("verdict", "")), found


def diagnosed(path: Path) -> list[AppliedEffect]:
    """Effects that the diagnosis of a ``diagnosis.json`` names; raises `FileError` for another file, and where it names none."""
    terms = []
    for e in read_diagnosis(path)[1]:
        values = tuple((n, v) for n, (v, *_) in e.parameters.items())
        if e.kind in effects.kinds() and effects.get(e.kind).derived:
            values = values[:1]  # what follows from it says the same in other words
        terms.append(AppliedEffect(e.kind, e.element, e.legs, values))
    if not terms:
        raise FileError("the diagnosis names no effect that could be followed", file=str(path))
    return terms
