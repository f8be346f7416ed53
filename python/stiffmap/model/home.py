"""How the declared home configuration closes, in words of the machine file."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from stiffmap.common.units import ANGLE, LENGTH
from stiffmap.model.description import MachineDescription

ENOUGH = 1e-9  # m, rad; below it, a gap is round-off
ADVICE = (
    "correct the dimensions or the home coordinates, which must close within 5 % of the machine's size; "
    "with 'solve: true' in the home at the top of the file they are a first guess only"
)


class Gap(NamedTuple):
    """How far the TCP as a leg carries it is from the home pose (with a partial task: the first leg's TCP in the
    commanded components, the other legs' ends from the first leg's), or a branch's end from the first branch
    of its block: full name, m, rad."""

    name: str
    translation: float
    rotation: float


def gap_text(machine: MachineDescription, gaps: Sequence[tuple[str, float, float]]) -> str:
    """The gaps that are more than round-off, in the file's units: ``left by 0.3 mm and 0.1 deg``."""
    units = machine.units
    wide = [Gap(*g) for g in gaps if max(g[1], g[2]) > ENOUGH] or [Gap(*g) for g in gaps]

    def parts(g: Gap) -> str:
        both = ((g.translation, LENGTH), (g.rotation, ANGLE))
        told = [units.say(v, dimension) for v, dimension in both if v > ENOUGH]
        return " and ".join(told or [units.say(v, dimension) for v, dimension in both])

    return ", ".join(f"{g.name} by {parts(g)}" for g in wide)


def misfit_text(
    machine: MachineDescription,
    declared: Sequence[tuple[str, float, float]],
    closest: Sequence[tuple[str, float, float]],
) -> str:
    """Why a home configuration is refused."""
    best = "" if closest == declared else f"; at best: {gap_text(machine, closest)}"
    return f"home configuration does not close: {gap_text(machine, declared)}{best}; {ADVICE}"
