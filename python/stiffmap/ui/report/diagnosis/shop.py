"""Numbers and names as a workshop reads them."""

from __future__ import annotations

import numpy as np

from stiffmap.identification.diagnosis.report.sentences import UNITS


def in_shop_words(text: str) -> str:
    """A line of the screen with drives called so, and no marks of code."""
    return text.replace("actuator", "drive").replace("`", "")


def in_axis_units(axis: str, value: float) -> str:
    """A reading's size: µm, µrad for a rotation; a dash for none."""
    if not np.isfinite(value):
        return "–"
    return f"{1e6 * value:.2f} {'µrad' if axis.startswith('r') else 'µm'}"


def in_shop_units(value: float, unit: str) -> str:
    """A number of an effect: µm, µm/N, mrad."""
    factor, name = UNITS.get(unit, (1.0, unit))
    return f"{factor * value:.4g} {name}".rstrip()


def p_text(p: float) -> str:
    """A p-value; 0 is what no double holds."""
    return f"{p:.2g}" if p > 0 else "below 1e-300"
