"""Process files, and those that come with stiffmap: from the keys of a file to a process; units, bounds, what goes together."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import isfinite, nan, pi
from os import PathLike
from pathlib import Path
from typing import Any, Literal, NoReturn

from pydantic import Field, create_model

from stiffmap.common.errors import FileError, StiffmapError, refuse_folder, suggestion
from stiffmap.common.number_text import number_in
from stiffmap.common.units import FREQUENCIES, feed_unit
from stiffmap.common.yaml_text import Document, read
from stiffmap.machining.process.description import Cut, EndMill, Kienzle, Law, Process, Tool, Trimming
from stiffmap.model.files.report import key_text, validated
from stiffmap.model.files.schema.base import FileModel, Name, describe
from stiffmap.workspace.performance.quantities import quantity

GivenProcess = Process | str | PathLike[str] | Mapping[str, object]
FOLDER = Path(__file__).with_name("library")


def process_names() -> list[str]:
    """Names of the processes that come with stiffmap."""
    return sorted(p.stem for p in FOLDER.glob("*.yaml"))


def as_process(given: GivenProcess) -> Process:
    """The process itself, or the one that `load_process` finds."""
    return given if isinstance(given, Process) else load_process(given)


def load_process(source: str | PathLike[str] | Mapping[str, object]) -> Process:
    """A process by its shipped name (``trimming``, ``slot``), from a file, or from a mapping with the file's keys.

    Numbers carry units there (docs/milling.md); the result is in SI. Raises FileError naming file, line, key,
    what was expected and what was found.
    """
    if isinstance(source, Mapping):
        return process_of(Document(dict(source)), "process")
    path = FOLDER / f"{source}.yaml" if str(source) in process_names() else Path(source)
    if not path.is_file():
        refuse_folder(source, "a process file or the name of a shipped process")
        near, known = suggestion(path.stem, process_names()), ", ".join(process_names())
        what = f"no such process file, and no process of that name is shipped{near}; these are: {known}"
        raise FileError(what, file=str(source))
    return process_of(read(path), str(path))


LAWS: dict[str, type[Law]] = {"end_mill": EndMill, "kienzle": Kienzle, "trimming": Trimming}
PRESSURE, EDGE = "N/m2", "N/m"
UNITS = {
    **dict.fromkeys(("Ktc", "Krc", "Kac", "kc11", "rubbing", "specific_energy"), PRESSURE),
    **dict.fromkeys(("Kte", "Kre", "Kae"), EDGE),
}
ZERO = ("axial", "rubbing")
"""Numbers of a law that are zero where the file does not say them."""
MAIN = ("Ktc", "kc11", "specific_energy")
"""Numbers of a law that are above zero, and what they may be, N/m²: from foam to beyond any metal."""
PRESSURES = (1e5, 1e11)
MOST = {"": (10.0, "10 (0.3 for 30 %)"), PRESSURE: (10.0, "10 times"), EDGE: (1e-3, "1 mm times")}
"""Of a law's other numbers and their uncertainties: shares; pressures and edge forces by the main number."""
THINNEST = 1e-7
"""m, feed per tooth: below, no edge of a tool cuts."""
FASTEST = 1e6 * pi / 30  # rad/s, of a spindle
LONGEST = 1.0
"""m of a tool or a cut: above, millimetres were meant."""


@dataclass
class NumberReader:
    """Numbers of one file, with the place of what is wrong."""

    document: Document
    file: str
    uncertainty: dict[str, float] = field(default_factory=dict)

    def fail(self, message: str, *keys: str | int) -> NoReturn:
        """Raise an error at a key."""
        raise FileError(message, file=self.file, line=self.document.line(keys), key=key_text(keys))

    def si(self, value: object, unit: str, *keys: str | int) -> float:
        """SI value of a number with its unit."""
        text = str(value).replace("J/", "N*m/") if unit == PRESSURE else value
        try:
            out = quantity(text, unit)
        except (StiffmapError, ZeroDivisionError, OverflowError) as error:
            self.fail(str(error), *keys)
        if not isfinite(out):
            self.fail(f"expected a finite number, found {value!r}", *keys)
        return out

    def positive(self, value: object, unit: str, *keys: str | int, most: float = float("inf")) -> float:
        """The same, above zero and not above `most`."""
        out = self.si(value, unit, *keys)
        if not 0 < out <= most:
            limit = f" and at most {1e3 * most:g} mm" if isfinite(most) else ""
            self.fail(f"expected a number above zero{limit}, found {value!r}", *keys)
        return out


def spindle_rate(text: str) -> float:
    """rad/s of ``6000 rpm`` or ``100 Hz``; NaN where that is no speed of a spindle, above zero and up to 1e6 rpm."""
    unit = max((u for u in FREQUENCIES if text.lower().endswith(u)), key=len, default="")
    try:
        out = 2 * pi * (number_in(text.lower().removesuffix(unit)) * FREQUENCIES[unit]) if unit else nan
    except ValueError:
        return nan
    return out if 0 < out <= FASTEST else nan


def process_of(document: Document, file: str) -> Process:
    """Schema, then units; raises `FileError` naming file, line and key."""
    expected = "a process file is a mapping with name, tool, law, spindle, feed and cut"
    m = validated(ProcessFile, document, file, expected)
    r = NumberReader(document, file)
    tool, spindle = _tool(m, r), spindle_rate(str(m.spindle).strip())
    if not spindle > 0:
        r.fail(
            f"expected a speed such as 6000 rpm, above zero, up to 1e6 rpm; found {m.spindle!r}", "spindle"
        )
    feed, cut, law = _feed(m.feed, tool, spindle, r), _cut(m, tool, r), _law(m, tool, r)
    tolerance = None if m.tolerance is None else r.positive(m.tolerance, "m", "tolerance", most=tool.diameter)
    process = Process(m.name, tool, law, spindle, feed, cut, tolerance, m.title, m.source, r.uncertainty)
    if tool.teeth and not THINNEST <= process.chip <= tool.diameter / 2:
        r.fail(
            f"the chip is too {'thin' if process.chip < THINNEST else 'thick'}: {1e3 * process.chip:.4g} mm per tooth at "
            f"{60e3 * feed:.4g} mm/min and {spindle * 30 / pi:.4g} rpm; expected {1e3 * THINNEST:g} mm to half the tool's diameter", "feed"
        )  # fmt: skip
    return process


def _tool(m: ProcessFile, r: NumberReader) -> Tool:
    t = m.tool
    diameter = r.positive(t.diameter, "m", "tool", "diameter", most=LONGEST)
    coated = t.teeth == "coated"
    if not coated and (not isinstance(t.teeth, int) or not 1 <= t.teeth <= 1000):
        r.fail(f"expected 1 to 1000 teeth, or coated; found {describe(t.teeth)}", "tool", "teeth")
    teeth = t.teeth if isinstance(t.teeth, int) else 0
    helix = r.si(t.helix, "rad", "tool", "helix")
    if not abs(helix) < pi / 2 * 0.95:
        r.fail(f"expected a helix angle below 85 deg, found {t.helix!r}", "tool", "helix")
    out, angle = 0.0, 0.0
    if t.runout is not None:
        out = r.si(t.runout.offset, "m", "tool", "runout", "offset")
        angle = r.si(t.runout.angle, "rad", "tool", "runout", "angle")
        if not 0 <= out < diameter / 4:
            found = f"expected zero to a quarter of the diameter, found {t.runout.offset!r}"
            r.fail(found, "tool", "runout", "offset")
    stick = r.si(t.stick_out, "m", "tool", "stick_out")
    if stick < 0:
        r.fail(f"expected a length of zero or more, found {t.stick_out!r}", "tool", "stick_out")
    modulus = 0.0 if t.modulus is None else r.positive(t.modulus, PRESSURE, "tool", "modulus")
    return Tool(diameter, teeth, helix, out, angle, stick, modulus)


def _feed(value: object, tool: Tool, spindle: float, r: NumberReader) -> float:
    way, per = feed_unit(str(value))
    if not per:
        return r.positive(way, "m/s", "feed")
    if per == "tooth" and not tool.teeth:
        r.fail("a coated tool has no feed per tooth; expected such as 10 m/min", "feed")
    return r.positive(way, "m", "feed") * (tool.teeth if per == "tooth" else 1) * spindle / (2 * pi)


def _cut(m: ProcessFile, tool: Tool, r: NumberReader) -> Cut:
    c = m.cut
    axial = r.positive(c.axial, "m", "cut", "axial", most=LONGEST)
    if c.radial is None:
        if c.side != "slot":
            r.fail(f"missing key 'radial': the width of a {c.side} cut", "cut")
        return Cut(c.side, tool.diameter, axial, c.through)
    radial = r.positive(c.radial, "m", "cut", "radial")
    found = f"({1e3 * tool.diameter:g} mm), found {c.radial!r}"
    if c.side == "slot" and radial != tool.diameter:
        r.fail(f"a slot is as wide as the tool {found}", "cut", "radial")
    if radial > tool.diameter:
        r.fail(f"expected at most the tool's diameter {found}", "cut", "radial")
    return Cut(c.side, radial, axial, c.through)


def _law(m: ProcessFile, tool: Tool, r: NumberReader) -> Law:
    given = [n for n in LAWS if getattr(m.law, n) is not None]
    if len(given) != 1:
        r.fail(f"expected one of {', '.join(LAWS)}, found {', '.join(given) or 'none'}", "law")
    name = given[0]
    if (name == "trimming") != (tool.teeth == 0):
        teeth = "without" if name == "trimming" else "with"
        r.fail(f"the law {name} is for a tool {teeth} a number of teeth", "law", name)
    model = getattr(m.law, name)
    values: dict[str, Any] = {}
    for k in type(model).model_fields:
        number, unit, keys = getattr(model, k), UNITS.get(k, ""), ("law", name, k)
        values[k] = (r.positive if k in MAIN else r.si)(number.value, unit, *keys)
        if k in MAIN and not PRESSURES[0] <= values[k] <= PRESSURES[1]:
            low, high = (p / 1e6 for p in PRESSURES)
            r.fail(f"expected {low:g} to {high:g} N/mm2 (J/cm3), found {number.value!r}", *keys)
        main = next(iter(values))  # each law has it first
        most, limit = (
            MOST[unit][0] * (values[main] if unit else 1),
            f"{MOST[unit][1]} {main if unit else ''}".strip(),
        )
        if abs(values[k]) > most:
            r.fail(f"expected at most {limit}; found {number.value!r}", *keys)
        if number.u is not None:
            r.uncertainty[k] = r.si(number.u, unit, *keys, "u")
            if not 0 <= r.uncertainty[k] <= most:
                r.fail(
                    f"expected an uncertainty of zero or more, at most {limit}; found {number.u!r}",
                    *keys,
                    "u",
                )
    if not 0 <= values.get("mc", 0) < 1:
        r.fail(f"expected an exponent from 0 to below 1, found {model.mc.value!r}", "law", name, "mc")
    return LAWS[name](**values)


Written = str | float | int


class ProcessQuantity(FileModel):
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


def _law_keys(law: type[Law]) -> type[FileModel]:
    """A mapping with a key for each number of a law."""
    zero = {n: ProcessQuantity(value=f"0 {UNITS.get(n, '')}") for n in ZERO}
    keys: dict[str, Any] = {n: (ProcessQuantity, zero.get(n, ...)) for n in law.__dataclass_fields__}
    return create_model(law.__name__, __base__=FileModel, **keys)


_LAWS: dict[str, Any] = {n: (_law_keys(law) | None, None) for n, law in LAWS.items()}
ProcessLawModel = create_model("ProcessLawModel", __base__=FileModel, **_LAWS)


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
    law: ProcessLawModel  # type: ignore[valid-type]
    spindle: Written = Field(description="with its unit: 6000 rpm")
    feed: Written = Field(description="10 m/min, or 0.075 mm/tooth")
    cut: CutModel
    tolerance: Written | None = None
