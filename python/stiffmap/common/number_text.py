"""Numbers as they are written in tables and on command lines."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from math import floor, inf, isfinite, log10

from stiffmap.common.errors import StiffmapError

LARGEST, SMALLEST = 1e60, 1e-60
"""Bounds of what is read: squares of ratios of two numbers stay finite. What is smaller is 0, such as a tensor's dust."""


def number_in(text: str) -> float:
    """The number that a text is; ValueError for what only Python takes for one (``1_0``, digits of other scripts)
    and beyond ``LARGEST``."""
    if "_" in text or not text.isascii():
        raise ValueError(f"could not convert string to float: {text!r}")
    return bounded(float(text))


def bounded(value: float) -> float:
    """A number as it is, 0 where it is below ``SMALLEST``; StiffmapError for one beyond ``LARGEST`` that is not endless."""
    if LARGEST < abs(value) < inf:
        raise StiffmapError(
            f"the number is too large: expected at most {LARGEST:.0e}, found {str(value)[:20]}"
        )
    return 0.0 if abs(value) < SMALLEST else value


def percent(share: float) -> str:
    """A share of a whole in per cent, to two digits: ``0.097 %``, ``14 %``, ``100 %``."""
    value = 100.0 * share
    return f"{value:.0f} %" if value >= 99.5 else f"{value:.2g} %"


def percents(shares: Sequence[float]) -> list[int]:
    """Shares in whole per cent whose sum is that of the shares, rounded: the largest remainders are rounded up."""
    exact = [100.0 * s for s in shares]
    whole = [floor(v) for v in exact]
    for i in sorted(range(len(exact)), key=lambda i: whole[i] - exact[i])[: round(sum(exact)) - sum(whole)]:
        whole[i] += 1
    return whole


def length_unit(largest: float, from_mm: float = 0.99995e-3) -> tuple[str, float, int]:
    """Unit, factor from m and decimals in which a deflection of this size reads well: µm, and mm from 1 mm on."""
    return ("µm", 1e6, 1) if abs(largest) < from_mm else ("mm", 1e3, 3)


def length_text(size: float) -> str:
    """A deflection (m): ``932.5 µm``, ``8.062 mm``."""
    unit, factor, decimals = length_unit(size)
    return f"{factor * size:.{decimals}f} {unit}"


def vector_text(values: Iterable[float], digits: int = 6) -> str:
    """``(0, -300, 0)``: what is only round-off of the largest component is 0."""
    numbers = [float(v) for v in values]
    dust = 1e-9 * max(map(abs, numbers), default=0.0)
    return f"({', '.join(f'{v if abs(v) > dust else 0.0:.{digits}g}' for v in numbers)})"


def place_text(position: Iterable[float], form: str = "g") -> str:
    """A position (3,) m in mm, each coordinate in a form of `format`: ``(0, -200, 300) mm``."""
    return f"({', '.join(f'{1e3 * v:{form}}' for v in position)}) mm"


def with_uncertainty(value: float, u: float) -> str:
    """``0.301 ± 0.002``: both to the first digit of the uncertainty, to the second where that is a 1; the uncertainty is never 0."""
    return f"{within(value, u)} ± {within(u, u)}"


def within(value: float, u: float) -> str:
    """A value to the digits that its uncertainty carries; of very small and very large ones as a power of ten.

    To four digits where there is no uncertainty.
    """
    if not (u > 0 and isfinite(u) and isfinite(value)):
        return f"{value:.4g}"
    exponent = floor(log10(u))
    last = exponent - (u < 1.95 * 10.0**exponent)
    if not -6 <= exponent <= 6:
        return f"{value:.{max(0, min(floor(log10(abs(value))) - last, 12)) if value else 0}e}"
    return f"{round(value, -last):.{max(0, -last)}f}"
