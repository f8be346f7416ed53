"""The keys of a process file (docs/milling.md)."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from stiffmap.model.files.schema.base import FileModel, Name, describe

Written = str | float | int


class Quantity(FileModel):
    """A number with its unit, or ``{value: 958.8 N/mm2, u: 12 N/mm2, note: …}``."""

    value: Written
    u: Written | None = None
    note: str = ""

    @classmethod
    def as_mapping(cls, data: object) -> object:
        """A plain number as its value."""
        if isinstance(data, dict):
            return data
        if isinstance(data, bool) or not isinstance(data, int | float | str):
            raise ValueError(f"expected a number with its unit; found {describe(data)}")
        return {"value": data}


class RunoutModel(FileModel):
    """Distance of the tool's axis from the spindle's."""

    offset: Written
    angle: Written = "0 deg"


class ToolModel(FileModel):
    """The tool; `teeth` is a number, or ``coated``."""

    diameter: Written
    teeth: Written
    helix: Written = "0 deg"
    runout: RunoutModel | None = None
    stick_out: Written = "0 mm"
    modulus: Written | None = None


class EndMillModel(FileModel):
    """Shear and edge coefficients."""

    Ktc: Quantity
    Krc: Quantity
    Kac: Quantity
    Kte: Quantity
    Kre: Quantity
    Kae: Quantity


class KienzleModel(FileModel):
    """Chip pressure kc1.1 at a chip of 1 mm and its exponent."""

    kc11: Quantity
    mc: Quantity
    radial: Quantity
    axial: Quantity = Quantity(value=0.0)


class TrimmingModel(FileModel):
    """A coated tool."""

    specific_energy: Quantity
    rubbing: Quantity = Quantity(value="0 N/mm2")
    radial: Quantity


class LawModel(FileModel):
    """One law."""

    end_mill: EndMillModel | None = None
    kienzle: KienzleModel | None = None
    trimming: TrimmingModel | None = None


class CutModel(FileModel):
    """Side, width and depth of the cut."""

    side: Literal["climb", "conventional", "slot"]
    radial: Written | None = None
    axial: Written
    through: bool = True


class ProcessFile(FileModel):
    """A process file."""

    name: Name
    title: str = ""
    source: str = ""
    tool: ToolModel
    law: LawModel
    spindle: Written = Field(description="with its unit: 6000 rpm")
    feed: Written = Field(description="10 m/min, or 0.075 mm/tooth")
    cut: CutModel
    tolerance: Written | None = None
