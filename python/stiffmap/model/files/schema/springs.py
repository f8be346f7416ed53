"""Springs as a file writes them: matrices, beams, force laws."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field, create_model, model_validator

from stiffmap.model import beams
from stiffmap.model.files.schema.base import FileModel, Name, Number, Pair, describe

ENTRIES = tuple(f"k{i}{j}" for i in range(1, 7) for j in range(i, 7))
DIAGONAL = tuple(f"k{i}{i}" for i in range(1, 7))

_Six = Annotated[list[Number], Field(min_length=6, max_length=6)]


class Matrix(FileModel):
    """Symmetric 6x6 matrix, translations first.

    Written as six diagonal terms ``[...]``, as six rows, or by entries ``{k11: ..., k26: ...}``:
    all six diagonal terms, and those of the upper triangle that are not zero.
    """

    rows: Annotated[list[_Six], Field(min_length=6, max_length=6)] | None = None
    diagonal: _Six | None = None
    entries: dict[Literal[ENTRIES], Number] | None = None  # type: ignore[valid-type]

    @classmethod
    def as_mapping(cls, data: object) -> Any:
        """Rows, diagonal or entries under their key."""
        if isinstance(data, list):
            nested = bool(data) and isinstance(data[0], list)
            return {"rows" if nested else "diagonal": data}
        if isinstance(data, dict) and not set(data) <= {"rows", "diagonal", "entries"}:
            return {"entries": _upper(data)}
        if not isinstance(data, dict):
            raise ValueError(
                f"expected six diagonal terms, six rows of six, or entries such as k11, k26; found {describe(data)}"
            )
        return data


def _upper(entries: dict[object, object]) -> dict[str, object]:
    """Entries by their upper-triangle names; a missing diagonal term is an error, not a zero."""
    out: dict[str, Any] = {}
    for key, value in entries.items():
        name = str(key)
        if name not in ENTRIES and name[:1] + name[:0:-1] in ENTRIES:
            name = name[0] + name[:0:-1]
        if name not in ENTRIES:
            raise ValueError(f"unknown key '{key}'; entries are k11 ... k66, translations first")
        if name in out:
            raise ValueError(f"entry {name} is given twice")
        out[name] = value
    missing = [k for k in DIAGONAL if k not in out]
    if missing:
        raise ValueError(f"missing diagonal entries {', '.join(missing)} (write 0 if meant)")
    return out


class MaterialModel(FileModel):
    """Young's modulus ``E`` with the shear modulus ``G`` or Poisson's ratio ``nu``; ``density`` (mass/length³) where
    masses follow from sections."""

    E: Number
    G: Number | None = None
    nu: Number | None = None
    density: Number | None = None

    @model_validator(mode="after")
    def _one_shear(self) -> MaterialModel:
        if (self.G is None) == (self.nu is None):
            raise ValueError("give exactly one of G and nu")
        return self


Along = Literal["x", "y", "z", "-x", "-y", "-z"]


def _section(sort: str) -> Any:
    """Key of a section, a mapping with a key for each of its lengths."""
    keys: dict[str, Any] = dict.fromkeys(beams.lengths(sort), (Number, ...))
    words = beams.SECTIONS[sort].__doc__
    return create_model(sort.capitalize(), __base__=FileModel, __doc__=words, **keys) | None, None


_SECTIONS: dict[str, Any] = {sort: _section(sort) for sort in beams.SECTIONS}


class Beam(create_model("Sections", __base__=FileModel, **_SECTIONS)):  # type: ignore[misc]
    """Euler-Bernoulli cantilever; the spring sits at its far end.

    A section (round, tube, rectangle, hollow) with a material, or the products EA, GJ and the two
    bending stiffnesses about the axes across the beam (EIy and EIz of a beam along x).
    """

    length: Number
    along: Along = "x"
    material: MaterialModel | Name | None = None
    EA: Number | None = None
    GJ: Number | None = None
    EIx: Number | None = None
    EIy: Number | None = None
    EIz: Number | None = None

    @model_validator(mode="after")
    def _one_form(self) -> Beam:
        sections = [k for k in beams.SECTIONS if getattr(self, k) is not None]
        needed = beams.products(self.along)
        given = [k for k in ("EA", "GJ", "EIx", "EIy", "EIz") if getattr(self, k) is not None]
        by_section = len(sections) == 1 and self.material is not None and not given
        by_products = not sections and self.material is None and set(given) == set(needed)
        if not (by_section or by_products):
            found = ", ".join(sections + given + (["material"] if self.material else [])) or "neither"
            raise ValueError(
                f"a beam along {self.along} needs one section (round, tube, rectangle or hollow) with a "
                f"material, or exactly {', '.join(needed)}; found {found}"
            )
        return self


class LawModel(FileModel):
    """Nonlinear law of one coordinate: force = stiffness*a + cubic*a^3, or a polyline of
    [deflection, force] knots continued with slope ``stiffness``. Stiffnesses are per radian."""

    stiffness: Number
    cubic: Number | None = None
    knots: list[Pair] | None = None

    @model_validator(mode="after")
    def _one_law(self) -> LawModel:
        if self.cubic is not None and self.knots is not None:
            raise ValueError("cubic and knots do not combine")
        return self


class StrokeRow(FileModel):
    """Compliance of a link where a joint is at a coordinate."""

    at: Number
    compliance: Matrix


class Stroke(FileModel):
    """How a link's compliance varies with the coordinate of ``joint``: as a beam that is ``length`` long at
    coordinate ``at`` and grows by ``rate`` per unit of it (0: it does not), or as a ``table``, linear in between."""

    joint: Annotated[str, Field(description="Name in the same sequence or one around it, or a full name.")]
    at: Number | None = None
    length: Annotated[Number | None, Field(description="Left out: that of the beam.")] = None
    along: Annotated[Along | None, Field(description="Left out: that of the beam.")] = None
    rate: Annotated[Number | None, Field(description="Left out: 1.")] = None
    table: Annotated[list[StrokeRow] | None, Field(min_length=2)] = None

    @model_validator(mode="after")
    def _one_form(self) -> Stroke:
        also = [k for k in ("at", "length", "along", "rate") if getattr(self, k) is not None]
        if self.table is not None and also:
            raise ValueError(f"a table takes no {', '.join(also)} in addition")
        return self
