"""A class of machines: its dimensions, and the text of a machine file with them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from stiffmap.common.errors import StiffmapError

Values = Mapping[str, float]
OPTIONS = {
    "radius": "mm, of the circle on which the legs stand on the base",
    "platform": "mm, of the circle on which the legs hold the platform",
    "arm": "mm, first link",
    "forearm": "mm, second link",
    "rod": "mm, rods or struts at home",
    "height": "mm, of the tool above (below: of a delta) the base, or of the arm's shoulder",
    "stroke": "mm, travel of the drives, or of each axis",
    "reach": "mm, from the last slide or pivot to the tool",
    "tube": "mm, outer diameter of the links",
    "wall": "mm, wall of the links' tubes",
    "drive": "stiffness of a drive: N/µm where it slides, kN·m/rad where it turns",
}
"""Every dimension that some class has."""


@dataclass(frozen=True)
class MachineClass:
    """Name, title, dimensions with their defaults (mm; `drive` as in `OPTIONS`), and the file's text for some of them.

    ``text`` takes the dimensions and the half extents (mm) of the workspace about home; ``box`` is what they are as shares
    of the dimension that they go by.
    """

    name: str
    title: str
    defaults: Values
    text: Callable[[Values, tuple[float, float, float]], str]
    box: Callable[[Values], tuple[float, float, float]]

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


def head(name: str, title: str, d: Values, task: str, home: str, box: tuple[float, float, float]) -> str:
    """Lines before the legs; the box lies about home, and has no axis along which the tool is not commanded."""
    x, y, z = (float(v) for v in home.strip("[]").split(","))
    sides = [
        f"{a}: [{c - e:.9g}, {c + e:.9g}]" for a, c, e in zip("xyz", (x, y, z), box, strict=True) if e > 0.0
    ]
    dims = ", ".join(f"{k} {v:g}" for k, v in d.items())
    task_line = f"task: {task}\n" if task else ""
    return f"""\
# {title}. What the keys mean: docs/machine_files.md, or `stiffmap new` without --from
name: NAME
title: {title}
source: "made by stiffmap new --from {name}: {dims} (mm; drives in N/µm or kN·m/rad); replace what you know better"
units: {{length: mm, force: N, angle: deg, mass: kg}}

home: {{translation: {home}}}
{task_line}workspace: {{{", ".join(sides)}}}

materials:
  steel: {{E: 2.1e5, nu: 0.3, density: 7.85e-6}}
"""


def beam(length: float, along: str, d: Values) -> str:
    """A beam of the class's tube."""
    return (
        f"{{length: {length:.12g}, along: {along}, tube: {{outer: {d['tube']:g}, inner: {d['tube'] - 2 * d['wall']:g}}}, "
        "material: steel}"
    )


def slide(d: Values) -> str:
    """Stiffness of a drive that slides, as the file writes it (N/mm)."""
    return f"stiffness: {d['drive'] * 1e3:.12g}"


def turn(d: Values) -> str:
    """Stiffness of a drive that turns (N·mm/rad)."""
    return f"stiffness: {d['drive'] * 1e6:.12g}"


def need(condition: bool, message: str) -> None:
    """StiffmapError with the message where dimensions do not go together."""
    if not condition:
        raise StiffmapError(message)
