"""Textbook integrals, written out apart from the code under test."""

from __future__ import annotations

from math import cos, pi, sin

import numpy as np
from scipy.integrate import quad

END_MILL = {
    "Ktc": "958.8 N/mm2",
    "Krc": "251.1 N/mm2",
    "Kac": "146.4 N/mm2",
    "Kte": "15.75 N/mm",
    "Kre": "19.42 N/mm",
    "Kae": "18.21 N/mm",
}


def numbers() -> dict[str, float]:
    """SI."""
    return {n: float(v.split()[0]) * (1e6 if n.endswith("c") else 1e3) for n, v in END_MILL.items()}


def slot(n: int, a: float, c: float) -> np.ndarray:
    """Mean force of a full slot, N."""
    k = numbers()
    return np.array(
        [
            -(n * a / 4) * k["Krc"] * c - n * a / pi * k["Kre"],
            n * a / 4 * k["Ktc"] * c + n * a / pi * k["Kte"],
            n * a / pi * k["Kac"] * c + n * a / 2 * k["Kae"],
        ]
    )


def by_quadrature(n: int, a: float, c: float, first: float, last: float) -> np.ndarray:
    """Mean force over an arc by adaptive quadrature of the force on one tooth, N."""
    k = numbers()

    def tooth(phi: float) -> tuple[float, float, float]:
        h = c * sin(phi)
        t, r, z = (a * (k[f"K{i}e"] + k[f"K{i}c"] * h) for i in "tra")
        return -t * cos(phi) - r * sin(phi), t * sin(phi) - r * cos(phi), z

    return np.array(
        [
            n / (2 * pi) * quad(lambda p, i=i: tooth(p)[i], first, last, epsabs=0, epsrel=1e-12)[0]
            for i in range(3)
        ]
    )


def process(
    side: str = "slot", radial: str | None = None, teeth: int = 2, **more: object
) -> dict[str, object]:
    """A process file's mapping."""
    cut: dict[str, object] = {"side": side, "axial": "3 mm", "through": False}
    if radial:
        cut["radial"] = radial
    base: dict[str, object] = {
        "name": "test",
        "tool": {"diameter": "25 mm", "teeth": teeth, "helix": "30 deg"},
        "spindle": "6000 rpm",
        "feed": "0.075 mm/tooth",
        "cut": cut,
        "law": {"end_mill": dict(END_MILL)},
    }
    return {**base, **more}
