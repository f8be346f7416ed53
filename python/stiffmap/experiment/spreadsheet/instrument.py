"""What instruments write: small mapping files that say which header means what."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from stiffmap.common.errors import FileError, StiffmapError
from stiffmap.common.tables.cells import Cells
from stiffmap.common.tables.header import split_unit
from stiffmap.common.tables.sheet import Sheet
from stiffmap.common.yaml_text import read
from stiffmap.experiment.spreadsheet.guess import SEEN, guess

FOLDER = Path(__file__).parent / "instruments"
KEYS = {"title", "quantity", "columns", "measured", "circle", "units"}
CIRCLE = ("centre_x", "centre_y", "centre_z", "radius")


@dataclass(frozen=True)
class Instrument:
    """A mapping file: meanings and the headers that have them, as regular expressions."""

    title: str
    quantity: str
    columns: dict[str, str] = field(default_factory=dict)
    measured: dict[str, str] = field(default_factory=dict)
    """Reading -> header of the measured coordinate: the commanded one is taken off."""
    circle: dict[str, str] = field(default_factory=dict)
    """Plane, and headers of angle and radial deviation of a ball bar."""
    units: dict[str, str] = field(default_factory=dict)
    """Of columns whose header has none."""


def instrument_names() -> list[str]:
    """Those that come with stiffmap."""
    return sorted(p.stem for p in FOLDER.glob("*.yaml"))


def load_instrument(name_or_path: str) -> Instrument:
    """A shipped instrument by its name, or a mapping file; raises StiffmapError."""
    path = FOLDER / f"{name_or_path}.yaml"
    if not path.exists():
        path = Path(name_or_path)
    if not path.exists():
        raise StiffmapError(
            f"--instrument: expected {', '.join(instrument_names())}, or a file; got '{name_or_path}'"
        )
    data = read(path).data
    if not isinstance(data, dict) or not set(data) <= KEYS or not {"title", "quantity"} <= set(data):
        raise FileError(
            f"a mapping file has title, quantity and some of {', '.join(sorted(KEYS))}", file=str(path)
        )
    for key in ("columns", "measured", "circle"):
        for meaning, pattern in data.get(key, {}).items():
            try:
                re.compile(pattern)
            except (re.error, TypeError) as problem:
                raise FileError(
                    f"{key}.{meaning}: no regular expression: {problem}", file=str(path)
                ) from None
    return Instrument(**data)


def as_readings(
    sheet: Sheet, instrument: Instrument, constants: Mapping[str, float], given: Mapping[str, Sequence[str]]
) -> tuple[Sheet, dict[str, list[str]], dict[str, str], dict[str, float]]:
    """The sheet with columns of readings, the columns' meanings, units of those without, and constants left over.

    `given`: what a person says of columns. Where these or the headers name px, py, pz, nothing is taken off the places seen.

    Raises StiffmapError where the sheet lacks a column that the instrument needs.
    """
    if instrument.circle:
        return _of_circle(sheet, instrument, constants)
    chosen: dict[str, list[str]] = {}
    units: dict[str, str] = {}
    for meaning, pattern in instrument.columns.items():
        index = _find(sheet, pattern)
        if index is not None:
            chosen[meaning] = [sheet.header[index]]
            units |= _unit(sheet, index, meaning, instrument)
    said = guess(sheet.header, given)
    seen = any(c.meaning in SEEN for c in said)
    for c in said:
        unit = instrument.units.get(c.meaning.replace("p", "d") if c.meaning in SEEN else c.meaning)
        if unit and not c.unit and (seen or c.meaning in given):
            units[c.meaning] = unit
    for reading, pattern in ({} if seen else instrument.measured).items():
        axis = reading[-1]
        own = _find(sheet, pattern)
        if own is None:
            continue
        if axis not in chosen:
            raise StiffmapError(
                f"{sheet.file}: '{sheet.header[own]}' was measured; no column is its commanded {axis}"
            )
        command = sheet.header.index(chosen[axis][0])
        scale = [_named(sheet, i, m, instrument) for i, m in ((own, reading), (command, axis))]
        pairs = zip(sheet.numbers(own), sheet.numbers(command), strict=True)
        name = f"{sheet.header[own]} less {sheet.header[command]} [mm]"
        sheet = with_column(sheet, name, [a * scale[0] - b * scale[1] for a, b in pairs])
        chosen[reading] = [name]
    return sheet, chosen, units, dict(constants)


def _of_circle(
    sheet: Sheet, instrument: Instrument, constants: Mapping[str, float]
) -> tuple[Sheet, dict[str, list[str]], dict[str, str], dict[str, float]]:
    """Poses on the circle, its centre as the second pose, and the distance's deviation."""
    lost = [c for c in CIRCLE if c not in constants]
    if lost:
        raise StiffmapError(f"a ball bar needs --set {lost[0]}=NUMBER (mm)")
    at: dict[str, int] = {}
    for key in ("angle", "deviation"):
        found = _find(sheet, instrument.circle[key])
        if found is None:
            raise StiffmapError(f"{sheet.file}: no column is the {key}; there are: {', '.join(sheet.header)}")
        at[key] = found
    turn = _named(sheet, at["angle"], "angle", instrument)
    size = _named(sheet, at["deviation"], "deviation", instrument)
    angles = [turn * a for a in sheet.numbers(at["angle"])]
    centre = {a: constants[f"centre_{a}"] for a in "xyz"}
    plane = instrument.circle["plane"]
    waves = {plane[0]: math.cos, plane[1]: math.sin}
    chosen = {}
    for a in "xyz":
        values = [centre[a] + (constants["radius"] * waves[a](t) if a in waves else 0.0) for t in angles]
        for name, column in ((a, values), (f"{a}2", [centre[a]] * len(angles))):
            sheet = with_column(sheet, f"{name} of the circle [mm]", column)
            chosen[name] = [f"{name} of the circle [mm]"]
    sheet = with_column(sheet, "radial deviation [mm]", [size * v for v in sheet.numbers(at["deviation"])])
    chosen["dd"] = ["radial deviation [mm]"]
    return sheet, chosen, {}, {k: v for k, v in constants.items() if k not in CIRCLE}


def with_column(sheet: Sheet, name: str, values: list[float]) -> Sheet:
    """The sheet and one column more."""
    cell = [("" if math.isnan(v) else repr(float(v))) for v in values]
    if sheet.decimal_comma:
        cell = [c.replace(".", ",") for c in cell]
    return replace(sheet, header=(*sheet.header, name), columns=(*sheet.columns, Cells.of(cell)))


def _find(sheet: Sheet, pattern: str) -> int | None:
    for i, header in enumerate(sheet.header):
        if re.fullmatch(pattern, split_unit(header)[0], re.IGNORECASE):
            return i
    return None


def _named(sheet: Sheet, index: int, meaning: str, instrument: Instrument) -> float:
    """mm or rad that one of a column's unit is: its header's, else the instrument's."""
    own = split_unit(sheet.header[index])[1]
    quantity = "angle" if meaning == "angle" else "length"
    size = sheet.size(index, meaning, quantity, own or instrument.units.get(meaning, ""))
    return size if quantity == "angle" else 1e3 * size


def _unit(sheet: Sheet, index: int, meaning: str, instrument: Instrument) -> dict[str, str]:
    given = instrument.units.get(meaning)
    return {meaning: given} if given and not split_unit(sheet.header[index])[1] else {}
