"""Values with units in effect texts: ``12um``, ``1.4e-4 mm/N``, ``0.3mrad``."""

from __future__ import annotations

import re
from collections import Counter
from fractions import Fraction

from stiffmap.common.errors import StiffmapError
from stiffmap.common.number_text import bounded, number_in
from stiffmap.common.units import FORCES, LENGTHS, MASSES, PLANE_ANGLES, STRESSES, SYNONYMS, TIMES

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
