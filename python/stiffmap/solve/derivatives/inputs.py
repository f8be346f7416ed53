"""Derivatives with respect to the commanded pose."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from stiffmap.common.broadcasting import Floats
from stiffmap.common.rotations import rotation_about
from stiffmap.solve.compiled import CompiledMachine
from stiffmap.solve.derivatives.requests import INPUTS
from stiffmap.solve.derivatives.stencil import central
from stiffmap.solve.solution import Solution
from stiffmap.solve.solving import Call, solve_call

POSE_STEP = 1e-4  # of the machine's length, rad


def along_input(
    machine: CompiledMachine, call: Call, base: Solution, name: str, of: tuple[str, ...]
) -> Iterator[tuple[str, dict[str, Floats]]]:
    """For each component of an input: its name, and the derivative of each quantity.

    ``position x`` per m; ``rotation rx`` per rad, the command turned about base axes. Central differences of the
    whole solution, of second order.
    """
    for i, component in enumerate(INPUTS[name]):
        step = _step(machine, name)
        stencil = central(step)
        ends = [solve_call(machine, _moved(machine, call, name, i, h))[0] for h in stencil.offsets]
        yield (
            f"{name} {component}",
            {q: stencil.combine(getattr(base, q), [getattr(s, q) for s in ends]) for q in of},
        )


def _step(machine: CompiledMachine, name: str) -> float:
    return float(POSE_STEP * (machine.length if name == "position" else 1.0))


def _moved(machine: CompiledMachine, call: Call, name: str, i: int, h: float) -> Call:
    if name == "position":
        return replace(call, position=np.asarray(call.position, dtype=float) + h * np.eye(3)[i])
    now = call.options.rotation
    given = machine.home_rotation if now is None else np.asarray(now, dtype=float)
    turn = np.array(rotation_about(np.eye(3)[i], h))
    return replace(call, options=replace(call.options, rotation=turn @ given))
