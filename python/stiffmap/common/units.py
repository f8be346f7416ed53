"""Units of length, force, moment, mass, angle and time: their sizes in SI, and how sheets spell them."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache
from typing import NamedTuple

LENGTHS = {
    "m": Fraction(1), "cm": Fraction(1, 100), "mm": Fraction(1, 1000), "um": Fraction(1, 10**6), "in": Fraction(254, 10**4),
}  # fmt: skip
SYNONYMS = {"inch": "in", "µm": "um", "μm": "um", "µrad": "urad", "Nm": "N*m", "Nmm": "N*mm"}
"""Other ways to write a unit."""
FORCES = {"N": Fraction(1), "kN": Fraction(1000), "MN": Fraction(10**6)}
MASSES = {"kg": Fraction(1), "g": Fraction(1, 1000), "t": Fraction(1000)}
MOMENTS = {"N*m": Fraction(1), "N*mm": Fraction(1, 1000), "kN*m": Fraction(1000)}
STRESSES = {"Pa": Fraction(1), "MPa": Fraction(10**6), "GPa": Fraction(10**9), "N/mm2": Fraction(10**6)}
PLANE_ANGLES: dict[str, Fraction | float] = {
    "rad": Fraction(1), "mrad": Fraction(1, 1000), "urad": Fraction(1, 10**6), "deg": math.pi / 180, "°": math.pi / 180,
    "arcmin": math.pi / 10800, "arcsec": math.pi / 648000,
}  # fmt: skip
SIZES: dict[str, Fraction | float] = {**LENGTHS, **FORCES, **MASSES, **MOMENTS, **STRESSES, **PLANE_ANGLES}
TIMES = {"s": Fraction(1), "min": Fraction(60)}
SHORT_TIMES = {"ms": 1e-3, "us": 1e-6, "µs": 1e-6, "μs": 1e-6}
"""Of the time in tables alone."""
FREQUENCIES = {
    "hz": 1.0, "hertz": 1.0, "khz": 1e3, "rad/s": 0.5 / math.pi, "rad/sec": 0.5 / math.pi, "krpm": 1e3 / 60,
    **dict.fromkeys(("rpm", "cpm", "1/min", "u/min", "rev/min", "r/min", "min^-1", "min-1", "min⁻¹"), 1 / 60),
}  # fmt: skip
"""Of what turns or swings, in Hz by their names in small letters."""
FEEDS = {"ipm": "in/min", "ipr": "in/rev", "ipt": "in/tooth", "u": "rev", "r": "rev", "z": "tooth", "zahn": "tooth"}  # fmt: skip
"""Other ways to write a feed, or what it is by."""
DISPLAY_UNITS = {
    "m": (1e3, "mm"),
    "m/N": (1e3, "mm/N"),
    "rad": (1e3, "mrad"),
    "rad/m": (1e3, "mrad/m"),
    "1/m": (1e-3, "1/mm"),
}
"""In which results are printed, by the unit of SI; others as they are."""
HALF_WIDTH = str.maketrans("（）［］，：　", "()[],: ")
"""Brackets and signs of a Chinese or Japanese keyboard as Latin ones."""
QUANTITIES = {"m": "length", "N": "force", "N*m": "moment", "rad": "angle"}
"""By the unit of SI."""
GRAVITY = Fraction("9.80665")
"""Standard acceleration of gravity, m/s²: the weight of a kilogram in N."""
POUND = Fraction("4.4482216152605")
"""A pound-force, N."""


def feed_unit(text: str) -> tuple[str, str]:
    """The length of a feed (with its number, if any) by ``tooth`` or ``rev``, and which: mm/U is by rev; else a speed, and nothing."""
    unit = re.sub(r"(?i)(?<![a-z])ip[mrt]$", lambda m: FEEDS[m[0].lower()], text.strip())
    length, _, per = re.sub(r"_(?:per_)?(?=\w+$)", "/", unit).rpartition("/")
    per = FEEDS.get(per.lower(), per.lower())
    return (length.strip(), per) if per in ("tooth", "rev") else (unit, "")


class Unit(NamedTuple):
    """A unit of experiment files, and how many of it one of a sheet's is."""

    name: str
    factor: float = 1.0
    mass: bool = False
    """Of a mass that stands for its weight."""

    @property
    def size(self) -> float:
        """In SI."""
        return self.factor * size_of(self.name)


def _table(*rows: tuple[str, str, Fraction | float]) -> dict[str, Unit]:
    return {word: Unit(name, float(size)) for words, name, size in rows for word in words.split("|")}


SPELLINGS = {
    "length": _table(
        ("m|metres|meters|米", "m", 1), ("cm", "cm", 1),
        ("mm|millimetres|millimeters|millimetre|millimeter|millimètres|milímetros|毫米", "mm", 1),
        ("um|µm|μm|micron|microns|微米|1/1000mm|0.001mm|mm/1000", "um", 1),
        ("in|inch|inches|zoll|\"|''", "in", 1),
        ("mil|mils|thou|in/1000|1/1000in|0.001in|thousandths", "in", 1e-3),
        ("tenth|tenths|0.0001in|1/10000in", "in", 1e-4),
        ("1/100mm|0.01mm|mm/100|hundertstel|1/100|0.01", "um", 10),
        ("1/10mm|0.1mm|mm/10|zehntel", "um", 100),
    ),
    "force": _table(
        ("n|newton|牛|牛顿", "N", 1), ("kn", "kN", 1), ("dan", "N", 10), ("kgf|kp|kilopond", "N", GRAVITY),
        ("gf|p", "N", GRAVITY / 1000), ("lbf|lb|lbs|pound", "N", POUND), ("kip", "kN", POUND),
        ("ozf|oz", "N", POUND / 16),
    )
    | {w: Unit("N", float(GRAVITY * MASSES[w]), True) for w in MASSES},
    "angle": _table(
        ("rad|弧度", "rad", 1), ("mrad|mm/m", "mrad", 1), ("urad|µrad|μrad|um/m|µm/m", "mrad", 1e-3),
        ("deg|°|grad|degree|degrees|度", "deg", 1), ("arcmin|'", "deg", 1 / 60), ("arcsec|sec", "deg", 1 / 3600), ("gon", "deg", 0.9),
    ),
    "moment": _table(
        ("nm|n*m|牛米", "N*m", 1), ("nmm|n*mm", "N*mm", 1), ("ncm|n*cm", "N*mm", 10), ("knm|kn*m", "kN*m", 1),
        ("kgfm|kpm|kgf*m|kp*m|mkp", "N*m", GRAVITY),
        ("lbfft|ftlbf|ftlb|lbf*ft|lb*ft|ft*lbf|ft*lb", "N*m", float(POUND) * 0.3048),
        ("lbfin|inlbf|inlb|lbf*in|lb*in|in*lbf|in*lb", "N*m", float(POUND) * 0.0254),
    ),
    "temperature": _table(("°c|degc|c|celsius", "degC", 1), ("k|kelvin", "K", 1)),
}  # fmt: skip
"""Quantity -> units as workshops write them, in small letters."""
SHOWN = {
    "length": "m, cm, mm, µm, in, mil, thou, in/1000, 1/100 mm, 1/1000 mm",
    "force": "N, daN, kN, kgf, kp, lbf, and kg of a mass that hangs",
    "angle": "rad, mrad, µrad, deg, gon, arcmin, arcsec",
    "moment": "N*m, N*mm, kN*m, kgf*m, lbf*ft, lbf*in",
    "temperature": "°C, K",
}


def unit_of(text: str, quantity: str | None = None) -> Unit | None:
    """A unit as a sheet writes it, of one quantity or of any; None for what is none."""
    if text.strip() in ("MN", "mN"):  # a factor of 1e9 between the two: here the case decides
        return Unit("MN") if text.strip() == "MN" and quantity in (None, "force") else None
    key = re.sub(r"\s+|^\[|\]$", "", text.strip().lower())
    key = re.sub(r"(?<=[a-z])[-·⋅.](?=[a-z])", "*", key).replace(",", ".").rstrip(".")
    tables = SPELLINGS.values() if quantity is None else (SPELLINGS[quantity],)
    return next((t[key] for t in tables if key in t), None)


def known(quantity: str | None = None) -> str:
    """The units that are understood, of one quantity or of all."""
    return SHOWN[quantity] if quantity else "; ".join(SHOWN.values())


def name_and_unit(header: str) -> tuple[str, str]:
    """``x [mm]`` is x in mm; an empty unit where none stands in brackets, as in joint[1] and T(1,2)."""
    header = header.translate(HALF_WIDTH)
    if not header.rstrip().endswith(("]", ")")):  # an endless header of brackets takes seconds
        return header.strip(), ""
    match = re.fullmatch(
        r"(?s)\s*(.*?)\s*(?:(?!(?:\b|(?<=\]))\[(?:\w+_)?\d+\]|\b[\[(]\d+, ?\d+[\])])(?:\[\s*([^]]*?)\s*\]|\(\s*((?:[^()]|\([^()]*\))*?)\s*\)|[\[(]\s*([^])]*?)\s*[])]))?\s*",
        header,
    )
    assert match is not None  # any text is a name
    return match[1], match[2] or match[3] or match[4] or ""


def size_of(unit: str) -> float:
    """SI size of a unit as files declare it; KeyError for another one."""
    return float(SIZES[SYNONYMS.get(unit, unit)])


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
def _scale(length: str, force: str, mass: str, dimension: Dimension) -> tuple[Fraction, int | None]:
    """Of a dimension, and its exponent where it is a power of ten."""
    scale = (
        LENGTHS[length] ** dimension.length
        * FORCES[force] ** dimension.force
        * MASSES[mass] ** dimension.mass
    )
    exponent = len(str(scale.numerator)) - len(str(scale.denominator))
    return scale, exponent if scale == Fraction(10) ** exponent else None


def _rounded_once(number: str, scale: Fraction, exponent: int | None) -> float:
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
        scale, exponent = _scale(self.length, self.force, self.mass, dimension)
        # repr gives the decimal number that was written, so that no binary rounding enters twice
        result = value if exponent == 0 else _rounded_once(repr(float(value)), scale, exponent)
        if self.angle == "deg" and dimension.angle and not dimension.force:
            result *= math.radians(1.0) ** dimension.angle
        return float(result)

    def say(self, si: float, dimension: Dimension, digits: int = 4) -> str:
        """An SI length or angle with its unit, as the file would write it."""
        unit = self.angle if dimension == ANGLE else self.length
        scale = math.radians(1.0) if unit == "deg" else 1.0 if unit == "rad" else float(LENGTHS[unit])
        return f"{si / scale:.{digits}g} {unit}"
