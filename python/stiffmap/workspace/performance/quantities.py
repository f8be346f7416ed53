"""Numbers with units in requirement and design files: ``60 m/min``, ``0.25 mm``, ``12 Hz``."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from typing import Annotated

from pydantic import BeforeValidator

from stiffmap.common.errors import FileError, StiffmapError
from stiffmap.common.number_text import read_value
from stiffmap.common.yaml_text import Document
from stiffmap.model.files.report import key_text


def quantity(value: object, unit: str) -> float:
    """SI value of a text such as ``60 m/min`` that must have the dimension of `unit`.

    A bare number is an error unless `unit` is empty: units are obligatory. Raises StiffmapError.
    """
    if isinstance(value, bool) or not isinstance(value, int | float | str):
        raise StiffmapError(f"expected a number with a unit ({unit or 'none'}), found {value!r}")
    text = str(value).strip()
    if not unit:
        return read_value(text, "1")
    if unit == "Hz":
        if not text.endswith("Hz"):
            raise StiffmapError(f"the unit is missing or wrong: expected such as 12 Hz, found {text!r}")
        return read_value(text.removesuffix("Hz").strip(), "1")
    return read_value(text, unit)


def positive(value: object, unit: str, what: str, zero: bool = False) -> float:
    """The same of what must be above zero, or may also be `zero`, by its name."""
    number = quantity(value, unit)
    if not (number > 0 or (zero and number == 0)):
        raise StiffmapError(f"expected a positive {what}{' or 0' if zero else ''}, found {value}")
    return number


@contextmanager
def under(document: Document, file: str, *keys: str | int) -> Iterator[None]:
    """What is wrong with the value under these keys of a file is a `FileError` with its line."""
    try:
        yield
    except FileError:
        raise
    except ValueError as error:
        raise FileError(str(error), file=file, line=document.line(keys), key=key_text(keys)) from None


Length = Annotated[float, BeforeValidator(partial(quantity, unit="m"))]
Force = Annotated[float, BeforeValidator(partial(quantity, unit="N"))]
PositiveForce = Annotated[float, BeforeValidator(partial(positive, unit="N", what="force"))]
Edge = Annotated[float, BeforeValidator(partial(positive, unit="m", what="length", zero=True))]
PositiveLength = Annotated[float, BeforeValidator(partial(positive, unit="m", what="length"))]
Duration = Annotated[float, BeforeValidator(partial(positive, unit="s", what="duration"))]
Speed = Annotated[float, BeforeValidator(partial(positive, unit="m/s", what="speed"))]
"""Fields of a file's schema, written with a unit and read as SI values."""
