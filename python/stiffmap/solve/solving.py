"""From the arguments of `Machine.solve` to the compiled core and back; machines near a machine, solved through its elimination."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from stiffmap.common.broadcasting import (
    Floats,
    batch,
    instance_of,
    names_of,
    one_of,
    rows,
    thread_count,
    whole_number,
    wrench_array,
)
from stiffmap.common.errors import StiffmapError
from stiffmap.model.description.alike import alike
from stiffmap.solve.closing import Kinematics, close_actuators, close_poses, commanded
from stiffmap.solve.compiled import CompiledMachine
from stiffmap.solve.compiled.machine import LOAD_TYPES
from stiffmap.solve.options import SolveOptions
from stiffmap.solve.solution import Solution

METHODS = ("fast", "reference")


@dataclass(frozen=True, eq=False)
class Call:
    """Poses, a wrench, and how to solve them, as they were given."""

    position: ArrayLike
    wrench: ArrayLike | None = None
    options: SolveOptions = field(default_factory=SolveOptions)

    def only(self, chosen: NDArray[np.bool_]) -> Call:
        """The poses of a batch (...) that are `chosen` (...), as a list of poses."""

        def cut(values: ArrayLike, tail: int) -> Floats:
            a = np.asarray(values, dtype=float)
            return np.broadcast_to(a, chosen.shape + a.shape[a.ndim - tail :])[chosen]

        o = self.options
        options = replace(
            o,
            rotation=None if o.rotation is None else cut(o.rotation, 2),
            wrenches={n: cut(w, 1) for n, w in o.wrenches.items()},
            start={n: cut(v, 0) for n, v in o.start.items()}
            if isinstance(o.start, Mapping)
            else None
            if o.start is None
            else cut(o.start, 1),
        )
        return Call(cut(self.position, 1), None if self.wrench is None else cut(self.wrench, 1), options)


def solve_call(
    machine: CompiledMachine, call: Call, variants: Sequence[CompiledMachine] = ()
) -> tuple[Solution, Floats]:
    """The answer, and the displacements (..., variants, 6) of machines with a parameter moved.

    These are NaN where the reference path was taken. StiffmapError for bad input.
    """
    o = call.options
    p, w, r, extra = _arrays(machine, call)
    if o.start is None:
        return _solve(machine, o, (p, w, r, extra), variants, None)
    unloaded = close_poses(machine, p, r, o.start, o.threads)
    shape = unloaded.status.shape
    p, r = np.broadcast_to(p, (*shape, 3)), np.broadcast_to(r, (*shape, 3, 3))
    return _solve(machine, o, (p, w, r, extra), variants, unloaded)


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


def solve_joints(machine: CompiledMachine, actuators: ArrayLike, call: Call) -> Solution:
    """The answer at actuator coordinates (..., actuators): see `Machine.solve_joints`."""
    o = call.options
    if o.rotation is not None:
        raise StiffmapError("rotation: expected none, since the actuators decide it, got one")
    unloaded = close_actuators(machine, actuators, o.start, o.threads)
    lost = np.isnan(unloaded.rotation).any((-2, -1), keepdims=True)
    r = np.where(lost, machine.home_rotation, unloaded.rotation)
    _, w, _, extra = _arrays(machine, replace(call, position=np.zeros(3)))
    return _solve(machine, o, (unloaded.position, w, r, extra), (), unloaded)[0]


def _solve(
    machine: CompiledMachine,
    o: SolveOptions,
    arrays: tuple[Floats, Floats, Floats, dict[str, Floats]],
    variants: Sequence[CompiledMachine],
    unloaded: Kinematics | None,
) -> tuple[Solution, Floats]:
    """At coordinates that are closed already where `unloaded` holds them."""
    p, w, r, extra = arrays
    shape = batch(p.shape[:-1], w.shape[:-1], r.shape[:-2], *(v.shape[:-1] for v in extra.values()))
    one_of(o.method, METHODS, "method")
    loaded = [o.point, *extra]
    types = load_types(o, loaded)
    read = reading_points(machine, o, loaded)
    instance_of(o.stiffness, bool | np.bool_, "stiffness", "True or False")
    steps = 0  # adaptive
    if not isinstance(o.load_steps, str) or o.load_steps != "auto":
        steps = whole_number(o.load_steps, "load_steps", 1, what="'auto' or a positive number")
    answer = machine.core.solve(
        machine.plan if o.method == "fast" else None,  # type: ignore[arg-type]  # None: reference path
        rows(p, shape, (3,)),
        rows(r, () if r.ndim == 2 else shape, (3, 3)),  # one for all
        _stacked([w, *extra.values()], shape),
        load_points=loaded,
        load_types=[LOAD_TYPES[t] for t in types],
        read_points=read,
        gravity=machine.gravity(o.gravity),
        load_steps=steps,
        threads=thread_count(o.threads),
        full=o.stiffness,
        variants=[v.plan for v in variants],
        closed=None
        if unloaded is None
        else rows(unloaded.coordinates, shape, unloaded.coordinates.shape[-1:]),
    )
    if unloaded is not None:
        flags = answer.flags  # also how sure the branch is
        flags |= rows(unloaded.flags, shape, ())  # type: ignore[arg-type]
    order = (0, *(read.index(n) for n in names_of(o.read_points, "read_points")))
    solution = Solution(answer, shape, machine.names, o.point, order, unloaded=unloaded)
    return solution, answer.variants.reshape((*shape, len(variants), 6) if variants else (0,))


def _stacked(wrenches: Sequence[Floats], shape: tuple[int, ...]) -> Floats:
    """(n or 1, loads, 6) of all load points."""
    if all(w.ndim == 1 for w in wrenches):
        return np.array([wrenches])
    if len(wrenches) == 1:
        return rows(wrenches[0], shape, (6,))[:, None]
    return np.stack([rows(w, shape, (6,)) for w in wrenches], axis=1)


def _arrays(machine: CompiledMachine, call: Call) -> tuple[Floats, Floats, Floats, dict[str, Floats]]:
    p, r = commanded(machine, call.position, call.options.rotation)
    w = wrench_array(call.wrench)
    given = instance_of(call.options.wrenches, Mapping, "wrenches", "a mapping point -> wrench")
    extra = {n: wrench_array(v, f"wrenches[{n!r}]") for n, v in given.items()}
    return p, w, r, extra


def load_types(options: SolveOptions, loaded: Sequence[str]) -> list[str]:
    """How the wrench at each loaded point follows its body; StiffmapError for an unknown word or point."""
    kinds = options.load_type
    instance_of(options.point, str, "point", "the name of a point")
    instance_of(kinds, (str, Mapping), "load_type", "a word, or a mapping point -> word")
    given = {options.point: kinds} if isinstance(kinds, str) else dict(kinds)
    for name, kind in given.items():
        one_of(kind, LOAD_TYPES, "load_type")
        if name not in loaded:
            raise StiffmapError(f"load_type: no wrench acts at {name!r}, only at {', '.join(loaded)}")
    return [given.get(name, "dead") for name in loaded]


def reading_points(machine: CompiledMachine, options: SolveOptions, loaded: Sequence[str]) -> list[str]:
    """Points to read, each once, that of the wrench first; StiffmapError for one that does not exist."""
    there, more = machine.names.points, names_of(options.read_points, "read_points")
    for name in (*loaded, *more):
        if name not in there:
            raise StiffmapError(f"point: expected one of {', '.join(there)}, got {name!r}")
    return list(dict.fromkeys((options.point, *more)))
