"""Machine files of common classes from a few dimensions: what ``stiffmap new --from`` writes."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from stiffmap.common.errors import HomeError, StiffmapError
from stiffmap.common.yaml_text import read
from stiffmap.model.files.load import description_from_text
from stiffmap.model.files.schema.base import suggestion
from stiffmap.solve.kinematics import inverse_kinematics
from stiffmap.solve.machine import Machine
from stiffmap.solve.starters.machine_class import MachineClass

NAMES = ("3-rrr", "3-prr", "five-bar", "xy-table", "hexapod", "delta", "linear-delta", "orthoglide",
         "scara", "gantry", "five-axis", "arm")  # fmt: skip
CLASSES = {n: MachineClass(n, read(Path(__file__).with_name(f"{n}.yaml")).data) for n in NAMES}
SHRINK, MOST_TRIES = 0.8, 16

__all__ = ["CLASSES", "class_of", "machine_text"]


def class_of(name: str) -> MachineClass:
    """A class by its name; StiffmapError lists them."""
    if name not in CLASSES:
        raise StiffmapError(
            f"--from: no class '{name}'{suggestion(name, list(CLASSES))}; there are: {', '.join(CLASSES)}"
        )
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
