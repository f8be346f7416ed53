"""Numbers as they are written in tables and on command lines."""

from __future__ import annotations

from math import floor, isfinite, log10


def number_in(text: str) -> float:
    """The number that a text is; ValueError for what only Python takes for one: ``1_0``, digits of other scripts."""
    if "_" in text or not text.isascii():
        raise ValueError(f"could not convert string to float: {text!r}")
    return float(text)


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
