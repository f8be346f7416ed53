"""Which effects explain the frequencies of tap tests, and static readings with them (docs/theory.md V8)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from stiffmap.common.arguments import checked
from stiffmap.common.errors import StiffmapError
from stiffmap.common.tasks import on_one_thread
from stiffmap.experiment import Experiment
from stiffmap.identification.inference.constants import MOST_EFFECTS, ODDS
from stiffmap.identification.inference.optimum import Optimum
from stiffmap.identification.taps.fit import (
    REFINED,
    Explained,
    FittedCauses,
    best_of,
    fitted,
    named_causes,
    price,
)
from stiffmap.identification.taps.predict import predict_taps
from stiffmap.identification.taps.problem import LEAST, TapsProblem, causes
from stiffmap.identification.taps.table import TapTest
from stiffmap.solve.machine import Machine, takes_machine
from stiffmap.workspace.maps.inputs import magnitude

PARTS = ("statics", "taps")
DISAGREE = 3.0
"""Standard deviations between what statics and frequencies say."""


@dataclass(frozen=True)
class TapDiagnosis:
    """What explains a tap test; `named` is empty where nothing has to, or nothing does."""

    before: float
    """Chi-square of the machine as it is."""
    readings: int
    named: tuple[Explained, ...]
    sentence: str
    fits: bool
    """Whether nothing is left unexplained."""
    machine: Machine | None = field(default=None, repr=False)
    """With the causes that are named, and the uncertain numbers as they fit."""

    def as_plain(self) -> dict[str, Any]:
        """Data of JSON."""
        shown = ("candidate", "parameters", "u", "chi2", "statics", "taps", "disagreement")
        return {
            "sentence": self.sentence, "chi2_before": self.before, "readings": self.readings, "fits": self.fits,
            "named": [
                {n: getattr(e, n) for n in shown} | {"alike": [a.candidate for a in e.alike]} for e in self.named
            ],
        }  # fmt: skip

    def modes(self, machine: Machine, taps: TapTest) -> list[dict[str, object]]:
        """Data of JSON: a row per mode, measured, of the machine as it is, and with what is named."""
        before = predict_taps(machine, taps)
        after = None if self.machine is None else predict_taps(self.machine, taps)
        return [
            {
                "at_mm": (1e3 * taps.position[i]).tolist(), "measured_Hz": float(taps.frequency[i]),
                "before_Hz": float(before.frequency[i]), "after_Hz": None if after is None else float(after.frequency[i]),
                "mac": float(before.mac[i] if after is None else after.mac[i]),
                "damping_percent": 100 * float(taps.ratio[i]), "damping_before_percent": 100 * float(before.ratio[i]),
                "damping_after_percent": None if after is None else 100 * float(after.ratio[i]),
            }
            for i in range(len(taps))
        ]  # fmt: skip


@takes_machine
@checked
@on_one_thread
def explain_taps(
    machine: Machine,
    taps: TapTest,
    statics: Experiment | None = None,
    *,
    default_u: float = 0.05,
    only: Sequence[str] | None = None,
) -> TapDiagnosis:
    """The effects that the frequencies of a tap test ask for, with static readings where there are any.

    Parameters
    ----------
    taps
        From `load_taps`.
    statics
        An experiment of the same machine (deflections or positions); the same parameter must then explain both.
    default_u
        Standard uncertainty of a mass that declares none, relative.
    only
        Kinds of effects to try; None: all that frequencies show.

    Raises StiffmapError for bad input.
    """
    problem = TapsProblem(machine, taps, statics, magnitude(default_u, "default_u", "1"))
    tried = [c for c in causes(problem) if only is None or c.kind in only]
    if not tried:
        raise StiffmapError(f"only: no candidate of {', '.join(only or ())} on {machine.name}")
    n, remarks, null = int(problem.used.sum()), _remarks(problem), fitted(problem, [])
    slopes = problem.slopes[problem.used]
    declared = Optimum(np.zeros(slopes.shape[1]), problem.residual(), slopes)
    fits = [null]

    def least() -> FittedCauses:
        return best_of(fits, len(tried))

    def search(at: FittedCauses) -> bool:
        """Whether further causes leave nothing to explain, or explain nothing more."""
        before = least()
        fresh = [fitted(problem, s) for s in named_causes(problem, tried, at)]
        near = sorted((f for f in (*fits, *fresh) if f.named), key=lambda f: f.chi2)[:REFINED]
        # without causes other modes may be paired from there than from the declared machine
        fits.extend([*fresh, *(fitted(problem, (), f.lines.x) for f in near if f in fresh)])
        return least().explains or (at is before and least() is before)

    if null.chi2 > price(len(tried)) and not search(replace(null, lines=declared)) and not search(null):
        while len(least().named) < MOST_EFFECTS and not search(least()):
            pass
    best, before = least(), min(f.chi2 for f in fits if not f.named)
    if not best.named:
        lead = "Nothing is missing that these readings show" if best.explains else (
            "The readings do not fit, and no effect explains them"
        )  # fmt: skip
        text = f"{lead}: chi-square {before:.1f} of {n} readings.{remarks}"
        return TapDiagnosis(before, n, (), text, best.explains)
    alike = [f for f in fits if f is not best and f.chi2 < best.chi2 + 2.0 * np.log(ODDS)]
    parts = [fitted(problem.only(part), best.causes) for part in PARTS] if statics else []
    named = []
    for k, e in enumerate(best.named):
        known = {o.place for o in best.named if o is not e}
        same = (f for f in alike if len(f.named) == len(best.named) and known < {s.place for s in f.named})
        steads = {s.place: s for f in same for s in f.named if s.place not in {*known, e.place}}
        instead = tuple(sorted(steads.values(), key=lambda s: s.chi2))
        e = e.by(*(f.named[k] for f in parts)) if parts else e
        named.append(replace(e, alike=instead))
    lead = "" if best.explains else "Not all is explained; "
    text = f"{lead}{_sentence(named, before, best.chi2, n)}{remarks}"
    return TapDiagnosis(before, n, tuple(named), text, best.explains, best.machine)


def _remarks(problem: TapsProblem) -> str:
    """What of the readings has no say, and how damping compares."""
    p, taps, text = predict_taps(problem.machine, problem.taps), problem.taps, ""
    lost = int(np.isnan(p.frequency).sum())
    if lost:
        text += f" {lost} of {len(taps)} rows are not used: their pose cannot be reached, or has no mode left for them."
    noise = int((np.isfinite(taps.direction).all(axis=1) & ~p.voted).sum())
    if noise:
        text += (
            f" The shape of {noise} rows is that of no mode near, as noise is: frequency alone assigns them."
        )
    merged = int((np.isfinite(taps.hammer[:, 0]) & (p.merged > 0)).sum())
    if merged:
        text += f" {merged} rows are several modes in one, of which only the frequency counts."
    off = np.log(taps.ratio / np.maximum(p.ratio, LEAST))
    if np.isfinite(off).any():
        low, high = 100 * np.nanmin(taps.ratio), 100 * np.nanmax(taps.ratio)
        text += (
            f" Damping is {low:.2g} to {high:.2g} %, {np.exp(np.nanmedian(off)):.2f} times the "
            f"{'assumed' if problem.declared.assumed else 'declared'} (median)."
        )
    return text


def _sentence(named: Sequence[Explained], before: float, after: float, n: int) -> str:
    sizes = [f"{e.candidate}: {k} = {v:.4g} ± {e.u[k]:.2g}" for e in named for k, v in e.parameters.items()]
    text = f"{'; '.join(sizes)}; chi-square {before:.1f} before, {after:.1f} after, {n} readings."
    for e in named:
        it = "it" if len(named) == 1 else e.candidate
        if e.alike:
            text += (
                f" These readings cannot distinguish {it} from: {'; '.join(a.candidate for a in e.alike)}."
            )
        on = "" if it == "it" else f" on {it}"
        if e.disagreement is not None and e.disagreement > DISAGREE:
            text += (
                f" Statics and frequencies disagree{on} by {e.disagreement:.1f} standard deviations (statics {e.statics:.4g}, "
                f"frequencies {e.taps:.4g}): friction, preload, or a servo that holds what creeps at rest."
            )
        elif e.disagreement is not None:
            text += f" Statics and frequencies agree{on} ({e.disagreement:.1f} standard deviations)."
    return text
