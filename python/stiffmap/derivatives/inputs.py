"""Derivatives with respect to the commanded pose and to the wrench."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from stiffmap.broadcasting import Floats
from stiffmap.compiled import CompiledMachine
from stiffmap.derivatives.requests import INPUTS
from stiffmap.derivatives.stencil import central
from stiffmap.rotations import rotation_about
from stiffmap.solution import Solution
from stiffmap.solving import Call, solve_call

POSE_STEP = 1e-4  # of the machine's length, rad
LOAD_STEP = 1e-5  # N, as the machine's characteristic stiffness times this share of its length


def along_input(
    machine: CompiledMachine, call: Call, base: Solution, name: str, of: tuple[str, ...]
) -> Iterator[tuple[str, dict[str, Floats]]]:
    """For each component of an input: its name, and the derivative of each quantity.

    ``position x`` per m; ``rotation rx`` per rad, the command turned about base axes; ``wrench fx`` per N (the
    wrench at `point`, other wrenches as they are). Central differences of the whole solution, of second order.
    """
    for i, component in enumerate(INPUTS[name]):
        step = _step(machine, name, i)
        stencil = central(step)
        ends = [solve_call(machine, _moved(machine, call, name, i, h))[0] for h in stencil.offsets]
        yield (
            f"{name} {component}",
            {q: stencil.combine(getattr(base, q), [getattr(s, q) for s in ends]) for q in of},
        )


def _step(machine: CompiledMachine, name: str, i: int) -> float:
    length, stiffness = machine.length, machine.stiffness
    if name == "wrench":
        return float(LOAD_STEP * stiffness * length * (length if i > 2 else 1.0))
    return float(POSE_STEP * (length if name == "position" else 1.0))


def _moved(machine: CompiledMachine, call: Call, name: str, i: int, h: float) -> Call:
    if name == "position":
        return replace(call, position=np.asarray(call.position, dtype=float) + h * np.eye(3)[i])
    if name == "wrench":
        given = np.zeros(6) if call.wrench is None else np.asarray(call.wrench, dtype=float)
        return replace(call, wrench=given + h * np.eye(6)[i])
    now = call.options.rotation
    given = machine.home_rotation if now is None else np.asarray(now, dtype=float)
    turn = np.array(rotation_about(np.eye(3)[i], h))
    return replace(call, options=replace(call.options, rotation=turn @ given))
