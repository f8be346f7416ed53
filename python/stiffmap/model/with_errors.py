"""A machine built with small errors: frames, lengths, zeros, compliances and masses moved at once.

The controller's machine stays as declared: errors go into the ``actual`` pose of offsets and into the
errors of commands, never into nominal geometry.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from stiffmap.model.description import (
    TASK,
    Body,
    CommandError,
    Element,
    Joint,
    MachineDescription,
    Offset,
    Pose,
    Spring,
)
from stiffmap.model.description.strokes import as_rows
from stiffmap.model.description.tree import Elements, edit_all, edit_named
from stiffmap.model.effects import apply_records
from stiffmap.model.effects.edit import built as as_built
from stiffmap.model.effects.library.geometry import about, home_position
from stiffmap.model.effects.library.links import longer

END = "end"
"""Name of the frame behind the last element of a leg, and of the tool."""
Knots = tuple[tuple[float, float], ...]
"""(coordinate, error) of a drive, m or rad, by rising coordinate."""
Moves = Mapping[tuple[str, str], float]
"""(full name of the element, what is moved) -> by how much, SI; compliances and masses relative."""


def edited(
    description: MachineDescription, moves: Moves, travel: Mapping[str, Knots] | None = None
) -> MachineDescription:
    """The machine built with these errors; effects that it has already are added again on top.

    ``travel`` holds axis positioning errors of drives, by full name.
    """
    bare = description.declared or description
    of: dict[str, dict[str, Any]] = {}
    for (name, what), value in moves.items():
        of.setdefault(name, {})[what] = of.get(name, {}).get(what, 0.0) + value
    for name, knots in (travel or {}).items():
        of.setdefault(name, {})["travel"] = knots
    changed = {name.partition(".")[0] for name in of}

    def built_of(elements: Elements, name: str) -> Elements:
        return edit_named(elements, name, partial(_sequence, of=of)) if name in changed else elements

    built = edit_all(bare, built_of)
    return apply_records(built, description.effects)


def _sequence(elements: Elements, path: str, of: Mapping[str, Mapping[str, object]]) -> Elements:
    out: list[Element] = []
    for e in elements:
        change = of.get(f"{path}.{e.name}", {})
        if isinstance(e, Joint) and any(k in change for k in TASK):
            frame = _pose(change)
            turned = about(home_position(e), frame.r)
            out.append(as_built(f"{e.name}_frame", Pose.of(turned.p + frame.p, frame.r)))
        out.append(_changed(e, change))
    last = of.get(f"{path}.{END}")
    if last is not None and path != "base" and "." not in path:
        out.append(as_built(f"{path}_{END}", _pose(last)))
    return tuple(out)


def _pose(change: Mapping[str, object]) -> Pose:
    t, r = (np.array([change.get(k, 0.0) for k in part]) for part in (TASK[:3], TASK[3:]))
    return Pose.of(t, Rotation.from_rotvec(r).as_matrix())


def _changed(e: Element, change: Mapping[str, object]) -> Element:
    for what, by in change.items():
        kinds, change_of = CHANGES.get(what, ((), None))
        if change_of is not None and isinstance(e, kinds):  # a body may have its joint's name
            e = change_of(e, by)
    return e


def _with_error(e: Joint, error: CommandError) -> Element:
    return replace(e, command_errors=(*e.command_errors, error))


def _compliance(e: Element, by: float) -> Element:
    """Times exp(by): a spring stays a spring whatever a fit tries."""
    factor = float(np.exp(by))
    if isinstance(e, Joint):
        assert e.law is not None
        return replace(e, law=replace(e.law, stiffness=e.law.stiffness / factor))
    assert isinstance(e, Spring)
    if e.compliance is not None:
        return replace(e, compliance=as_rows(np.array(e.compliance) * factor))
    return replace(e, stiffness=as_rows(np.array(e.stiffness) / factor))


def _mass(e: Body, by: float) -> Element:
    factor = float(np.exp(by))
    inertia = tuple(tuple(v * factor for v in row) for row in e.inertia)
    return replace(e, mass=e.mass * factor, inertia=inertia)  # type: ignore[arg-type]


CHANGES: dict[str, tuple[tuple[type, ...], Callable[[Any, Any], Element]]] = {
    "length": ((Offset,), longer),
    "zero": ((Joint,), lambda e, by: _with_error(e, CommandError(offset=by))),
    "gain": ((Joint,), lambda e, by: _with_error(e, CommandError(slope=by, reference=e.home[0]))),
    "travel": ((Joint,), lambda e, knots: _with_error(e, CommandError(knots=knots))),
    "sag": ((Joint,), lambda e, by: replace(e, sag=e.sag + by)),
    "compliance": ((Joint, Spring), _compliance),
    "mass": ((Body,), _mass),
}
