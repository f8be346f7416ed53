"""What a diagnosis says of a twin: right, honest about what it cannot tell, silent, or false."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from tests.oracle.twins.faults import Fault
from tests.oracle.twins.generator import Twin

from stiffmap.identification.diagnosis import Diagnosis
from stiffmap.identification.numbers import Tolerances
from stiffmap.model.description.tree import joints

ALIKE = 0.98
"""Cosine of two changes of the readings from which the noise of the twin cannot tell them apart."""


@dataclass(frozen=True)
class Judgement:
    """Of one twin."""

    word: str
    """right, same (another name with the same readings), within (silent, of faults that usual tolerances allow), unattributed
    (no cause, but said that one is missing), silent, false; of a machine without a fault quiet or false."""
    said: str
    covered: tuple[bool, ...]
    """Whether the 95 % interval of a fault that is named at its place holds its size."""


Named = tuple[str, str, tuple[str, ...]]
"""Kind, element, legs."""


@dataclass(frozen=True)
class Claim:
    """What an engine says, in words that do not depend on it."""

    verdict: str
    effects: list[list[Named]]
    """Per effect that is named: its place first, then all that would show the same."""
    numbers: list[list[str]]
    """Per declared number that is called off: its name first, then those that would show the same."""
    missing: bool
    """Whether it says that something is missing that it cannot name."""
    change: np.ndarray
    """(n, 3) m: what it adds to the readings."""
    intervals: list[tuple[Named, dict[str, tuple[float, float]]]]
    """Per effect, 95 % intervals of its parameters."""

    @property
    def said(self) -> str:
        """In one line."""
        words = [
            f"{kind} of {element} {' '.join(legs)}".strip() for (kind, element, legs), *_ in self.effects
        ]
        return f"{self.verdict}: {'; '.join(words)} | {'; '.join(n[0] for n in self.numbers)}"


def of_diagnosis(d: Diagnosis) -> Claim:
    """The claim of a diagnosis."""
    named = [(e.kind, e.element, e.legs) for e in d.effects]
    groups = [
        [n, *places(e.aliases), *rivals(d, k)] for k, (n, e) in enumerate(zip(named, d.effects, strict=True))
    ]
    c = d.calibration
    return Claim(
        d.verdict,
        groups,
        [[b.name] for b in c.beyond] if c else [],
        "unattributed" in d.verdict,
        (d.residual_before - d.residual_after)[:, :3],
        [
            (n, {k: (low, high) for k, (_, low, high, _) in e.parameters.items()})
            for n, e in zip(named, d.effects, strict=True)
        ],
    )


def judged(twin: Twin, claim: Claim) -> Judgement:
    """The worst word of all that is named; silent where nothing is."""
    if not claim.effects and not claim.numbers:
        if not twin.faults:
            return Judgement("quiet", claim.said, ())
        word = "within" if tolerable(twin) else "unattributed" if claim.missing else "silent"
        return Judgement(word, claim.said, ())
    if not twin.faults:
        return Judgement("false", claim.said, ())
    truths = [f.at for f in twin.faults]
    words = [any(at(place, t) for place in g for t in truths) for g in claim.effects]
    words += [any(within(n, t) for n in names for t in truths) for names in claim.numbers]
    word = "right" if all(words) else "same" if alike(twin, claim) else "false"
    return Judgement(word, claim.said, tuple(covered(twin, claim)))


def tolerable(twin: Twin) -> bool:
    """Whether each fault is within three usual standard uncertainties of what it is."""
    t = Tolerances()
    u = {"gain": t.gain, "soft": t.compliance}
    turning = {name for name, j in joints(twin.machine.description).items() if j.kind == "revolute"}

    def one(f: Fault, size: float) -> bool:
        if f.kind == "soft":
            return abs(np.log1p(size)) < 3.0 * u["soft"]
        zero = t.turning_zero if f.at.removeprefix("platform.") in turning else t.zero
        return abs(size) < 3.0 * (zero if f.kind == "zero" else u["gain"])

    return all(one(f, s) for f, s in zip(twin.faults, twin.sizes, strict=True))


def places(aliases: list[dict[str, object]]) -> list[tuple[str, str, tuple[str, ...]]]:
    return [(str(a["kind"]), str(a["element"]), tuple(a["legs"])) for a in aliases]  # type: ignore[call-overload]


def rivals(d: Diagnosis, k: int) -> list[tuple[str, str, tuple[str, ...]]]:
    """Of the k-th effect, in the alternatives."""
    return [(e.kind, e.element, e.legs) for other in d.alternatives for e in other]


def at(place: tuple[str, str, tuple[str, ...]], truth: str) -> bool:
    """Whether a place is the element of a fault: the same leg and the same name, whatever branch."""
    _, element, legs = place
    leg, _, rest = truth.partition(".")
    name = rest.split(".")[-1]
    return name in element.split(".") and (not legs or leg in legs)


def within(number: str, truth: str) -> bool:
    """Whether the name of an uncertain number speaks of the element of a fault."""
    return any(
        truth == w or truth.endswith(f".{w}") or w in truth
        for w in number.split()
        if "." in w or w in truth.split(".")
    )


def alike(twin: Twin, claim: Claim) -> bool:
    good = np.isfinite(claim.change) & np.isfinite(twin.signal)
    a, b = claim.change[good], twin.signal[good]
    size = float(np.linalg.norm(a) * np.linalg.norm(b))
    return size > 0.0 and float(a @ b) / size > ALIKE


def covered(twin: Twin, claim: Claim) -> Iterator[bool]:
    """Intervals of faults that are named by their own kind at their own place and leg; an effect on a block speaks of all its
    branches, a fault of one."""
    own = {
        "soft": ("compliance", "scale", 1.0),
        "zero": ("zero_offset", "error", 0.0),
        "gain": ("lead_error", "slope", 0.0),
    }
    for f, size in zip(twin.faults, twin.sizes, strict=True):
        if f.at.count(".") != 1:
            continue
        kind, parameter, null = own[f.kind]
        for place, intervals in claim.intervals:
            alone = len(place[2]) == 1 and at(place, f.at) and "." not in place[1]
            if place[0] == kind and alone and parameter in intervals:
                low, high = intervals[parameter]
                yield low <= null + size <= high
