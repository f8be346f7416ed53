"""What the experiment leaves open and nobody wants to know: frames and zeros, linear columns."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from stiffmap.common.errors import StiffmapError
from stiffmap.experiment.experiment import Experiment, Floats
from stiffmap.experiment.readings import ReadingKind, kind_of
from stiffmap.experiment.setups import members, setups_of, standing, target_positions, targets_of

Kinds = Sequence[tuple[int, ReadingKind, Experiment]]
"""Channel, what it is, and the experiment where the machine stands."""


def nuisance_columns(experiment: Experiment, base: Floats) -> Floats:
    """(n, c, q) changes of the readings of a machine that shows `base` (n, c)."""
    kinds = [
        (i, kind, _standing(experiment, base, kind, i))
        for i, c in enumerate(experiment.channels)
        if (kind := kind_of(c))
    ]
    columns = [
        *_zeros(experiment),
        *_frames(experiment, base),
        *_tools(experiment, base, kinds),
        *_readings(experiment, kinds),
    ]
    return np.stack(columns, axis=-1) if columns else np.zeros((*experiment.reading.shape, 0))


def _zeros(experiment: Experiment) -> Iterator[Floats]:
    """An unknown zero per pose and channel."""
    if experiment.quantity == "deflection" and experiment.unloaded == "unknown":
        for here in members(experiment.groups):
            yield from _per_axis(here, experiment)


def _frames(experiment: Experiment, base: Floats) -> Iterator[Floats]:
    """The instrument's frame, one per set-up; distances and joints do not know it."""
    if experiment.frame == "known":
        return
    for here in members(setups_of(experiment)[0]):
        if experiment.quantity == "position":
            yield from _per_axis(here, experiment, 6)
        if experiment.frame == "unknown":
            yield from _turns(here, experiment, base)


def _turns(here: Floats, experiment: Experiment, base: Floats) -> Iterator[Floats]:
    position = experiment.quantity == "position"
    place = target_positions(experiment)
    at, turned = np.nan_to_num(base[:, :3]), np.nan_to_num(base[:, 3:6])
    for axis in np.eye(3):
        linear = np.cross(axis, place + at if position else at)
        angular = _of_rotation_vector(turned, axis) if position else np.cross(axis, turned)
        yield _wide(experiment, here[:, None] * np.hstack([linear, angular]))


def _of_rotation_vector(turned: Floats, turn: Floats) -> Floats:
    """(n, 3) change of the rotation vectors `turned` (n, 3), small, by a small further turn in base axes."""
    return np.asarray(turn - 0.5 * np.cross(turned, turn))


def _tools(experiment: Experiment, base: Floats, kinds: Kinds) -> Iterator[Floats]:
    """Where targets sit on the tool: off by a vector that turns with the tool, and turned if that is unknown."""
    if experiment.tool == "known":
        return
    turned = np.nan_to_num(base[:, 3:6])
    there, tools = Rotation.from_rotvec(turned), experiment.rotation
    for here in members(targets_of(experiment)[0]):
        for k in range(3):
            arm = np.tile(np.eye(3)[k], (len(turned), 1)) if tools is None else tools[:, :, k]
            held = there.apply(arm)
            linear = held if experiment.quantity == "position" else held - arm
            column = _wide(experiment, np.hstack([linear, np.zeros_like(linear)]))
            for i, kind, stands in kinds:
                if kind.tool_offset:
                    column[:, i] = kind.tool_offset(stands, arm if kind.pair else held, k)
            yield here[:, None] * column
            if experiment.tool == "unknown" and experiment.quantity == "position":
                angular = _of_rotation_vector(turned, held)
                yield here[:, None] * _wide(experiment, np.hstack([np.zeros_like(arm), angular]))


def _readings(experiment: Experiment, kinds: Kinds) -> Iterator[Floats]:
    """What nobody knows of a kind of reading, as the height of a surface."""
    for i, kind, stands in kinds:
        for change in kind.nuisance(stands) if kind.nuisance else ():
            column = np.zeros_like(experiment.reading)
            column[:, i] = change
            yield column


def _standing(e: Experiment, base: Floats, kind: ReadingKind, i: int) -> Experiment:
    """The experiment where a machine that shows `base` (n, c) stands; with what the absolute readings of channel i fit there, next to
    what was found at the commands."""
    if e.quantity != "position" or kind.pair:
        return e
    out = standing(e, base)
    if not (kind.found and kind.commanded and e.registration):
        return out
    with suppress(StiffmapError):  # too few rows
        again = kind.found(out, e.reading[:, i] + kind.commanded(e))
        out = replace(out, registration=(*e.registration, *again))
    return out


def _wide(experiment: Experiment, axes: Floats) -> Floats:
    """(n, c) with zero for what is not an axis."""
    return np.hstack([axes, np.zeros((len(experiment), len(experiment.extra)))])


def _per_axis(pattern: Floats, experiment: Experiment, most: int | None = None) -> Iterator[Floats]:
    for axis in np.flatnonzero(experiment.axis_read[:most]):
        column = np.zeros_like(experiment.reading)
        column[:, axis] = pattern
        yield column
