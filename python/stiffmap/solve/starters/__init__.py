"""Machine files of common classes from a few dimensions: what ``stiffmap new --from`` writes.

A class of machines is one YAML file of this folder, and the machine file that it gives for some dimensions. `dimensions` holds the defaults (mm; `drive` N/µm where it slides, kN·m/rad where it turns), `home` and `task` those of the machine file, `box` the half
extents of the workspace about home, `let` numbers by name, and `need` what has to be positive. In `text`, ``<radius / 2>``
stands for its value to 12 digits and ``<radius / 2:g>`` for its value in that format. A line ``<legs>`` stands for the text
under `repeat`, `legs`, once for each entry of the lists that it goes `over`.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from textwrap import indent
from types import MappingProxyType
from typing import Any

from stiffmap.common.arithmetic import evaluate
from stiffmap.common.errors import HomeError, StiffmapError, unknown_name
from stiffmap.common.yaml_text import read
from stiffmap.model.files.load import description_from_text
from stiffmap.solve.kinematics import inverse_kinematics
from stiffmap.solve.machine import Machine

_PLACE = re.compile(r"<([^<>:]+)(?::([^<>]+))?>")
_REPEATED = re.compile(r"(?m)^( *)<(\w+)>$")
Box = tuple[float, float, float]


@dataclass(frozen=True)
class MachineClass:
    """Name and file of a class."""

    name: str
    file: Mapping[str, Any]

    @property
    def title(self) -> str:
        """What it is, in a few words."""
        return str(self.file["summary"])

    @property
    def defaults(self) -> Mapping[str, float]:
        """Its dimensions."""
        found: Mapping[str, float] = self.file["dimensions"]
        return found

    def values(self, given: Mapping[str, float | None]) -> dict[str, float]:
        """The defaults with what is given; StiffmapError for a dimension that this class has not, or that is not positive."""
        asked = {k: v for k, v in given.items() if v is not None}
        for key, value in asked.items():
            if key not in self.defaults:
                raise StiffmapError(
                    f"--{key}: a {self.name} has no such dimension; it has: "
                    + ", ".join(f"--{k}" for k in self.defaults)
                )
            if not value > 0.0:
                raise StiffmapError(f"--{key}: expected a positive number, got {value:g}")
        out = {**self.defaults, **asked}
        if 2 * out["wall"] >= out["tube"]:
            raise StiffmapError(
                f"--wall: expected less than half of the tube ({out['tube']:g} mm), got {out['wall']:g}"
            )
        return out

    def box(self, d: Mapping[str, float]) -> Box:
        """Usual half extents (mm) of the workspace about home."""
        x, y, z = (evaluate(e, d) for e in self.file["box"])
        return x, y, z

    def text(self, d: Mapping[str, float], box: Box) -> str:
        """The machine file for dimensions, with half extents (mm) of its workspace; StiffmapError where they make no machine."""
        names = _Names(d, self.file.get("let", {}))
        for rule in self.file.get("need", ()):
            if not all(_value(e, names) > 0.0 for e in rule["positive"]):
                raise StiffmapError(_filled(rule["otherwise"], names))
        home = [f"{_value(e, names):.12g}" for e in self.file["home"]]
        body = _REPEATED.sub(
            lambda m: indent(_repeated(self.file["repeat"][m[2]], names), m[1]), self.file["text"]
        )
        return self._head(d, home, box) + "\n" + _filled(body, names)

    def _head(self, d: Mapping[str, float], home: list[str], box: Box) -> str:
        """Lines before the legs; the box lies about home, and has no axis along which the tool is not commanded."""
        sides = [
            f"{a}: [{float(c) - e:.9g}, {float(c) + e:.9g}]"
            for a, c, e in zip("xyz", home, box, strict=True)
            if e > 0.0
        ]
        dims = ", ".join(f"{k} {v:g}" for k, v in d.items())
        title, task = self.file["title"], self.file.get("task")
        return f"""\
# {title}. What the keys mean: docs/machine_files.md, or `stiffmap new` without --from
name: NAME
title: {title}
source: "made by stiffmap new --from {self.name}: {dims} (mm; drives in N/µm or kN·m/rad); replace what you know better"
units: {{length: mm, force: N, angle: deg, mass: kg}}

home: {{translation: [{", ".join(home)}], solve: true}}
{f"task: {task}{chr(10)}" if task else ""}workspace: {{{", ".join(sides)}}}

materials:
  steel: {{E: 2.1e5, nu: 0.3, density: 7.85e-6}}
"""


class _Names(dict[str, float]):
    """Numbers by name, those of formulas worked out when they are asked for."""

    def __init__(self, known: Mapping[str, float], formulas: Mapping[str, str]) -> None:
        super().__init__(known)
        self.formulas = formulas

    def __contains__(self, name: object) -> bool:
        return super().__contains__(name) or name in self.formulas

    def __missing__(self, name: str) -> float:
        self[name] = found = _value(self.formulas[name], self)
        return found


def _value(text: str | float, names: Mapping[str, float]) -> float:
    return evaluate(text, names, _FUNCTIONS)


def _filled(text: str, names: Mapping[str, float], words: Mapping[str, str] = MappingProxyType({})) -> str:
    """A text with the values of its places; a name of `words` as it stands."""
    return _PLACE.sub(lambda m: words.get(m[1]) or format(_value(m[1], names), m[2] or ".12g"), text)


def _repeated(part: Mapping[str, Any], names: _Names) -> str:
    """The text of a part, filled in for each entry of its lists."""
    out = []
    for entry in zip(*part["over"].values(), strict=True):
        here = dict(zip(part["over"], entry, strict=True))
        words = {k: v for k, v in here.items() if isinstance(v, str)}
        numbers = {k: v for k, v in here.items() if k not in words}
        inside = _Names({**names, **numbers}, {**names.formulas, **part.get("let", {})})
        out.append(_filled(part["text"], inside, words))
    return "".join(out).removesuffix("\n")


def _elbow(x: float, y: float, arm: float, forearm: float, bend: float) -> tuple[float, float]:
    """Angles (deg) of arm and forearm (from the arm) to a point; `bend` 1: the elbow to the right of the way there, -1: to the left."""
    r = math.hypot(x, y)
    if not abs(arm - forearm) < r < arm + forearm:
        raise StiffmapError(
            f"--arm, --forearm: links of {arm:g} and {forearm:g} mm do not reach a point {r:.4g} mm away"
        )
    inner = math.acos((arm**2 + r**2 - forearm**2) / (2 * arm * r))
    first = math.atan2(y, x) - bend * inner
    second = math.atan2(y - arm * math.sin(first), x - arm * math.cos(first)) - first
    return math.degrees(first), (math.degrees(second) + 180) % 360 - 180


_FUNCTIONS = {
    f.__name__: f for f in (math.sqrt, math.sin, math.cos, math.asin, math.atan2, math.degrees, math.radians)
} | {"arm_angle": lambda *to: _elbow(*to)[0], "forearm_angle": lambda *to: _elbow(*to)[1]}


NAMES = ("3-rrr", "3-prr", "five-bar", "xy-table", "hexapod", "delta", "linear-delta", "orthoglide",
         "scara", "gantry", "five-axis", "arm")  # fmt: skip
CLASSES = {n: MachineClass(n, read(Path(__file__).with_name(f"{n}.yaml")).data) for n in NAMES}
SHRINK, MOST_TRIES = 0.8, 16


def class_of(name: str) -> MachineClass:
    """A class by its name; StiffmapError lists them."""
    if name not in CLASSES:
        raise StiffmapError(f"--from: {unknown_name('class', name, CLASSES)}")
    return CLASSES[name]


def machine_text(kind: str, name: str, given: Mapping[str, float | None]) -> str:
    """Text of a machine file of a class, called `name`, with the dimensions that are given (mm).

    The workspace is the largest box of the class's proportions, up to its usual size, whose corners the drives reach.
    StiffmapError for an unknown class or dimension, or dimensions that make no machine.
    """
    made = class_of(kind)
    values = made.values(given)
    extents = made.box(values)
    for _ in range(MOST_TRIES):
        text = made.text(values, extents).replace("name: NAME", f"name: {name}", 1)
        try:
            machine = Machine(description_from_text(text, f"{kind} of these dimensions"))
        except HomeError as problem:
            raise StiffmapError(f"--from {kind}: no machine has these dimensions: {problem}") from None
        if _reaches(machine):
            return text
        extents = (SHRINK * extents[0], SHRINK * extents[1], SHRINK * extents[2])
    raise StiffmapError(
        f"--from {kind}: a machine of these dimensions hardly moves from home; lengthen its links"
    )


def _reaches(machine: Machine) -> bool:
    low, high = machine.workspace
    corners = [[(low, high)[b >> i & 1][i] for i in range(3)] for b in range(8)]
    found = inverse_kinematics(machine, corners)
    return bool((found.status == 0).all() and not found.flags.any())
