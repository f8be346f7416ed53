"""Absolute readings as measured minus commanded: coordinates in an instrument's frame, contacts, distances."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from stiffmap.common.errors import StiffmapError
from stiffmap.experiment.experiment import Experiment, Floats, Integers
from stiffmap.experiment.poses.handeye import Sighting, as_commanded, find_frames, unmoved
from stiffmap.experiment.readings import kinds
from stiffmap.experiment.setups import SEEN, setups_of, targets_of
from stiffmap.model.description import Point
from stiffmap.solve.machine import Machine


def resolved(machine: Machine, e: Experiment) -> tuple[Machine, Experiment]:
    """The experiment (`located` before) with every absolute reading against its command.

    Where a target's place on the tool is unknown and its orientation is not seen, the machine gets a named
    point there, so that the target moves as its place on the tool does.
    """
    if e.seen is not None or e.seen_rotation is not None:
        machine, e = _sighted(machine, e)
    reading = e.reading.copy()
    for kind in kinds():
        if not (kind.commanded and kind.name in e.absolute):
            continue
        if kind.found:
            found = kind.found(e, e.absolute[kind.name])
            e = replace(e, registration=(*e.registration, *found))
            places, (target, names) = {name: p for name, _, p in found}, targets_of(e)
            tools = [p for n in names if (p := places.get(f"target {n}")) is not None]
            if tools:
                machine, e = _on_points(machine, e, np.array(tools), target)
        reading[:, e.channels.index(kind.channel)] = e.absolute[kind.name] - kind.commanded(e)
    return machine, replace(e, reading=reading, absolute={})


def _sighted(machine: Machine, e: Experiment) -> tuple[Machine, Experiment]:
    sighting, names = _sighting(machine, e)
    if e.frame == "known":
        frames = unmoved(sighting)
    else:
        _enough(e, sighting)
        frames = find_frames(sighting)
    shift, turn = as_commanded(sighting, frames)
    reading = e.reading.copy()
    if e.seen is not None:
        reading[:, :3] = shift
    if e.seen_rotation is not None:
        reading[:, 3:6] = turn
    found = [(f"instrument {n}", frames.base_r[i], frames.base_p[i]) for i, n in enumerate(names[0])]
    found += [(f"target {n}", frames.tool_r[i], frames.tool_p[i]) for i, n in enumerate(names[1])]
    e = replace(e, reading=reading, seen=None, seen_rotation=None, registration=tuple(found))
    bare = sighting.placed & ~sighting.turned
    if not (bare.any() and sighting.tool_unknown):
        return machine, e
    if sighting.turned.any():
        raise StiffmapError(
            f"{e.name}: orientations are seen in some rows only; give them in all rows or in none "
            f"(row {e.ids[int(np.flatnonzero(bare)[0])]} has none)"
        )
    return _on_points(machine, e, frames.tool_p, sighting.target)


def _sighting(machine: Machine, e: Experiment) -> tuple[Sighting, tuple[list[str], list[str]]]:
    n = len(e)
    where, places = setups_of(e)
    which, targets = targets_of(e)
    home = machine.description.home.r
    return Sighting(
        e.position,
        np.tile(home, (n, 1, 1)) if e.rotation is None else e.rotation,
        np.full((n, 3), np.nan) if e.seen is None else e.seen,
        np.full((n, 3, 3), np.nan) if e.seen_rotation is None else e.seen_rotation,
        where,
        which,
        tool_unknown=e.tool != "known",
        turn_unknown=e.tool == "unknown",
    ), (places, targets)


def _enough(e: Experiment, s: Sighting) -> None:
    for k in range(int(s.setup.max()) + 1):
        here = s.setup == k
        places = int((here & s.placed).sum())
        if places and places < 3 and not (here & s.turned).any():
            raise StiffmapError(
                f"{e.name}: {places} positions are too few to find an instrument's frame (3 or more in each set-up)"
            )


def _on_points(machine: Machine, e: Experiment, at: Floats, target: Integers) -> tuple[Machine, Experiment]:
    """A named point on the tool for every target."""
    d = machine.description
    names = [f"{SEEN}{k + 1}" for k in range(len(at))]
    points = [Point(n, (float(x), float(y), float(z))) for n, (x, y, z) in zip(names, at, strict=True)]
    marked = Machine(replace(d, platform=(*d.platform, *points)))
    return marked, replace(e, points=tuple(f"platform.{names[k]}" for k in target))
