"""The verdict in plain sentences, in mm, deg and N."""

from __future__ import annotations

import numpy as np

from stiffmap.common.number_text import percent, with_uncertainty, within
from stiffmap.identification.candidates.candidates import words
from stiffmap.identification.diagnosis.report.findings import Effect, Findings, FoundNumber, Rest
from stiffmap.identification.diagnosis.report.separation import Separation
from stiffmap.identification.diagnosis.slips.slip import Slip
from stiffmap.identification.inference.shares import largest
from stiffmap.solve.validity import Validity

DISPLAY_UNITS = {"m": (1e3, "mm"), "m/N": (1e3, "mm/N"), "rad": (1e3, "mrad"), "1/m": (1e-3, "1/mm")}
LISTED = 5
"""Steps left out, numbers, and what cannot be distinguished from an effect: how many are named."""
VERDICTS = {
    "none": "no effect above the limits of this experiment",
    "effects": "the declared machine lacks what is named below",
    "ambiguous": "explained, but not by one explanation alone",
    "unattributed": "real structure that no known effect explains",
    "effects+unattributed": "explained in part; real structure remains",
    "readings": "a mistake in the readings comes before any cause",
}


def five_lines(d: Findings) -> list[str]:
    """Verdict, effects, before and after, noise, and what could not be seen; then the calibration, if any."""
    return [
        f"verdict: {d.verdict} - {VERDICTS[d.verdict]}",
        *(f"readings: {_slip(s)}" for s in d.slips),
        "effects: " + ("; ".join(effect_text(e) for e in d.effects) or "none") + _others(d),
        *(f"number: {number_text(n)}" for n in (d.calibration.beyond if d.calibration else ())[:LISTED]),
        f"held-out readings: rms {_thousandth(*d.before.size)} before, {_thousandth(*d.after.size)} after "
        f"(noise {_thousandth(noise_size(d), d.before.size[1])}, ratio {d.after.size[0] / noise_size(d):.3f}, n = {d.after.n}){_promise(d)}",
        _left(d),
        _limits(d),
        *_more(d),
    ]


def _slip(s: Slip) -> str:
    undone = ["what follows is of readings with it undone"] if s.undone else []
    also = [f"or {a}: these readings cannot determine which" for a in s.also]
    return "; ".join([f"{s.check}: {s.seen}", *s.evidence, *undone, *also])


def noise_size(d: Findings) -> float:
    """Noise of the readings in the unit of their sizes, m or rad; what no model explains is not in it."""
    floors = np.array(list(d.noise.floor.values()))
    size = d.noise.rms if d.before.size[1] == "m" else float(np.sqrt(np.mean(floors**2)))
    return d.noise.scale * size


def _thousandth(value: float, unit: str) -> str:
    """``0.0123 mm`` or ``0.0123 mrad``."""
    return f"{1e3 * value:.4f} m{unit}"


def _more(d: Findings) -> list[str]:
    """How the difference is shared out, which machine is handed over, what is not named and why."""
    out = []
    shared = largest(d.shares)
    if d.verdict != "none" and len(shared) > 1:
        out.append(f"shares of the squares: {'; '.join(shared)}")
    if d.which == "declared" and d.effects:
        out.append(
            "machine.yaml is the declared machine: none that was corrected predicts unseen readings better"
        )
    if d.calibration is not None:
        out.append(f"declared numbers: {d.calibration.verdict}")
    out += [f"not named: {why}" for why in d.refused]
    if d.stopped:
        more = f" and {len(d.not_tried) - LISTED} more" if len(d.not_tried) > LISTED else ""
        what = f"; not tried: {'; '.join(d.not_tried[:LISTED])}{more}" if d.not_tried else ""
        out.append(f"stopped early: this is the best so far{what}")
    return out


def _promise(d: Findings) -> str:
    """What a reading at a pose that was not read will differ by from the machine that is handed over."""
    v = Validity.of_machine(d.machine)
    if d.which == "declared" or v is None or v.error is None:
        return ""
    return f"; machine.yaml ({d.which}) promises {with_uncertainty(1e3 * v.error, 1e3 * v.error_u)} m{v.unit}"


def number_text(n: FoundNumber) -> str:
    """``zero of j4: 0.81 ± 0.02 mrad off (8.1 standard uncertainties)``."""
    factor, label = DISPLAY_UNITS.get(n.unit, (1.0, n.unit))
    off = with_uncertainty(factor * n.value, factor * n.u)
    many = abs(n.value) / n.sigma
    return f"{n.name}: {off} {'' if label == '1' else label} off ({many:.2g} standard uncertainties)".replace(
        "  ", " "
    )


def digits(factor: float, value: float, low: float, high: float) -> list[str]:
    """A value and the ends of its 95 % interval, times a factor, all to the digits that the value carries."""
    half = factor * abs(high - low) / 2 / 1.96
    return [within(factor * v, half) for v in (value, low, high)]


def effect_text(e: Effect) -> str:
    """``compliance of actuator, leg z: scale 2.148 [2.137, 2.159]``."""
    values = []
    for name, (*numbers, unit) in e.parameters.items():
        factor, label = DISPLAY_UNITS.get(unit, (1.0, unit))
        at, *ends = digits(factor, *numbers)
        text = f"{name} {at} [{', '.join(ends)}]"
        values.append(text if label == "1" else f"{text} {label}")
    others = list(dict.fromkeys(words(a["kind"], a["element"], a["legs"]) for a in e.aliases))
    more = [f"{len(others) - LISTED} more"] if len(others) > LISTED else []
    same = "; ".join([*others[:LISTED], *more])
    same = f" (these readings cannot distinguish it from {same})" if same else ""
    return f"{words(*e.place)}: {', '.join(values)}{same}"


def separation_text(s: Separation) -> str:
    """Where, load, axis, how many."""
    where = ", ".join(f"{1e3 * v:.0f}" for v in s.position)
    load = ", ".join(f"{v:.0f}" for v in s.force)
    many = f"{s.readings or 'no sensible number of'} reading{'s' if s.readings != 1 else ''}"
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
        return f"unexplained: {p.what}, {percent(p.share)} of the squares{_place(p)}"
    if d.separations:
        return f"to separate: {separation_text(d.separations[0])}"
    out = f"{len(d.outliers)} outliers listed" if d.outliers else "no outliers"
    return f"nothing unexplained: lack of fit p = {d.noise.lack_of_fit_after:.2g}; {out}"


def _place(p: Rest) -> str:
    if p.position is None:
        return ""
    where = ", ".join(f"{1e3 * v:.0f}" for v in p.position)
    unit = "mrad" if p.axis.startswith("r") else "mm"
    return f"; largest in {p.axis} at ({where}) mm, {1e3 * p.size:.4g} {unit} rms"


def _limits(d: Findings) -> str:
    if d.limitations:
        return "limits: " + "; ".join(d.limitations[:3])
    return (
        f"could see: {len(d.detectable)} effects; could not see: {len(d.unobservable)} (listed in the report)"
    )
