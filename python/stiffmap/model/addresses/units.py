"""SI units of numbers as text."""

from __future__ import annotations

from stiffmap.model.description.numbers import JointNumber

METRE, RADIAN, NEWTON, KILOGRAM = "m", "rad", "N", "kg"
STIFFNESS = ("N/m", "N/rad", "N·m/rad")
"""By the number of rotations among the two directions of an entry; also those of laws (first and last)."""
COMPLIANCE = ("m/N", "1/N", "rad/(N·m)")
IN_TIME = {"speed": "{c}/s", "friction.viscous": "{e}·s/{c}"}


def coordinate(angular: bool) -> str:
    """Of a joint's coordinate."""
    return RADIAN if angular else METRE


def of_joint_number(n: JointNumber, angular: bool) -> str:
    """Of a declared number of a joint or drive; dimensionless: empty."""
    c, e = coordinate(angular), "N·m" if angular else NEWTON
    if n.key in IN_TIME:
        return IN_TIME[n.key].format(c=c, e=e)
    above = [t for t, power in ((e, n.effort), (c, n.coordinate)) if power > 0]
    below = [t for t, power in ((e, n.effort), (c, n.coordinate)) if power < 0]
    top = "·".join(above) or ("1" if below else "")
    return "/".join([top, *below]) if below else top


def of_entry(i: int, j: int, word: str) -> str:
    """Of the entry (i, j) of a spring's matrix, counted from 0."""
    return (COMPLIANCE if word == "compliance" else STIFFNESS)[(i > 2) + (j > 2)]


def of_beam(key: str) -> str:
    """Of a number of a beam by its key."""
    if key == "material.nu":
        return ""
    if key.startswith("material."):
        return "Pa"
    return {"EA": "N"}.get(key, "N·m²" if key.startswith(("EI", "GJ")) else METRE)
