"""Machines near a machine, solved through its elimination."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from stiffmap.broadcasting import Floats
from stiffmap.solution import Solution
from stiffmap.solving import Call, solve_call

if TYPE_CHECKING:
    from stiffmap.machine import Machine


def solve_varied(machine: Machine, call: Call, variants: Sequence[Machine]) -> tuple[Solution, Floats]:
    """The answer, and the displacements (..., variants, 6) of machines with a parameter moved a little.

    One step through the factors of the answer, exact to second order in the move (docs/fast_path.md F10);
    poses of the reference path are solved in full. NaN where a pose failed.
    """
    solution, varied = solve_call(machine, call, variants)
    hole = solution.ok & np.isnan(varied).any(axis=(-2, -1))
    if hole.any():
        rest = replace(call.only(hole), stiffness=False)
        varied[hole] = np.stack([solve_call(m, rest)[0].displacement for m in variants], axis=-2)
    return solution, varied
