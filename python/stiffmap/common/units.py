"""Units of length, force, mass and angle, and their exact conversion to SI."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache
from typing import NamedTuple

LENGTHS = {
    "m": Fraction(1),
    "cm": Fraction(1, 100),
    "mm": Fraction(1, 1000),
    "um": Fraction(1, 10**6),
    "in": Fraction(254, 10**4),
}
SYNONYMS = {"inch": "in", "µm": "um", "μm": "um", "Nm": "N*m", "Nmm": "N*mm"}
"""Other ways to write a unit."""
FORCES = {"N": Fraction(1), "kN": Fraction(1000), "MN": Fraction(10**6)}
MASSES = {"kg": Fraction(1), "g": Fraction(1, 1000), "t": Fraction(1000)}
MOMENTS = {"N*m": Fraction(1), "N*mm": Fraction(1, 1000), "kN*m": Fraction(1000)}
STRESSES = {"Pa": Fraction(1), "MPa": Fraction(10**6), "GPa": Fraction(10**9), "N/mm2": Fraction(10**6)}
PLANE_ANGLES: dict[str, Fraction | float] = {
    "rad": Fraction(1),
    "mrad": Fraction(1, 1000),
    "urad": Fraction(1, 10**6),
    "deg": math.pi / 180,
    "°": math.pi / 180,
    "arcmin": math.pi / 10800,
    "arcsec": math.pi / 648000,
}
ANGLES = ("rad", "deg")
"""Those of a machine file."""


def name_and_unit(header: str) -> tuple[str, str]:
    """``x [mm]`` is x in mm; an empty unit where none stands in square brackets."""
    match = re.fullmatch(r"\s*(.*?)\s*(?:\[\s*(.*?)\s*\])?\s*", header)
    assert match is not None  # any text is a name
    return match[1], match[2] or ""


def size_of(unit: str, *tables: Mapping[str, Fraction | float]) -> float:
    """SI size of a unit of one of these tables, in any of its spellings; KeyError where it is in none."""
    name = SYNONYMS.get(unit, unit)
    for table in tables:
        if name in table:
            return float(table[name])
    raise KeyError(unit)


class Dimension(NamedTuple):
    """Exponents of length, force, angle and mass of a unit as it is, with its angles; times are in seconds."""

    length: int = 0
    force: int = 0
    angle: int = 0
    mass: int = 0


NONE = Dimension()
LENGTH = Dimension(length=1)
FORCE = Dimension(force=1)
MOMENT = Dimension(length=1, force=1)
ANGLE = Dimension(angle=1)
MASS = Dimension(mass=1)
INERTIA = Dimension(mass=1, length=2)
DENSITY = Dimension(mass=1, length=-3)
MODULUS = Dimension(force=1, length=-2)
BENDING = Dimension(force=1, length=2)


@lru_cache
def _scale(length: str, force: str, mass: str, dimension: Dimension) -> Fraction:
    return (
        LENGTHS[length] ** dimension.length
        * FORCES[force] ** dimension.force
        * MASSES[mass] ** dimension.mass
    )


@lru_cache
def _power_of_ten(scale: Fraction) -> int | None:
    """Exponent of a scale that is a power of ten."""
    exponent = len(str(scale.numerator)) - len(str(scale.denominator))
    return exponent if scale == Fraction(10) ** exponent else None


def _rounded_once(number: str, scale: Fraction) -> float:
    exponent = _power_of_ten(scale)
    if exponent is None or not number.replace(".", "").lstrip("-").isdigit():
        return float(Fraction(number) * scale)
    return float(f"{number}e{exponent}")


@dataclass(frozen=True)
class UnitSystem:
    """The units that a file declares once; derived units follow from them."""

    length: str = "m"
    force: str = "N"
    angle: str = "rad"
    mass: str = "kg"

    def to_si(self, value: float, dimension: Dimension) -> float:
        """SI value of ``value``, rounded once: 775 mm is the double nearest to 0.775 m.

        An angle that stands together with a force is in radians whatever `angle` says: stiffness, compliance, damping
        and friction per speed are per radian in every file. Otherwise a coupled matrix would not be symmetric.
        """
        scale = _scale(self.length, self.force, self.mass, dimension)
        # repr gives the decimal number that was written, so that no binary rounding enters twice
        result = value if scale == 1 else _rounded_once(repr(float(value)), scale)
        if self.angle == "deg" and dimension.angle and not dimension.force:
            result *= math.radians(1.0) ** dimension.angle
        return float(result)

    def say(self, si: float, dimension: Dimension, digits: int = 4) -> str:
        """An SI length or angle with its unit, as the file would write it."""
        unit = self.angle if dimension == ANGLE else self.length
        scale = math.radians(1.0) if unit == "deg" else 1.0 if unit == "rad" else float(LENGTHS[unit])
        return f"{si / scale:.{digits}g} {unit}"
