"""Units as workshops write them, as those of experiment files and a factor."""

from __future__ import annotations

import re
from dataclasses import dataclass


@dataclass(frozen=True)
class Unit:
    """A unit of experiment files, and how many of it one of the sheet's is."""

    name: str
    factor: float = 1.0


POUND, KILOPOND = 4.4482216152605, 9.80665


def _table(*rows: tuple[str, str, float]) -> dict[str, Unit]:
    return {word: Unit(name, factor) for words, name, factor in rows for word in words.split("|")}


LENGTHS = _table(
    ("m", "m", 1.0),
    ("cm", "cm", 1.0),
    ("mm", "mm", 1.0),
    ("um|µm|μm|micron|microns|1/1000mm|0.001mm|mm/1000", "um", 1.0),
    ("nm(length)", "um", 1e-3),
    ("in|inch|inches|zoll|\"|''", "in", 1.0),
    ("mil|mils|thou|in/1000|1/1000in|0.001in|thousandths", "in", 1e-3),
    ("tenth|tenths|0.0001in|1/10000in", "in", 1e-4),
    ("1/100mm|0.01mm|mm/100|hundertstel|1/100|0.01", "um", 10.0),
    ("1/10mm|0.1mm|mm/10|zehntel", "um", 100.0),
)
FORCES = _table(
    ("n|newton", "N", 1.0),
    ("kn", "kN", 1.0),
    ("dan", "N", 10.0),
    ("kgf|kp|kg|kilopond", "N", KILOPOND),
    ("gf|p", "N", 1e-3 * KILOPOND),
    ("lbf|lb|lbs|pound", "N", POUND),
    ("kip", "kN", POUND),
    ("ozf|oz", "N", POUND / 16),
)
ANGLES = _table(
    ("rad", "rad", 1.0),
    ("mrad|mm/m", "mrad", 1.0),
    ("urad|µrad|μrad|um/m|µm/m", "mrad", 1e-3),
    ("deg|°|grad|degree|degrees", "deg", 1.0),
    ("arcmin|'", "deg", 1 / 60),
    ("arcsec|sec", "deg", 1 / 3600),
)
MOMENTS = _table(
    ("nm|n*m|n·m", "N*m", 1.0),
    ("nmm|n*mm|n·mm", "N*mm", 1.0),
    ("knm|kn*m|kn·m", "kN*m", 1.0),
    ("kgfm|kpm|kgf*m|kp*m|mkp", "N*m", KILOPOND),
    ("lbfft|ftlbf|lbf*ft|ft*lbf|ft-lb|ft·lb|lbf·ft", "N*m", POUND * 0.3048),
    ("lbfin|lbf*in|in*lbf|in-lb|lbf·in", "N*m", POUND * 0.0254),
)
TEMPERATURES = _table(("°c|degc|c|celsius", "degC", 1.0), ("k|kelvin", "K", 1.0))
TABLES = {
    "length": LENGTHS,
    "force": FORCES,
    "angle": ANGLES,
    "moment": MOMENTS,
    "temperature": TEMPERATURES,
}
SHOWN = {
    "length": "m, cm, mm, µm, in, mil, thou, in/1000, 1/100 mm, 1/1000 mm",
    "force": "N, daN, kN, kgf, kp, lbf",
    "angle": "rad, mrad, µrad, deg, arcmin, arcsec",
    "moment": "N*m, N*mm, kN*m, kgf*m, lbf*ft, lbf*in",
    "temperature": "°C, K",
}


def quantity_of(meaning: str) -> str:
    """Length, force, angle, moment or temperature of a column of an experiment."""
    plain = meaning.removeprefix("u_")
    if plain == "temperature":
        return "temperature"
    return {"f": "force", "m": "moment", "r": "angle"}.get(plain[0], "length")


def unit_of(text: str, quantity: str | None = None) -> Unit | None:
    """A unit as a sheet writes it, of one quantity or of any; None for what is none."""
    if text.strip() in ("MN", "mN"):  # a factor of 1e9 between the two: here the case decides
        return Unit("MN") if text.strip() == "MN" and quantity in (None, "force") else None
    key = re.sub(r"\s+|^\[|\]$", "", text.strip().lower()).replace(",", ".").rstrip(".")
    tables = TABLES.values() if quantity is None else (TABLES[quantity],)
    return next((t[key] for t in tables if key in t), None)


def known(quantity: str | None = None) -> str:
    """The units that are understood, of one quantity or of all."""
    return SHOWN[quantity] if quantity else "; ".join(SHOWN.values())
