"""What a diagnosis says of a twin: right, honest about what it cannot tell, silent, or false."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from tests.oracle.twins.faults import Fault
from tests.oracle.twins.generator import Twin

from stiffmap.identification.calibration import Tolerances
from stiffmap.identification.diagnosis import Diagnosis
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


def judged(twin: Twin, d: Diagnosis) -> Judgement:
    """The worst word of all that is named; silent where nothing is."""
    named = [(e.kind, e.element, e.legs) for e in d.effects]
    groups = [
        [n, *places(e.aliases), *rivals(d, k)] for k, (n, e) in enumerate(zip(named, d.effects, strict=True))
    ]
    c = d.calibration
    numbers = [[b.name, *b.rivals] for b in c.beyond] if c else []
    said = f"{d.verdict}: {'; '.join(map(str, d.effects))} | {c.verdict if c else '-'}"
    if not named and not numbers:
        wide = bool(c and c.wider)
        if not twin.faults:
            return Judgement("false" if wide else "quiet", said, ())
        missing = d.verdict == "unattributed" or bool(c and c.verdict == "unattributed")
        return Judgement("within" if tolerable(twin) else "unattributed" if missing else "silent", said, ())
    if not twin.faults:
        return Judgement("false", said, ())
    truths = [f.at for f in twin.faults]
    words = [any(at(place, t) for place in g for t in truths) for g in groups]
    words += [any(within(n, t) for n in names for t in truths) for names in numbers]
    word = "right" if all(words) else "same" if alike(twin, d) else "false"
    return Judgement(word, said, tuple(covered(twin, d)))


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


def alike(twin: Twin, d: Diagnosis) -> bool:
    change = (d.residual_before - d.residual_after)[:, :3]
    good = np.isfinite(change) & np.isfinite(twin.signal)
    a, b = change[good], twin.signal[good]
    size = float(np.linalg.norm(a) * np.linalg.norm(b))
    return size > 0.0 and float(a @ b) / size > ALIKE


def covered(twin: Twin, d: Diagnosis) -> Iterator[bool]:
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
        for e in d.effects:
            alone = len(e.legs) == 1 and at((e.kind, e.element, e.legs), f.at) and "." not in e.element
            if e.kind == kind and alone and parameter in e.parameters:
                _, low, high, _ = e.parameters[parameter]
                yield low <= null + size <= high
