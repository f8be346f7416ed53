"""The metrology loop as named points of the machine: what carries the instrument, the target, the reaction."""

from __future__ import annotations

from dataclasses import replace

from stiffmap.experiment.experiment import Experiment, Loop
from stiffmap.model.description import Element, Point, Spring
from stiffmap.model.effects import get, kinds
from stiffmap.solve.machine import Machine

BASE, PLATFORM = "base.rig_on_base", "platform.rig_on_platform"


def rigged(machine: Machine, loop: Loop) -> Machine:
    """The machine with a point behind the base's elements and one before the tool's holder, where the
    loop needs them."""
    d = machine.description
    if "base" in (loop.instrument_on, loop.force_against) and _yields(d.base):
        d = replace(d, base=(*d.base, Point(BASE.removeprefix("base."))))
    if loop.target_on == "platform" and _yields(d.platform):
        holders = tuple(k for k in kinds() if get(k).behind_platform)  # with which their names begin
        at = next((i for i, e in enumerate(d.platform) if e.name.startswith(holders)), len(d.platform))
        d = replace(
            d, platform=(*d.platform[:at], Point(PLATFORM.removeprefix("platform.")), *d.platform[at:])
        )
    return machine if d is machine.description else Machine(d, like=machine)


def _yields(elements: tuple[Element, ...]) -> bool:
    return any(isinstance(e, Spring) for e in elements)


def carrier(machine: Machine, where: str) -> str:
    """Point that moves with what `where` names; empty for what does not move."""
    if where == "base":
        return BASE if BASE in machine.points else ""
    return "" if where == "floor" else where


def targets(machine: Machine, experiment: Experiment) -> tuple[str, ...]:
    """(n,) point that is read in each row; on the platform instead of the tool where the loop says so."""
    points = experiment.points or (experiment.point,) * len(experiment)
    if PLATFORM not in machine.points:
        return points
    return tuple(PLATFORM if p == "tcp" else p for p in points)
