"""The verdict in plain sentences, in mm, deg and N."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from stiffmap.common.number_text import within
from stiffmap.identification.diagnosis.decision.patterns import Pattern
from stiffmap.identification.diagnosis.report.findings import Effect, Findings
from stiffmap.identification.diagnosis.rivals.separation import Separation
from stiffmap.identification.diagnosis.slips.slip import Slip

DISPLAY_UNITS = {"m": (1e3, "mm"), "m/N": (1e3, "mm/N"), "rad": (1e3, "mrad"), "1/m": (1e-3, "1/mm")}
LISTED = 5
"""Steps left out that are named."""
VERDICTS = {
    "none": "no effect above the limits of this experiment",
    "effects": "the nominal model lacks the effects below",
    "ambiguous": "explained, but not by one explanation alone",
    "unattributed": "real structure that no known effect explains",
    "effects+unattributed": "explained in part; real structure remains",
    "readings": "a mistake in the readings comes before any cause",
}


def five_lines(d: Findings) -> list[str]:
    """Verdict, effects, before and after, noise, and what could not be seen; then the calibration, if any."""
    return [
        f"verdict: {d.verdict} - {VERDICTS[d.verdict]}",
        *(f"readings: {s.check}: {s.seen}{_undone(s)}{_also(s)}" for s in d.slips),
        "effects: " + ("; ".join(effect_text(e) for e in d.effects) or "none") + _others(d),
        f"held-out readings: rms {_thousandth(*d.before.size)} before, {_thousandth(*d.after.size)} after "
        f"(noise floor {_thousandth(noise_size(d), d.before.size[1])}, ratio {_ratio(d):.3f}, n = {d.after.n})",
        _left(d),
        _limits(d),
        *_more(d),
    ]


def _undone(s: Slip) -> str:
    evidence = f"; {'; '.join(s.evidence)}" if s.evidence else ""
    return f"{evidence}; what follows is of readings with it undone" if s.undone else evidence


def _also(s: Slip) -> str:
    return "".join(f"; or {a}: these readings cannot determine which" for a in s.also)


def noise_size(d: Findings) -> float:
    """Noise floor in the unit of the readings' sizes, m or rad; what no model explains is not in it."""
    if d.calibration is not None:
        return d.calibration.noise
    floors = np.array(list(d.noise.floor.values()))
    return d.noise.rms if d.before.size[1] == "m" else float(np.sqrt(np.mean(floors**2)))


def _ratio(d: Findings) -> float:
    if d.calibration is not None:
        return d.after.size[0] / noise_size(d)
    return d.after.ratio


def _thousandth(value: float, unit: str) -> str:
    """``0.0123 mm`` or ``0.0123 mrad``."""
    return f"{1e3 * value:.4f} m{unit}"


def _more(d: Findings) -> list[str]:
    """Share explained where an unexplained residual remains, the calibration below the effects, what is not named and why."""
    out = []
    if d.unexplained:
        h = d.held_out
        gain = ""
        if h is not None and h.gain is not None and d.effects:
            gain = f"; held-out gain {h.gain[0]:.3g} ± {h.gain[1]:.2g} noise variances per reading"
        before, after = d.before.size[0], d.after.size[0]
        all_ = 1.0 - (after / before) ** 2 if before > 0 else 0.0
        out.append(
            f"explained: {100 * all_:.1f} % of the squares against your file, {100 * d.explained:.1f} % of the misfit "
            f"by effects{gain}"
        )
    if d.calibration is not None:
        c = d.calibration
        out += [
            f"calibration: {c.verdict}, {c.rank} directions determined",
            *c.lines()[1 : 1 + len(c.beyond) + len(c.wider) + len(c.refused)],
        ]
        out += [line for line in c.lines() if line.startswith(("groups:", "model-form"))]
    out += [f"not named: {why}" for why in d.refused]
    if d.stopped:
        out.append("stopped early: this is the best so far" + _not_tried(d.not_tried))
    return out


def _not_tried(what: Sequence[str]) -> str:
    more = f" and {len(what) - LISTED} more" if len(what) > LISTED else ""
    return f"; not tried: {'; '.join(what[:LISTED])}{more}" if what else ""


def in_display_units(value: float, unit: str) -> str:
    """A number in the units of the screen."""
    factor, name = DISPLAY_UNITS.get(unit, (1.0, unit))
    return f"{value * factor:.4g} {name}" if name != "1" else f"{value:.4g}"


def effect_text(e: Effect) -> str:
    """``compliance of actuator, leg z: scale 2.148 [2.137, 2.159]``."""
    legs = f", leg{'s' if len(e.legs) > 1 else ''} {', '.join(e.legs)}" if e.legs else ""
    values = []
    for name, (value, low, high, unit) in e.parameters.items():
        factor, label = DISPLAY_UNITS.get(unit, (1.0, unit))
        half = factor * abs(high - low) / 2 / 1.96
        at, *ends = (within(factor * v, half) for v in (value, low, high))
        text = f"{name} {at} [{', '.join(ends)}]"
        values.append(text if label == "1" else f"{text} {label}")
    n = len(e.aliases)
    same = f" (these readings cannot distinguish it from {n} other{'s' if n > 1 else ''})" if n else ""
    return f"{e.kind} of {e.element}{legs}: {', '.join(values)}{same}"


def separation_text(s: Separation) -> str:
    """Where, load, axis, how many."""
    where = ", ".join(f"{1e3 * v:.0f}" for v in s.position)
    load = ", ".join(f"{v:.0f}" for v in s.force)
    many = (
        f"{s.readings} reading{'s' if s.readings != 1 else ''}"
        if s.readings
        else "no sensible number of readings"
    )
    gap = f"{1e3 * s.difference:.4f} mm"
    return f"read {s.axis} at ({where}) mm under force ({load}) N: they differ by {gap}, {many}"


def _others(d: Findings) -> str:
    if not d.alternatives:
        return ""
    other = " or ".join(
        " + ".join(f"{e.kind} of {e.element} {' '.join(e.legs)}" for e in a) for a in d.alternatives
    )
    return f" -- or instead: {other}"


def _left(d: Findings) -> str:
    if d.unexplained:
        p = d.unexplained[0]
        more = (
            f"; an empirical correction would leave {_thousandth(d.empirical.after, d.before.size[1])}"
            if d.empirical
            else ""
        )
        detail = f", {p.detail}" if p.detail else ""
        return f"unexplained: {p.what} in {p.axis} (p = {p.p:.1g}){detail}{_place(p)}{more}"
    if d.separations:
        return f"to separate: {separation_text(d.separations[0])}"
    out = f"{len(d.outliers)} outliers listed" if d.outliers else "no outliers"
    return f"nothing unexplained: lack of fit p = {d.noise.lack_of_fit_after:.2g}; {out}"


def _place(p: Pattern) -> str:
    if p.position is None:
        return ""
    where = ", ".join(f"{1e3 * v:.0f}" for v in p.position)
    return (
        f"; largest at ({where}) mm, {in_display_units(p.size, 'rad' if p.axis.startswith('r') else 'm')} rms"
    )


def _limits(d: Findings) -> str:
    if d.limitations:
        return "limits: " + "; ".join(d.limitations[:3])
    return (
        f"could see: {len(d.detectable)} effects; could not see: {len(d.unobservable)} (listed in the report)"
    )
