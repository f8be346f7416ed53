"""Machines near a machine, solved through its elimination."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from stiffmap.common.broadcasting import Floats
from stiffmap.model.description.alike import alike
from stiffmap.solve.compiled import CompiledMachine
from stiffmap.solve.solution import Solution
from stiffmap.solve.solving import Call, solve_call


def solve_varied(
    machine: CompiledMachine, call: Call, variants: Sequence[CompiledMachine]
) -> tuple[Solution, Floats]:
    """The answer, and the displacements (..., variants, 6) of machines with a parameter moved a little.

    One step through the factors of the answer, exact to second order in the move (docs/fast_path.md F10). Poses of
    the reference path, variants under another gravity, and under gravity those to which one step does not lead
    (`alike`) are solved in full. NaN where a pose failed.
    """
    solution, varied = solve_call(machine, call, variants)
    return solution, fill_holes(machine, call, variants, solution, varied)


def fill_holes(
    machine: CompiledMachine,
    call: Call,
    variants: Sequence[CompiledMachine],
    solution: Solution,
    varied: Floats,
) -> Floats:
    """The same displacements, those that one step does not give solved in full."""
    gravity = machine.description.gravity
    heavy = bool(machine.gravity(call.options.gravity).any())
    heavier = [
        (call.options.gravity is None and m.description.gravity != gravity)
        or (heavy and not alike(machine.description, m.description, heavy=True))
        for m in variants
    ]
    if not any(heavier) and not np.isnan(varied.sum()):  # nothing is missing
        return varied
    for i, (m, other) in enumerate(zip(variants, heavier, strict=True)):
        hole = solution.ok & (other | np.isnan(varied[..., i, :]).any(axis=-1))
        if hole.any():
            part = call.only(hole)
            part = replace(part, options=replace(part.options, stiffness=False))
            varied[hole, i] = solve_call(m, part)[0].displacement
    return varied
