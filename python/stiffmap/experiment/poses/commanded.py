"""Where the machine is commanded in each row, and absolute readings (coordinates in an instrument's frame, contacts, distances)
against that."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from stiffmap.common.broadcasting import Mask
from stiffmap.common.errors import StiffmapError
from stiffmap.experiment.experiment import Experiment, Floats, Integers
from stiffmap.experiment.poses.handeye import Sighting, as_commanded, find_frames, unmoved
from stiffmap.experiment.readings import kinds
from stiffmap.experiment.setups import SEEN, setups_of, targets_of
from stiffmap.model.description import Point
from stiffmap.solve.kinematics import forward_kinematics
from stiffmap.solve.machine import Machine

AS_HOME = 1e-9
NAMED = 5
"""Rows that a sentence names."""
OUT_OF_REACH = "out of reach, or units are wrong"


def located(machine: Machine, experiment: Experiment) -> Experiment:
    """The experiment with its orientations in base axes, and with the configurations and poses that its
    commanded coordinates stand for, by the declared machine's kinematics.

    Rows without one are left out and named in `out_of_reach`. Raises StiffmapError where the coordinates
    are not those of the machine's actuators, or no row has a pose.
    """
    if experiment.command is None or experiment.joints is not None:
        return against_base(experiment, machine.description.home.r)
    given = [c.joint for c in experiment.command_of]
    if sorted(given) != sorted(machine.actuators):
        raise StiffmapError(
            f"{experiment.name}: command: expected all actuators of {machine.name} "
            f"({', '.join(machine.actuators)}), got {', '.join(given)}"
        )
    order = [given.index(a) for a in machine.actuators]
    found = forward_kinematics(machine, experiment.command[:, order])
    names = machine.compiled.names
    index = list(names.joints.values())
    home = np.nanmax(np.abs(found.rotation - machine.description.home.r), initial=0.0) < AS_HOME
    out = replace(
        experiment,
        position=found.position,
        rotation=None if home else found.rotation,
        rotation_against="base",
        joints=found.coordinates[:, index],
        joint_names=tuple(names.joints),
    )
    failed: Mask = np.asarray(~np.isfinite(found.position).all(axis=1))
    if experiment.other_command is not None:
        there = forward_kinematics(machine, experiment.other_command[:, order])
        alike = np.allclose(np.nan_to_num(there.rotation), np.nan_to_num(found.rotation[:1]), atol=AS_HOME)
        turned = out.rotation is not None or not alike
        out = replace(
            out,
            other=there.position,
            rotation=found.rotation if turned else None,
            other_rotation=there.rotation if turned else None,
            other_joints=there.coordinates[:, index],
        )
        wanted = np.asarray(np.isfinite(experiment.other_command).all(axis=1))
        failed |= wanted & ~np.asarray(np.isfinite(there.position).all(axis=1))
    return without(out, failed, "the machine has no pose at the commanded coordinates of")


def against_base(experiment: Experiment, home: Floats) -> Experiment:
    """The experiment with its orientations as those of the TCP; `home` (3, 3) is that at home."""
    if experiment.rotation is None or experiment.rotation_against == "base":
        return replace(experiment, rotation_against="base")
    second = experiment.other_rotation
    return replace(
        experiment,
        rotation=experiment.rotation @ home,
        other_rotation=None if second is None else second @ home,
        rotation_against="base",
    )


def without(experiment: Experiment, failed: Mask, why: str, cause: str = OUT_OF_REACH) -> Experiment:
    """The experiment without the rows `failed` (n,), which it then names; StiffmapError if none is left."""
    if not failed.any():
        return experiment
    text = rows_in_words(experiment, failed, why, cause)
    if failed.all():
        raise StiffmapError(f"{experiment.name}: {text}")
    return replace(experiment.rows(~failed), out_of_reach=(*experiment.out_of_reach, text))


def rows_in_words(experiment: Experiment, failed: Mask, why: str, cause: str = OUT_OF_REACH) -> str:
    """How many rows `failed` (n,) and why, the names of some, where the first one is, and the cause."""
    at = np.flatnonzero(failed)
    rows = ", ".join(experiment.ids[i] for i in at[:NAMED]) + (" ..." if at.size > NAMED else "")
    where = experiment.position[at[0]]
    if np.isfinite(where).all():
        rows += f"; first at ({', '.join(f'{1e3 * v:.1f}' for v in where)}) mm"
    return f"{why} {at.size} row{'s' if at.size > 1 else ''} (id {rows}): {cause}"


def resolved(machine: Machine, e: Experiment, stands: Experiment | None = None) -> tuple[Machine, Experiment]:
    """The experiment (`located` before) with every absolute reading against its command; `stands`: the same rows where the machine stands
    when it was commanded there, if that is known, since frames are those of places and no straight line leads to them.

    Where a target's place on the tool is unknown and its orientation is not seen, the machine gets a named
    point there, so that the target moves as its place on the tool does.
    """
    if e.seen is not None or e.seen_rotation is not None:
        machine, e = _sighted(machine, e, stands or e)
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


def _sighted(machine: Machine, e: Experiment, stands: Experiment) -> tuple[Machine, Experiment]:
    n, home = len(e), machine.description.home.r
    (setup, setups), (target, targets) = setups_of(e), targets_of(e)
    sighting = Sighting(
        e.position,
        np.tile(home, (n, 1, 1)) if e.rotation is None else e.rotation,
        np.full((n, 3), np.nan) if e.seen is None else e.seen,
        np.full((n, 3, 3), np.nan) if e.seen_rotation is None else e.seen_rotation,
        setup,
        target,
        tool_unknown=e.tool != "known",
        turn_unknown=e.tool == "unknown",
    )
    if e.frame == "known":
        frames = unmoved(sighting)
    else:
        _enough(e, sighting)
        turned = sighting.r if stands.rotation is None else stands.rotation
        frames = find_frames(replace(sighting, p=stands.position, r=turned))
    shift, turn = as_commanded(sighting, frames)
    reading = e.reading.copy()
    if e.seen is not None:
        reading[:, :3] = shift
    if e.seen_rotation is not None:
        reading[:, 3:6] = turn
    found = [(f"instrument {k}", frames.base_r[i], frames.base_p[i]) for i, k in enumerate(setups)]
    found += [(f"target {k}", frames.tool_r[i], frames.tool_p[i]) for i, k in enumerate(targets)]
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
