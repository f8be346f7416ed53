from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from rich.text import Text

from stiffmap.common.errors import StiffmapError
from stiffmap.common.outputs import new_file, write_text
from stiffmap.model.files.shipped import starter_text
from stiffmap.solve.starters import CLASSES, class_of, machine_text
from stiffmap.ui.cli import options
from stiffmap.ui.cli.options import argument, flag, option
from stiffmap.ui.cli.output import Answer

DIMENSIONS = {
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


def _dimension(key: str) -> Any:
    return option(f"{DIMENSIONS[key]}.", rich_help_panel="Dimensions (with --from)")


Length = float | None


def command(
    file: Path | None = argument("File to write; its stem becomes the machine's name.", None),
    kind: str | None = option(
        "Start from a machine of this class; --list names them.", None, "--from", metavar="CLASS"
    ),
    listed: bool = flag("List the classes and their dimensions.", "--list"),
    radius: Length = _dimension("radius"),
    platform: Length = _dimension("platform"),
    arm: Length = _dimension("arm"),
    forearm: Length = _dimension("forearm"),
    rod: Length = _dimension("rod"),
    height: Length = _dimension("height"),
    stroke: Length = _dimension("stroke"),
    reach: Length = _dimension("reach"),
    tube: Length = _dimension("tube"),
    wall: Length = _dimension("wall"),
    drive: Length = _dimension("drive"),
    overwrite: options.Overwrite = False,
) -> Answer:
    """Start a machine file: a template in which every key is explained, or a machine of a common class.

    With --from, the file is complete: geometry, steel tubes, drives, masses and a workspace within reach.

    Examples:
      [cyan]stiffmap new my_machine.yaml[/cyan]
      [cyan]stiffmap new --from 3-rrr my_3rrr.yaml --radius 300 --arm 180 --forearm 200[/cyan]
      [cyan]stiffmap new --from hexapod my_hexapod.yaml --radius 400 --height 600[/cyan]
      [cyan]stiffmap new --list[/cyan]
    """
    dimensions = {"radius": radius, "platform": platform, "arm": arm, "forearm": forearm, "rod": rod, "height": height,
                  "stroke": stroke, "reach": reach, "tube": tube, "wall": wall, "drive": drive}  # fmt: skip
    if listed:
        classes = {n: {"title": c.title, "dimensions": dict(c.defaults)} for n, c in CLASSES.items()}
        lines = (
            f"{name:<13}{c.title}\n{'':13}" + " ".join(f"--{k} {v:g}" for k, v in c.defaults.items())
            for name, c in CLASSES.items()
        )
        units = "lengths in mm; --drive in N/µm where drives slide, in kN·m/rad where they turn"
        return Answer(classes, [*lines, units])
    if file is None:
        raise StiffmapError("new: expected a file to write, such as my_machine.yaml (or --list)")
    if kind is None and (given := [k for k, v in dimensions.items() if v is not None]):
        raise StiffmapError(f"--{given[0]}: only with --from; the classes are {', '.join(CLASSES)}")
    new_file(file, overwrite)
    name = re.sub(r"[^A-Za-z0-9_\-]+", "-", file.stem)
    write_text(file, starter_text(name) if kind is None else machine_text(kind, name, dimensions))
    data: dict[str, Any] = {"file": file, "name": name}
    if kind is None:
        told = Text.assemble(f"wrote {file}; edit it, then: ", (f"stiffmap check {file}", "cyan"))
    else:
        data |= {"class": kind, "dimensions": class_of(kind).values(dimensions)}
        used = ", ".join(f"{k} {v:g}" for k, v in data["dimensions"].items())
        told = Text.assemble(
            f"wrote {file}: {kind} with {used} (mm; drive in N/µm or kN·m/rad)\nlook at it: ",
            (f"stiffmap show {file}", "cyan"), "; map it: ", (f"stiffmap map {file}", "cyan"),
        )  # fmt: skip
    return Answer(data, [told])
