"""Beams computed anew with another number."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from stiffmap.common.errors import StiffmapError
from stiffmap.model import beams
from stiffmap.model.description import BeamNumbers
from stiffmap.model.description.elements import Matrix6

Shape = Callable[..., beams.Section]
SECTIONS: dict[str, tuple[tuple[str, ...], Shape]] = {
    "round": (("diameter",), beams.round_section),
    "tube": (("outer", "inner"), beams.tube_section),
    "rectangle": (("width", "height"), beams.rectangle_section),
    "hollow": (("width", "height", "wall"), beams.hollow_section),
}


def changed(beam: BeamNumbers, key: str, value: float) -> BeamNumbers:
    """The beam with another value under a key that it has."""
    return BeamNumbers(beam.along, tuple((k, value if k == key else v) for k, v in beam.numbers))


def compliance(beam: BeamNumbers) -> Matrix6:
    """(6, 6) at the far end, local axes; StiffmapError where the numbers make no beam."""
    n = dict(beam.numbers)
    wrong = [k for k, v in beam.numbers if not v > 0.0 and k != "material.nu"]
    if wrong:
        raise StiffmapError(f"beam.{wrong[0]}: must be positive; found {n[wrong[0]]:g}")
    if "EA" in n:
        k = "xyz".index(beam.along[-1])
        values = [n[key] for key in ("EA", "GJ", "EI" + "xyz"[(k + 1) % 3], "EI" + "xyz"[(k + 2) % 3])]
    else:
        s = _section(n)
        e = n["material.E"]
        g = n["material.G"] if "material.G" in n else e / (2 * (1 + n["material.nu"]))
        values = [e * s.area, g * s.torsion, e * s.about_width, e * s.about_height]
    matrix = beams.cantilever_compliance(n["length"], beam.along, *values)
    return tuple(tuple(float(v) for v in row) for row in np.asarray(matrix))


def _section(n: dict[str, float]) -> beams.Section:
    sort = next(s for s in SECTIONS if any(k.startswith(f"{s}.") for k in n))
    if sort == "tube" and n["tube.inner"] >= n["tube.outer"]:
        raise StiffmapError("beam.tube: the inner diameter must be smaller than the outer one")
    if sort == "hollow" and 2 * n["hollow.wall"] >= min(n["hollow.width"], n["hollow.height"]):
        raise StiffmapError("beam.hollow: twice the wall must be smaller than width and height")
    keys, section = SECTIONS[sort]
    return section(*(n[f"{sort}.{key}"] for key in keys))
