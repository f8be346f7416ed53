"""Numbers as they are written in tables and on command lines."""

from __future__ import annotations

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
