"""What the command line and part files say, in SI: materials, load cases, parametric parts."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any, Generic, Literal, TypeVar

import numpy as np
from pydantic import Field

from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import FileError, StiffmapError
from stiffmap.common.units import STRESSES, size_of
from stiffmap.common.yaml_text import read
from stiffmap.model.files.report import validated
from stiffmap.model.files.schema.base import FileModel
from stiffmap.model.link.gmshmesh import UNITS
from stiffmap.model.link.readers import cases_rise, known_columns
from stiffmap.model.link.shapes import Bar, Foot, ForkBar, HollowBar, Length
from stiffmap.model.link.solve import Material

# Handbook values for a first estimate; a measured modulus belongs in the part file.
MATERIALS = {
    "steel": (210e9, 0.30),
    "stainless": (195e9, 0.30),
    "aluminium": (70e9, 0.33),
    "titanium": (110e9, 0.34),
    "cast-iron": (110e9, 0.26),
    "magnesium": (45e9, 0.35),
}
STRESS = {u: size_of(u) for u in STRESSES}
WRENCH = {f"f{a}": ("N", f"f{a} [N]") for a in "xyz"} | {f"m{a}": ("N*m", f"m{a} [N*mm]") for a in "xyz"}
"""Columns of load cases: their SI unit, and how they are usually written."""
UNIT_WRENCHES = np.diag([100.0, 100.0, 100.0, 10.0, 10.0, 10.0])  # linear solver: the size does not matter

S = TypeVar("S")
_BY_NAME = {str(s.model_fields["shape"].default): s for s in (Bar, HollowBar, ForkBar, Foot)}


class _Units(FileModel):
    length: Literal["mm", "m", "cm", "in", "inch"]
    stress: Literal["Pa", "MPa", "GPa", "N/mm2"] | None = None


class _Moduli(FileModel):
    young: float = Length
    poisson: float = Field(gt=-1, lt=0.5)


class PartFile(FileModel, Generic[S]):
    """A parametric link: ``units``, ``part`` (shape, lengths), ``material`` (name, or young and poisson)."""

    units: _Units
    part: S
    material: _Moduli | str | None = None
    name: str | None = None


def read_material(text: str) -> Material:
    """A name of :data:`MATERIALS`, or ``70GPa,0.33``.

    Raises:
        StiffmapError: neither; a modulus without unit; a Poisson ratio outside (-1, 0.5).
    """
    if text in MATERIALS:
        return Material(*MATERIALS[text], text)
    found = re.fullmatch(r"\s*([\d.eE+]+)\s*([A-Za-z/2]*)\s*,\s*(-?[\d.]+)\s*", text)
    if not found:
        raise StiffmapError(
            f"material: expected one of {', '.join(MATERIALS)}, or like 70GPa,0.33; got {text!r}"
        )
    if found[2] not in STRESS:
        raise StiffmapError(f"material: the modulus needs its unit, one of {', '.join(STRESS)}; got {text!r}")
    return checked_material(float(found[1]) * STRESS[found[2]], float(found[3]), text)


def checked_material(young: float, poisson: float, name: str) -> Material:
    """The material, SI, if an elastic solid can have it."""
    if not 1e5 < young < 2e12 or not -1 < poisson < 0.5:
        raise StiffmapError(
            "material: expected a modulus between gel and diamond (1e5 to 2e12 Pa) and Poisson ratio in (-1, 0.5), "
            f"got {young:g} Pa, {poisson:g}"
        )
    return Material(young, poisson, name)


def read_part(path: str | Path) -> tuple[Any, Material | None, str]:
    """Shape, material (None when the file names none) and name of a parametric part file (YAML).

    Raises:
        StiffmapError: no such file, not YAML, units missing, unknown shape or key, lengths that do not fit.
    """
    if not Path(path).exists():
        raise StiffmapError(f"{path}: no such file")
    document = read(Path(path))
    part = document.data.get("part") if isinstance(document.data, dict) else None
    shape = part.get("shape") if isinstance(part, dict) else None
    if isinstance(part, dict) and str(shape) not in _BY_NAME:
        raise StiffmapError(f"{path}: part.shape: expected one of {', '.join(_BY_NAME)}, got {shape!r}")
    schema: Any = PartFile
    model = schema[_BY_NAME.get(str(shape), Bar)]
    file = validated(model, document, str(path), "a part file is a mapping with units, part and material")
    given, factor = dict(file.part), UNITS[file.units.length]
    lengths = {k: v * factor for k, v in given.items() if isinstance(v, float)}
    return type(file.part)(**given | lengths), _part_material(path, file), file.name or Path(path).stem


def read_cases(path: str | Path) -> Floats:
    """(cases, 6) N, N·m from a CSV with the columns ``fx [N] ... mz [N*mm]``, each with its unit.

    Raises:
        StiffmapError: no such file, a column or unit missing, cells that are not numbers.
    """
    table, found = known_columns(path, WRENCH)
    missing = [c for c, columns in found.items() if not columns]
    twice = [c for c, columns in found.items() if len(columns) > 1]
    if missing or twice:
        problem = f"missing {', '.join(missing)}" if missing else f"found {', '.join(twice)} more than once"
        raise FileError(
            f"expected the columns 'fx [N]' to 'mz [N*mm]' with units, {problem}",
            file=table.file,
            line=table.top,
        )
    cases_rise(table, r"(load[^a-z]?)?case|lc|id|nr\.?|no\.?|name|number")
    return np.stack([found[c][0] for c in WRENCH], axis=-1)


def _part_material(path: str | Path, file: PartFile[Any]) -> Material | None:
    given = file.material
    if given is None or isinstance(given, str):
        return None if given is None else read_material(given)
    if file.units.stress is None:
        raise StiffmapError(f"{path}: units.stress: young needs its unit, one of {', '.join(STRESS)}")
    return checked_material(given.young * STRESS[file.units.stress], given.poisson, "part file")
