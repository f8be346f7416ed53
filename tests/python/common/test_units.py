"""The size of every unit, from its definition."""

from __future__ import annotations

import math

import pytest

from stiffmap.common.units import FORCES, LENGTHS, MASSES, MOMENTS, PLANE_ANGLES, STRESSES, size_of

SIZES = {
    "m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "µm": 1e-6, "in": 0.0254, "inch": 0.0254,
    "N": 1.0, "kN": 1e3, "MN": 1e6,
    "kg": 1.0, "g": 1e-3, "t": 1e3,
    "N*m": 1.0, "Nm": 1.0, "N*mm": 1e-3, "Nmm": 1e-3, "kN*m": 1e3,
    "Pa": 1.0, "MPa": 1e6, "GPa": 1e9, "N/mm2": 1e6,
    "rad": 1.0, "mrad": 1e-3, "urad": 1e-6,
}  # fmt: skip
TABLES = (LENGTHS, FORCES, MASSES, MOMENTS, STRESSES, PLANE_ANGLES)


@pytest.mark.parametrize(("unit", "size"), SIZES.items())
def test_the_size_of_a_unit(unit: str, size: float) -> None:
    assert size_of(unit) == size


def test_parts_of_a_full_turn() -> None:
    for unit, number in {"deg": 360, "°": 360, "arcmin": 360 * 60, "arcsec": 360 * 60 * 60}.items():
        assert number * size_of(unit) == pytest.approx(2 * math.pi, rel=1e-15)


def test_no_unit_is_without_a_test() -> None:
    known = {unit for table in TABLES for unit in table}
    assert known <= set(SIZES) | {"deg", "°", "arcmin", "arcsec"}
