"""SI units of numbers as text."""

from __future__ import annotations

from stiffmap.common.units import MODULUS, Dimension

SHORT = {MODULUS: "Pa", Dimension(force=-1, angle=1): "1/N"}
POWERS = {1: "", 2: "²", 3: "³"}


def unit_text(d: Dimension, time: int = 0) -> str:
    """``N·m/rad``; dimensionless: empty."""
    if d in SHORT:
        return SHORT[d]
    units = (("N", d.force), ("kg", d.mass), ("m", d.length), ("rad", d.angle), ("s", time))
    above = "·".join(name + POWERS[power] for name, power in units if power > 0)
    below = [name + POWERS[-power] for name, power in units if power < 0]
    if not below:
        return above
    return f"{above or '1'}/{below[0]}" if len(below) == 1 else f"{above or '1'}/({'·'.join(below)})"
