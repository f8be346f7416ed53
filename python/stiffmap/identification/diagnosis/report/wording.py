"""Effects, numbers and measurements in words, in mm, deg and N."""

from __future__ import annotations

from stiffmap.common.number_text import with_uncertainty, within
from stiffmap.identification.candidates.candidates import words
from stiffmap.identification.diagnosis.report.findings import Effect, FoundNumber
from stiffmap.identification.diagnosis.report.separation import Separation

DISPLAY_UNITS = {"m": (1e3, "mm"), "m/N": (1e3, "mm/N"), "rad": (1e3, "mrad"), "1/m": (1e-3, "1/mm")}
LISTED = 5
"""Steps left out, numbers, and what cannot be distinguished from an effect: how many are named."""


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
