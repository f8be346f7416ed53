"""From the arguments of `Machine.solve` to the compiled core and back."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from stiffmap.broadcasting import Floats, batch, rows, thread_count, trailing, wrench_array
from stiffmap.errors import StiffmapError
from stiffmap.rotations import check_rotations
from stiffmap.solution import Solution

if TYPE_CHECKING:
    from stiffmap.machine import Machine

LOAD_TYPES = {"dead": 0, "follower": 1, "semitangential": 2}
METHODS = ("fast", "reference")


@dataclass(frozen=True)
class Call:
    """Arguments of `Machine.solve`, as they were given."""

    position: ArrayLike
    wrench: ArrayLike | None = None
    rotation: ArrayLike | None = None
    point: str = "tcp"
    wrenches: Mapping[str, ArrayLike] | None = None
    load_type: str | Mapping[str, str] = "dead"
    read_points: Sequence[str] = ()
    gravity: ArrayLike | None = None
    method: str = "fast"
    load_steps: int | str = "auto"
    stiffness: bool = True
    threads: int | None = None

    def only(self, chosen: NDArray[np.bool_]) -> Call:
        """The poses of a batch (...) that are `chosen` (...), as a list of poses."""

        def cut(values: ArrayLike, tail: int) -> Floats:
            a = np.asarray(values, dtype=float)
            return np.broadcast_to(a, chosen.shape + a.shape[a.ndim - tail :])[chosen]

        return replace(
            self,
            position=cut(self.position, 1),
            wrench=None if self.wrench is None else cut(self.wrench, 1),
            rotation=None if self.rotation is None else cut(self.rotation, 2),
            wrenches={n: cut(w, 1) for n, w in (self.wrenches or {}).items()},
        )


def solve_call(machine: Machine, call: Call, variants: Sequence[Machine] = ()) -> tuple[Solution, Floats]:
    """The answer, and the displacements (..., variants, 6) of machines with a parameter moved.

    These are NaN where the reference path was taken. StiffmapError for bad input.
    """
    p, w, r, extra = _arrays(machine, call)
    shape = batch(p.shape[:-1], w.shape[:-1], r.shape[:-2], *(v.shape[:-1] for v in extra.values()))
    if call.method not in METHODS:
        raise StiffmapError(f"method: expected 'fast' or 'reference', got {call.method!r}")
    loaded = [call.point, *extra]
    types = load_types(call, loaded)
    read = reading_points(machine, call, loaded)
    answer = machine._core.solve(
        machine._plan if call.method == "fast" else None,  # type: ignore[arg-type]  # None: reference path
        rows(p, shape, (3,)),
        rows(r, shape, (3, 3)),
        np.stack([rows(v, shape, (6,)) for v in (w, *extra.values())], axis=1),
        loaded,
        [LOAD_TYPES[t] for t in types],
        read,
        gravity_vector(machine, call.gravity),
        step_count(call.load_steps),
        thread_count(call.threads),
        call.stiffness,
        [m._plan for m in variants],
    )
    order = (0, *(read.index(n) for n in call.read_points))
    solution = Solution(answer, shape, machine._names, call.point, order)
    return solution, answer.variants.reshape((*shape, len(variants), 6) if variants else (0,))


def _arrays(machine: Machine, call: Call) -> tuple[Floats, Floats, Floats, dict[str, Floats]]:
    p = trailing(call.position, (3,), "position", "positions (m)")
    w = wrench_array(call.wrench)
    r = machine._home_rotation
    if call.rotation is not None:
        r = trailing(call.rotation, (3, 3), "rotation", "rotation matrices")
        check_rotations(r)
    extra = {n: wrench_array(v, f"wrenches[{n!r}]") for n, v in (call.wrenches or {}).items()}
    return p, w, r, extra


def load_types(call: Call, loaded: Sequence[str]) -> list[str]:
    """How the wrench at each loaded point follows its body; StiffmapError for an unknown word or point."""
    given = {call.point: call.load_type} if isinstance(call.load_type, str) else dict(call.load_type)
    for name, kind in given.items():
        if kind not in LOAD_TYPES:
            raise StiffmapError(f"load_type: expected one of {', '.join(LOAD_TYPES)}, got {kind!r}")
        if name not in loaded:
            raise StiffmapError(f"load_type: no wrench acts at {name!r}, only at {', '.join(loaded)}")
    return [given.get(name, "dead") for name in loaded]


def reading_points(machine: Machine, call: Call, loaded: Sequence[str]) -> list[str]:
    """Points to read, each once, `call.point` first; StiffmapError for one that does not exist."""
    for name in (*loaded, *call.read_points):
        if name not in machine.points:
            raise StiffmapError(f"point: expected one of {', '.join(machine.points)}, got {name!r}")
    return list(dict.fromkeys((call.point, *call.read_points)))


def gravity_vector(machine: Machine, gravity: ArrayLike | None) -> Floats:
    """(3,) m/s², base axes; the machine file's where the call says nothing."""
    if gravity is None:
        return np.array(machine.description.gravity or (0.0, 0.0, 0.0))
    g = np.asarray(gravity, dtype=float)
    if g.shape != (3,) or not np.isfinite(g).all():
        raise StiffmapError(f"gravity: expected 3 finite numbers (m/s², base axes), got {gravity!r}")
    return g


def step_count(load_steps: int | str) -> int:
    """Number of equal load steps; 0: adaptive."""
    if load_steps == "auto":
        return 0
    if isinstance(load_steps, bool) or not isinstance(load_steps, int) or load_steps < 1:
        raise StiffmapError(f"load_steps: expected 'auto' or a positive number, got {load_steps!r}")
    return load_steps
