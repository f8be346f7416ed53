"""What instruments write: small mapping files that say which header means what."""

from __future__ import annotations

import re
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import FileError, StiffmapError
from stiffmap.common.tables.header import COMMANDED, MEASURED
from stiffmap.common.yaml_text import read
from stiffmap.experiment.files.fields import READ, SEEN, quantity_of
from stiffmap.experiment.poses.handeye import own_frame
from stiffmap.experiment.spreadsheet.answers import Meant
from stiffmap.experiment.spreadsheet.guess import guess
from stiffmap.experiment.spreadsheet.turned import turns_behind

FOLDER = Path(__file__).parent / "instruments"
KEYS = {"title", "quantity", "columns", "measured", "circle", "units"}
WORDS = {"{commanded}": COMMANDED, "{measured}": MEASURED}
"""What stands for any word of that meaning in a mapping file."""
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
            for word, any_of in WORDS.items():
                data[key][meaning] = data[key][meaning].replace(word, f"({any_of})")
    return Instrument(**data)


def as_readings(m: Meant, instrument: Instrument) -> set[str]:
    """Columns of readings, their meanings, and units of those without; which of them are what was measured less what was commanded.

    What a person says of columns stays. Where that or the headers name px, py, pz, nothing is taken off the places seen.

    Raises StiffmapError where the sheet lacks a column that the instrument needs.
    """
    of = {k: quantity_of(k) or {"angle": "angle"}.get(k, "length") for k in instrument.units}
    usual = {k: u for k, u in instrument.units.items() if not m.usual_unit(of[k])}
    instrument = replace(instrument, units=usual)  # --unit and a line above speak of all without one
    if instrument.circle:
        _of_circle(m, instrument)
        return set()
    chosen: dict[str, list[str]] = {}
    units: dict[str, str] = {}
    for meaning, pattern in instrument.columns.items():
        index = m.sheet.find(pattern)
        if index is None and (other := instrument.measured.get(f"d{meaning}")):  # X next to X meas
            bare = m.sheet.find(meaning)
            index = bare if m.sheet.find(other, (bare,)) is not None else None
        if index is not None:
            chosen[meaning] = [m.sheet.header[index]]
    said = guess(m.sheet.header, chosen | m.chosen, m.sheet.file)
    seen = any(c.meaning in SEEN for c in said)
    for c in said:
        unit = instrument.units.get(READ.get(c.meaning, c.meaning))
        if unit and not c.unit:
            units[c.meaning] = unit
    at: dict[str, tuple[int, int]] = {}
    for reading, pattern in ({} if seen else instrument.measured).items():
        given = (chosen | m.chosen).get(a := reading[-1])
        command = m.index(given[0]) if given else None
        own = m.sheet.find(pattern, (command,))
        if own is None or (command is None and any(c.meaning == reading for c in said)):
            continue
        if command is None:
            raise StiffmapError(
                f"{m.sheet.file}: expected {a} as commanded and as measured; found '{m.sheet.header[own]}' alone: say --map {a}='HEADER' "
                f"of the commanded one, or --map p{a}='HEADER' of one that was seen in a frame of its own"
            )
        at[reading] = own, command
    if at:
        read = np.column_stack([_si(m, own, r, instrument) for r, (own, _) in at.items()])
        asked = np.column_stack([_si(m, command, r[-1], instrument) for r, (_, command) in at.items()])
        turns = turns_behind(m, at["dz"][1]) if "dz" in at else None
        apart = len(at) == 3 and own_frame(1e-3 * read, 1e-3 * asked, turns) is not None
        for (reading, (own, command)), values in zip(
            at.items(), (read if apart else read - asked).T, strict=True
        ):
            meaning, how = reading, f" less {m.sheet.names[command]}"
            if apart:
                meaning, how = f"p{reading[-1]}", ", seen"
            name = f"{m.sheet.names[own]}{how} [mm]"
            m.sheet = m.sheet.with_column(name, values)
            chosen[meaning] = [name]
            if meaning not in m.chosen:
                m.units.pop(meaning, None)
    less = set() if seen or not at or apart else {*at} - {*m.chosen}
    m.chosen, m.units = chosen | m.chosen, units | m.units
    return less


def _of_circle(m: Meant, instrument: Instrument) -> None:
    """Poses on the circle, its centre as the second pose, and the distance's deviation."""
    lost = [c for c in CIRCLE if c not in m.constants]
    if lost:
        raise StiffmapError(f"a ball bar needs --set {lost[0]}=NUMBER (mm)")
    at: dict[str, int] = {}
    for key in ("angle", "deviation"):
        own = m.chosen.pop(key, None)
        found = m.index(own[0]) if own else m.sheet.find(instrument.circle[key])
        if found is None:
            raise StiffmapError(
                f"{m.sheet.file}: no column is the {key}; say --map {key}='HEADER'; there are: {', '.join(m.sheet.header)}"
            )
        at[key] = found
    angles, deviation = (_si(m, i, key, instrument) for key, i in at.items())
    *centre, radius = (m.constants.pop(c) for c in CIRCLE)
    i = at["deviation"]
    radii = deviation if m.written_unit(i, "deviation") else m.sheet.numbers(i)  # in mm, as --set has it
    if abs(np.nanmedian(radii) / radius - 1) < 0.1:  # deviations are far smaller
        deviation = radii - radius
        m.said.append(f"'{m.sheet.header[i]}' holds radii: the deviation is what is above {radius:g} mm")
    plane = instrument.circle["plane"]
    waves = {plane[0]: np.cos(angles), plane[1]: np.sin(angles)}
    made = {}
    for a, middle in zip("xyz", centre, strict=True):
        made[f"{a} of the circle [mm]"] = a, middle + radius * waves.get(a, np.zeros(len(angles)))
        made[f"{a}2 of the circle [mm]"] = f"{a}2", np.full(len(angles), middle)
    made["radial deviation [mm]"] = "dd", deviation
    for name, (_, values) in made.items():
        m.sheet = m.sheet.with_column(name, values)
    m.chosen = {meaning: [name] for name, (meaning, _) in made.items()} | m.chosen


def _si(m: Meant, index: int, meaning: str, instrument: Instrument) -> Floats:
    """A column in mm or rad, of the unit that is said or in its header, else the instrument's."""
    own = {} if m.sheet.unit(index) else {meaning: instrument.units.get(meaning, "")}
    quantity = "angle" if meaning == "angle" else "length"
    size = replace(m, units=own | m.units).unit(index, meaning, quantity=quantity).size
    return (size if quantity == "angle" else 1e3 * size) * m.sheet.numbers(index)
