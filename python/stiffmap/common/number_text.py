"""Numbers as they are written in tables, on command lines and in texts of effects, with a unit there: ``12um``, ``1.4e-4 mm/N``."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Sequence
from fractions import Fraction
from math import floor, inf, isfinite, log10

from stiffmap.common.errors import StiffmapError
from stiffmap.common.units import FORCES, LENGTHS, MASSES, PLANE_ANGLES, STRESSES, SYNONYMS, TIMES

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
        return f"{value + 0.0:.4g}"  # no -0
    exponent = floor(log10(u))
    last = exponent - (u < 1.95 * 10.0**exponent)
    if not -6 <= exponent <= 6:
        return f"{value:.{max(0, min(floor(log10(abs(value))) - last, 12)) if value else 0}e}"
    return f"{round(value, -last) + 0.0:.{max(0, -last)}f}"


_MICRO = Fraction(1, 10**6)
_PLAIN = {"1": Fraction(1), "%": Fraction(1, 100), "ppm": _MICRO}
_NUMBER = re.compile(r"^([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)(.*)$")
LONGEST_NUMBER = 100
"""Characters."""
_ATOM = re.compile(r"^([^\d^]+|1)(?:\^?(\d))?$")

_WORKSHOP = {
    "m": ("um", "mm"), "rad": ("mrad", "deg"), "m/N": ("mm/N", "um/N"), "N/m": ("N/mm", "N/um"), "m/s": ("mm/min", "m/min"),
    "N/m2": ("N/mm2", "MPa"),
}  # fmt: skip
"""Units that a workshop writes, so that no message invites metres."""

Dimension = tuple[tuple[str, int], ...]


def _atoms() -> dict[str, tuple[Fraction | float, str]]:
    small = {"nm": _MICRO / 1000}, {"mN": Fraction(1, 1000)}  # too easily taken for N·m and MN in a table
    units = (
        (LENGTHS | small[0], "m"), (FORCES | small[1], "N"), (MASSES, "kg"), (PLANE_ANGLES, "rad"), (TIMES, "s"),
        ({"K": Fraction(1)}, "K"), (_PLAIN, ""),
    )  # fmt: skip
    table = {name: (size, dimension) for sizes, dimension in units for name, size in sizes.items()}
    return table | {other: table[name] for other, name in SYNONYMS.items() if name in table}


ATOMS = _atoms()


def unit_factor(unit: str) -> tuple[Fraction | float, Dimension]:
    """SI factor and dimension of a product or quotient of units; StiffmapError for an unknown one."""
    unit = unit.strip()
    if unit in STRESSES:  # a name for a quotient
        return STRESSES[unit], (("N", 1), ("m", -2))
    factor: Fraction | float = Fraction(1)
    powers: Counter[str] = Counter()
    for name, power in terms(unit):
        if name not in ATOMS:
            raise StiffmapError(
                f"unknown unit {name!r} in {unit!r}; known: {', '.join(sorted([*ATOMS, *STRESSES]))}"
            )
        size, dimension = ATOMS[name]
        factor = factor * size**power
        powers[dimension] += power
    powers.pop("", None)
    return factor, tuple(sorted((d, p) for d, p in powers.items() if p))


def terms(unit: str) -> list[tuple[str, int]]:
    """Atoms with their powers: ``rad/(N·m)`` is rad^1, N^-1, m^-1. StiffmapError for what is none."""
    out = []
    unit = unit.replace("²", "2").replace("³", "3")
    unit = f"1{unit}" if unit.startswith("/") else unit
    numerator, *denominators = re.split(r"/", unit.replace(" ", ""))
    for sign, part in [(1, numerator), *((-1, d) for d in denominators)]:
        for atom in re.split(r"[*·]", part.strip("()")):
            match = _ATOM.match(atom)
            if not match:
                raise StiffmapError(f"cannot read the unit {unit!r}")
            out.append((match[1], sign * int(match[2] or 1)))
    return out


def read_value(text: str, expected: str) -> float:
    """SI value of ``text`` in a unit that fits ``expected``, rounded once; raises StiffmapError."""
    match = _NUMBER.match(text.strip())
    if not match:
        raise StiffmapError(f"expected a number with a unit ({expected}), got {text!r}")
    number, unit = match[1], match[2].strip()
    exponent = number.lower().partition("e")[2]
    if len(number) > LONGEST_NUMBER or len(exponent) > 4:  # exact fractions of such would fill the memory
        raise StiffmapError(f"expected a number that is neither endless nor enormous, got {text!r}")
    want = unit_factor(expected)[1]
    if not unit:
        if want:
            written = " or ".join(number + unit for unit in _WORKSHOP.get(expected, (expected,)))
            raise StiffmapError(f"the unit is missing: write {written}; got {text!r}")
        return number_in(number)
    factor, dimension = unit_factor(unit)
    if dimension != want:
        raise StiffmapError(f"expected a unit such as {expected}, got {unit!r}")
    if isinstance(factor, Fraction):  # 12um is the double nearest to 12e-6
        return bounded(float(Fraction(number) * factor))
    return bounded(number_in(number) * factor)
