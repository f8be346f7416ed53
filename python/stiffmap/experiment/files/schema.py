"""The keys of ``experiment.yaml``; docs/diagnosis.md explains each."""

from __future__ import annotations

from functools import cache
from typing import Annotated, Any, Literal

from pydantic import Field, create_model

from stiffmap.experiment.experiment import HowKnown, Quantity, Unloaded
from stiffmap.experiment.files.fields import DECLARED, quantity_of, read
from stiffmap.experiment.readings import kinds
from stiffmap.model.files.schema.base import FileModel

Positive = Annotated[float, Field(ge=0.0, allow_inf_nan=False, strict=False)]
Finite = Annotated[float, Field(allow_inf_nan=False, strict=False)]


Length = Literal["m", "cm", "mm", "um", "µm", "in"]
Angle = Literal["rad", "mrad", "deg"]
Force = Literal["N", "kN", "MN"]
Moment = Literal["N*m", "N*mm", "kN*m"]
UNITS: dict[str | None, Any] = {"length": Length, "angle": Angle, "force": Force, "moment": Moment}
"""Quantity of a column -> units that the file may declare for it."""


class ExperimentUnitsModel(FileModel):
    """Units of data.csv, of the noise and of the frame; angle only where there are rotations.

    A column that has a unit of its own is named as well: ``{length: mm, force: N, dx: um, fx: kN}``. Its
    standard deviations, ``u_dx`` and that of ``noise``, are in the same unit.
    """

    length: Length
    force: Force | None = None
    angle: Angle | None = None
    temperature: Literal["degC", "K"] | None = None


class NoiseModel(FileModel):
    """One standard deviation per axis or kind of reading, in the units of the file."""


LengthOrAngle = Literal[Length, Angle]


class EncoderModel(FileModel):
    """A column that an encoder reads: full name of the joint, unit of the column and its noise in it.

    ``load``: the joint itself, behind the drive's elasticity. ``motor``: before it.
    """

    joint: str
    unit: LengthOrAngle
    side: Literal["load", "motor"] = "load"
    noise: Positive | None = None


class CommandModel(FileModel):
    """A column that commands an actuator, by its full name, in place of the pose."""

    actuator: str
    unit: LengthOrAngle


class LoopModel(FileModel):
    """The metrology loop: what the instrument stands on, what carries the target, where the force reacts.

    On or against the ``base`` its compliance closes inside the loop and cannot be seen; on the
    ``floor`` it can. Another name is a named point of the body that carries the instrument or takes the
    reaction. A target on the ``platform`` cannot see the tool holder, one on the ``tool`` can.
    """

    instrument_on: str = "floor"
    target_on: Literal["tool", "platform"] = "tool"
    force_against: str = "floor"


class OrientationModel(FileModel):
    """What the columns of orientation mean.

    ``against: home``: they turn the tool from its orientation at home, about base axes. ``base``: they
    are the tool's orientation itself. ``euler``: axes of euler1, euler2, euler3 in turn; capitals for
    axes that turn along (XYZ: x, then the new y, then the new z), small letters for fixed ones.
    """

    against: Literal["home", "base"] = "home"
    euler: Annotated[str, Field(pattern=r"^([XYZ]{3}|[xyz]{3})$")] | None = None


Axes3 = Annotated[list[Finite], Field(min_length=3, max_length=3)]


class SurfaceModel(FileModel):
    """The surface that heights are measured against: its normal in base axes, and what is known of it.

    ``offset_unknown``: its height is fitted; ``unknown``: height and two tilts. Per set-up.
    """

    normal: Axes3 = Field(default_factory=lambda: [0.0, 0.0, 1.0])
    shape: HowKnown = "known"


class CertificateModel(FileModel):
    """Standard uncertainties of the instrument and of how it was set up, in the units of the file.

    ``scale``: relative, of all it reads. ``frame``, ``frame_direction``: of a frame that is called known.
    ``tool``: of the point that is read, in the tool's axes. docs/calibration.md
    """

    scale: Annotated[float, Field(gt=0.0, lt=1.0, strict=False)] | None = None
    frame: Positive | None = None
    frame_direction: Positive | None = None
    tool: Annotated[float, Field(gt=0.0, allow_inf_nan=False, strict=False)] | None = None


class RecordModel(FileModel):
    """What a report carries of how the readings were taken, in words."""

    operator: str = ""
    instrument: str = ""
    certificate: str = ""
    date: str = ""
    temperature: str = ""
    source: str = ""
    sha256: str = ""


class ExperimentFile(FileModel):
    """One experiment."""

    machine: str
    quantity: Quantity
    units: ExperimentUnitsModel
    title: str = ""
    data: str = "data.csv"
    rows: Annotated[int, Field(gt=0)] | None = None
    """Rows of the data, where the writer says it: a table that was cut off is refused."""
    point: str = "tcp"
    load_point: str | None = None
    axes: Literal["base"] = "base"
    noise: NoiseModel = NoiseModel()
    zero_noise: NoiseModel = NoiseModel()
    joints: dict[str, EncoderModel] = Field(default_factory=dict)
    command: dict[str, CommandModel] = Field(default_factory=dict)
    unloaded: Unloaded = "centre"
    frame: HowKnown = "known"
    tool: HowKnown = "known"
    target_orientation: Literal["rotvec", "xyz", "XYZ", "zyx", "ZYX", "ZYZ", "zyz"] = "rotvec"
    surface: SurfaceModel = SurfaceModel()
    anchor: Axes3 | None = None
    gravity: Axes3 | dict[str, Axes3] | None = None
    reference_temperature: Finite | None = None
    metrology: LoopModel = LoopModel()
    certificate: CertificateModel = CertificateModel()
    orientation: OrientationModel = OrientationModel()
    columns: dict[str, str] = Field(default_factory=dict)
    record: RecordModel = RecordModel()
    notes: str = ""


def file_model() -> type[ExperimentFile]:
    """The keys of the file with the units of single columns and the noise of every known kind of reading."""
    declared = (*DECLARED, *(k.name for k in kinds()))
    return _with_columns(tuple((n, quantity_of(n)) for n in declared), read())


@cache
def _with_columns(
    declared: tuple[tuple[str, str | None], ...], readings: tuple[str, ...]
) -> type[ExperimentFile]:
    units: dict[str, Any] = {n: (UNITS[quantity] | None, None) for n, quantity in declared}
    sizes: dict[str, Any] = dict.fromkeys(readings, (Positive | None, None))
    noise = create_model("NoiseModel", __base__=NoiseModel, **sizes)
    fields: dict[str, Any] = {
        "units": (create_model("UnitsModel", __base__=ExperimentUnitsModel, **units), ...),
        "noise": (noise, noise()),
        "zero_noise": (noise, noise()),
    }
    return create_model("ExperimentFile", __base__=ExperimentFile, **fields)
