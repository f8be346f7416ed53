"""Beams: sections (area, torsion, bending about the two axes across the beam), the cantilever's compliance, and both by
the numbers of a machine file.

Elementary formulas of the strength of materials; torsion of a solid rectangle by Saint-Venant's
series (Timoshenko & Goodier, Theory of Elasticity, art. 109), of a thin-walled tube by Bredt's
formula on the mid-line.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from inspect import signature
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from stiffmap.common.errors import StiffmapError
from stiffmap.common.units import BENDING, DENSITY, FORCE, LENGTH, MODULUS, NONE, Dimension
from stiffmap.model.description import BeamNumbers
from stiffmap.model.description.strokes import Matrix6, as_rows


class Section(NamedTuple):
    """Area (m²), torsion constant J (m⁴), second moments about the width and height axes (m⁴)."""

    area: float
    torsion: float
    about_width: float
    about_height: float


def round_section(diameter: float) -> Section:
    """Solid circular section."""
    return tube_section(diameter, 0.0)


def tube_section(outer: float, inner: float) -> Section:
    """Circular tube: outer and inner diameter."""
    second = math.pi * (outer**4 - inner**4) / 64
    return Section(math.pi * (outer**2 - inner**2) / 4, 2 * second, second, second)


SUM_OF_ODD_FIFTH_POWERS = 31 / 32 * 1.0369277551433699
"""Sum of 1/n^5 over odd n, 31/32 of Riemann's zeta(5)."""


def rectangle_section(width: float, height: float) -> Section:
    """Solid rectangle: width along the axis after the beam's (y of x, z of y, x of z), height along the other."""
    # the torsion series is summed to round-off
    long, short = max(width, height), min(width, height)
    # tanh x = 1 - 2 / (e^2x + 1): what is summed falls by e^-2pi or more from term to term
    near_one = (2 / (math.exp(min(n * math.pi * long / short, 700.0)) + 1) / n**5 for n in range(1, 14, 2))
    series = SUM_OF_ODD_FIFTH_POWERS - sum(near_one)
    torsion = long * short**3 / 3 * (1 - 192 / math.pi**5 * short / long * series)
    return Section(width * height, torsion, width * height**3 / 12, height * width**3 / 12)


def hollow_section(width: float, height: float, wall: float) -> Section:
    """Thin-walled rectangular tube (torsion by Bredt): outer width and height as for a rectangle."""
    w, h = width - 2 * wall, height - 2 * wall
    enclosed, around = (width - wall) * (height - wall), 2 * (width + height - 2 * wall)
    return Section(
        width * height - w * h,
        4 * enclosed**2 * wall / around,
        (width * height**3 - w * h**3) / 12,
        (height * width**3 - h * w**3) / 12,
    )


def cantilever_compliance(
    length: float, along: str, ea: float, gj: float, ei_next: float, ei_last: float
) -> NDArray[np.float64]:
    """Compliance (6, 6) of an Euler-Bernoulli cantilever at its free end, local axes, SI.

    The beam leaves its root along ``along`` (x, y, z, -x, -y, -z). ``ei_next`` is the bending
    stiffness about the axis that follows cyclically (y of x, z of y, x of z), ``ei_last`` about
    the remaining one.
    """
    sign = -1.0 if along.startswith("-") else 1.0
    a = "xyz".index(along[-1])
    b, c = (a + 1) % 3, (a + 2) % 3
    k = np.zeros((6, 6))
    k[a, a], k[3 + a, 3 + a] = length / ea, length / gj
    k[b, b], k[3 + c, 3 + c] = length**3 / (3 * ei_last), length / ei_last
    k[c, c], k[3 + b, 3 + b] = length**3 / (3 * ei_next), length / ei_next
    k[b, 3 + c] = k[3 + c, b] = sign * length**2 / (2 * ei_last)
    k[c, 3 + b] = k[3 + b, c] = -sign * length**2 / (2 * ei_next)
    return k


SECTIONS: dict[str, Callable[..., Section]] = {
    "round": round_section,
    "tube": tube_section,
    "rectangle": rectangle_section,
    "hollow": hollow_section,
}
"""Section of the lengths (m) that a machine file gives under the names of the function's arguments."""


def lengths(sort: str) -> tuple[str, ...]:
    """Names of the lengths of a section of this sort."""
    return tuple(signature(SECTIONS[sort]).parameters)


def dimension(key: str) -> Dimension:
    """Unit of a number of a beam."""
    if key == "material.density":
        return DENSITY
    if key.startswith("material."):
        return NONE if key == "material.nu" else MODULUS
    return FORCE if key == "EA" else BENDING if key.startswith(("EI", "GJ")) else LENGTH


def products(along: str) -> tuple[str, str, str, str]:
    """Names of the four stiffness products of a beam along this axis."""
    k = "xyz".index(along[-1])
    return ("EA", "GJ", "EI" + "xyz"[(k + 1) % 3], "EI" + "xyz"[(k + 2) % 3])


def changed(beam: BeamNumbers, key: str, value: float) -> BeamNumbers:
    """The beam with another value under a key that it has."""
    return BeamNumbers(beam.along, tuple((k, value if k == key else v) for k, v in beam.numbers))


def compliance(beam: BeamNumbers) -> Matrix6:
    """(6, 6) at the far end, local axes; StiffmapError where the numbers make no beam."""
    n = dict(beam.numbers)
    for key, value in beam.numbers:
        if fault := number_fault(key, value):
            raise StiffmapError(f"beam.{key}: {fault}; found {value:g}")
    if "EA" in n:
        values = [n[key] for key in products(beam.along)]
    else:
        sort = next(s for s in SECTIONS if any(k.startswith(f"{s}.") for k in n))
        fault = section_fault(sort, n)
        if fault:
            raise StiffmapError(f"beam.{sort}: {fault}")
        s = section(sort, n)
        e = n["material.E"]
        g = n["material.G"] if "material.G" in n else e / (2 * (1 + n["material.nu"]))
        values = [e * s.area, g * s.torsion, e * s.about_width, e * s.about_height]
    return as_rows(cantilever_compliance(n["length"], beam.along, *values))


def number_fault(key: str, value: float) -> str:
    """Why a number makes no beam; empty where it may."""
    if key != "material.nu":
        return "" if value > 0.0 else "must be positive"
    return "" if -1.0 < value <= 0.5 else "must be above -1 and at most 0.5 (a laminate with more: give G)"


def section(sort: str, n: dict[str, float]) -> Section:
    """Section of this sort by the numbers of a beam."""
    return SECTIONS[sort](*(n[f"{sort}.{key}"] for key in lengths(sort)))


def section_fault(sort: str, n: dict[str, float]) -> str:
    """Why such positive numbers make no section; empty where they make one."""
    if sort == "tube" and n["tube.inner"] >= n["tube.outer"]:
        return "the inner diameter must be smaller than the outer one"
    if sort == "hollow" and 2 * n["hollow.wall"] >= min(n["hollow.width"], n["hollow.height"]):
        return "twice the wall must be smaller than width and height"
    return ""
