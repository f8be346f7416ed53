"""What is on the screen, as plain numbers: SI, base axes. A permalink and an undo are copies of it."""

from __future__ import annotations

import base64
import binascii
import json
import zlib
from collections.abc import Mapping
from dataclasses import asdict, replace
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import AfterValidator, BeforeValidator, ConfigDict, Field, ValidationError
from pydantic.dataclasses import dataclass
from scipy.spatial.transform import Rotation

from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import StiffmapError
from stiffmap.common.number_text import bounded
from stiffmap.model.files.report import in_words
from stiffmap.ui.view.plane import QUANTITIES

PLANES = ("x", "y", "z", "free")
MOST_LINK, MOST_TEXT = 16_000, 200_000  # characters of a permalink, and of what it says
MOST_STATES = 200  # that can be undone
Number = Annotated[
    float,
    Field(strict=True, allow_inf_nan=False),
    BeforeValidator(lambda v: bounded(v) if isinstance(v, (int, float)) else v),
]
Vector = tuple[Number, Number, Number]


def _direction(v: tuple[float, float, float]) -> tuple[float, float, float]:
    if not any(v):
        raise ValueError("expected a direction, got (0, 0, 0)")
    return v


def _pairs(given: object) -> object:
    return tuple(given.items()) if isinstance(given, Mapping) else given


@dataclass(frozen=True, config=ConfigDict(extra="forbid"))
class ViewState:
    """Pose, load, plane and what is changed in the machine; `position` alone has no default."""

    position: Vector
    """m, commanded TCP."""
    rotation: Vector | None = None
    """Rotation vector (rad) of the commanded orientation; None: as at home."""
    force: Vector = (0.0, 0.0, -300.0)
    """N on the tool."""
    moment: Vector = (0.0, 0.0, 0.0)
    """N·m on the tool."""
    gravity: Vector | None = None
    """m/s²; None: what the machine file says."""
    plane: Literal[PLANES] = "z"  # type: ignore[valid-type]
    """Axis across which the plane through the tool lies, or ``free``."""
    normal: Annotated[Vector, AfterValidator(_direction)] = (0.0, 0.0, 1.0)
    """Of a free plane."""
    quantity: Literal[tuple(QUANTITIES)] = "deflection"  # type: ignore[valid-type]
    tolerance: Annotated[Number, Field(gt=0)] = 0.25e-3
    """m, tolerated deflection."""
    magnification: Annotated[Number, Field(ge=0)] | None = None
    """Of the deflected machine; None: a round one that shows it well."""
    frequency: Annotated[Number, Field(ge=0)] = 0.0
    """Hz, of the dynamic stiffness."""
    start: tuple[Number, ...] | None = None
    """All coordinates that name an assembly mode; None: that of home."""
    changes: Annotated[tuple[tuple[str, Number], ...], BeforeValidator(_pairs)] = ()
    """Address of a number of the machine -> its value (SI)."""

    @property
    def wrench(self) -> tuple[float, ...]:
        """(6,) N, N·m on the tool."""
        return (*self.force, *self.moment)

    @property
    def turned(self) -> Floats | None:
        """(3, 3) commanded orientation; None: as at home."""
        return None if self.rotation is None else np.asarray(Rotation.from_rotvec(self.rotation).as_matrix())

    def changed(self, address: str, value: float | None) -> ViewState:
        """With a number of the machine changed; None: as in the file."""
        others = {a: v for a, v in self.changes if a != address}
        return replace(self, changes=tuple((others | ({} if value is None else {address: value})).items()))

    @property
    def start_array(self) -> Floats | None:
        """(coordinates,) of the assembly mode; None: home's."""
        return None if self.start is None else np.array(self.start)


def as_plain(state: ViewState) -> dict[str, object]:
    """JSON data, without what is as by default."""
    default = ViewState(state.position)
    plain = asdict(state)
    return {k: v for k, v in plain.items() if k == "position" or v != getattr(default, k)}


def from_plain(data: object) -> ViewState:
    """The state that JSON data say; StiffmapError naming the key for anything else."""
    if not isinstance(data, Mapping):
        raise StiffmapError(f"view: expected a mapping of the state, got {type(data).__name__}")
    return state_of(**data)


def state_of(**values: Any) -> ViewState:
    """The state with these values; StiffmapError naming what in it cannot be."""
    try:
        return ViewState(**values)
    except ValidationError as error:
        raise StiffmapError(in_words(error, [*ViewState.__dataclass_fields__])) from None


def permalink(machine: str, state: ViewState) -> str:
    """Machine and state as one word of letters, digits, - and _."""
    text = json.dumps({"machine": machine, **as_plain(state)}, separators=(",", ":"))
    return base64.urlsafe_b64encode(zlib.compress(text.encode(), 9)).decode().rstrip("=")


def from_permalink(word: str) -> tuple[str, ViewState]:
    """Machine and state of a permalink; StiffmapError for a damaged one."""
    try:
        if len(word) > MOST_LINK:
            raise ValueError
        packed = base64.b64decode(word + "=" * (-len(word) % 4), altchars=b"-_", validate=True)
        reader = zlib.decompressobj()
        text = reader.decompress(packed, MOST_TEXT)
        if reader.unconsumed_tail or not reader.eof:
            raise ValueError
        data = json.loads(text)
        machine = data.pop("machine")
    except (ValueError, binascii.Error, zlib.error, KeyError, AttributeError, RecursionError):
        raise StiffmapError("the link is damaged: copy it whole from the view") from None
    return str(machine), from_plain(data)


class History:
    """States that were on the screen; the last one is."""

    def __init__(self, first: ViewState) -> None:
        self.first = first
        self._past: list[ViewState] = []
        self.now = first

    def put(self, state: ViewState, *, keep: bool = True) -> None:
        """A new state; without `keep` it replaces the present one, as while something is dragged."""
        if state == self.now:
            return
        if keep:
            self.mark()
        self.now = state

    def mark(self) -> None:
        """What comes next can be undone to here, such as the end of a drag."""
        if not self._past or self._past[-1] != self.now:
            self._past = [*self._past, self.now][-MOST_STATES:]

    def undo(self) -> ViewState:
        """Back to the last state that differs."""
        while self._past:
            self.now, before = self._past.pop(), self.now
            if self.now != before:
                break
        return self.now

    def reset(self) -> ViewState:
        """As at the start; an undo leads back."""
        self.put(self.first)
        return self.now
