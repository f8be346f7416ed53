"""Columns of data.csv as arrays in SI, each with its own refusals."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from stiffmap.common.errors import FileError
from stiffmap.experiment.channels import Channel
from stiffmap.experiment.experiment import BRANCHES, Floats, Integers
from stiffmap.experiment.files.fields import (
    APPROACH,
    POSE,
    POSE2,
    SEEN,
    SEEN_QUATERNION,
    SEEN_TURNED,
    TURNED,
)
from stiffmap.experiment.files.schema import ExperimentFile, NoiseModel
from stiffmap.experiment.files.table import Table
from stiffmap.experiment.files.units import Scales
from stiffmap.experiment.readings import kind_of


def position(table: Table, scales: Scales, commanded: bool) -> Floats:
    """(n, 3) m; NaN where actuator coordinates are commanded instead."""
    if commanded:
        twice = table.one_of((*POSE, *TURNED))
        if twice:
            table.fail(f"column '{twice}': actuators are commanded (command:), so the pose follows from them")
        return np.full((len(table), 3), np.nan)
    if scales.length < 1e-5 and not set(POSE) & set(scales.own):
        raise FileError(
            "units: with length: um the poses x, y, z would be in µm as well; write their unit, as in "
            "{length: mm, dx: um, dy: um, dz: um} (or x: um, if they are)",
            file=scales.file,
        )
    return np.asarray(scales.lengths(POSE) * table.block(POSE, blank=False, missing=None))


def command(model: ExperimentFile, table: Table, scales: Scales, behind: str = "") -> Floats | None:
    """(n, actuators) m, rad, in the order of the file; None where nothing is commanded.

    `behind` the names of its columns: ``2`` for the second command of a distance, of which cells may be empty.
    """
    names = [f"{c}{behind}" for c in model.command]
    if not names or (behind and not table.one_of(names)):
        return None
    return np.asarray([scales.own[c] for c in names] * table.block(names, blank=bool(behind), missing=None))


def seen(table: Table, scales: Scales) -> Floats | None:
    """(n, 3) m: coordinates of the target in the instrument's frame."""
    if not table.one_of(SEEN):
        return None
    out = scales.length * table.block(SEEN, blank=True, missing=None)
    return np.where(np.asarray(np.isfinite(out).all(axis=1))[:, None], out, np.nan)


def seen_rotation(model: ExperimentFile, table: Table, scales: Scales) -> Floats | None:
    """(n, 3, 3) of the target in the instrument's frame, from three angles or a quaternion; NaN where blank."""
    names = next((g for g in (SEEN_TURNED, SEEN_QUATERNION) if table.one_of(g)), None)
    if names is None:
        return None
    values = table.block(names, blank=True, missing=None)
    good = np.asarray(np.isfinite(values).all(axis=1))[:, None]
    if names is SEEN_QUATERNION:
        filled = np.where(good, values, [0.0, 0.0, 0.0, 1.0])
        unit = np.abs(np.linalg.norm(filled, axis=1) - 1.0) <= 1e-2
        table.check(unit, lambda _: "columns 'pqx' to 'pqw': expected a quaternion of length 1, x y z w")
        turned = Rotation.from_quat(filled)
    else:
        filled = scales.angle(names[0]) * np.where(good, values, 0.0)
        word = model.target_orientation
        turned = Rotation.from_rotvec(filled) if word == "rotvec" else Rotation.from_euler(word, filled)
    return np.where(good[:, :, None], turned.as_matrix(), np.nan)


def gravities(model: ExperimentFile, table: Table) -> tuple[tuple[float, float, float] | None, Floats | None]:
    """Gravity of all rows, or (n, 3) where the file gives one for each set-up."""
    given = model.gravity
    if given is None or isinstance(given, list):
        return (None if given is None else (given[0], given[1], given[2])), None
    if "setup" not in table:
        raise FileError("gravity: a gravity for each set-up needs the column 'setup'", file=table.file)
    labels = table.text("setup")
    table.check(
        [label in given for label in labels],
        lambda i: f"gravity: no gravity for set-up '{labels[i]}'; given for {', '.join(given)}",
    )
    return None, np.array([given[label] for label in labels])


def other(
    model: ExperimentFile, table: Table, scales: Scales, reading: Floats, channels: tuple[Channel, ...]
) -> Floats | None:
    """(n, 3) m, second pose of the rows that read a distance."""
    at = [i for i, c in enumerate(channels) if (kind := kind_of(c)) and kind.pair]
    if not at:
        return None
    kind = kind_of(channels[at[0]])
    assert kind is not None
    if model.command:
        if not all(f"{c}2" in table for c in model.command):
            raise FileError(
                f"column '{kind.name}' or '{kind.absolute}': actuators are commanded, so the second pose needs the columns "
                + ", ".join(f"{c}2" for c in model.command),
                file=table.file,
            )
        return np.full((len(table), 3), np.nan)
    out = np.asarray(scales.lengths(POSE2) * table.block(POSE2, blank=True, missing=None))
    read = np.isfinite(reading[:, at]).any(axis=1)
    same = np.abs(out - scales.lengths(POSE) * table.block(POSE, blank=True)).max(axis=1) < 1e-9
    told = f"column '{kind.name}': {kind.title}"
    table.check(~read | np.isfinite(out).all(axis=1), lambda _: f"{told} has no second pose (x2, y2, z2)")
    table.check(~same, lambda _: f"{told} is between a pose and itself")
    return out


def approach(table: Table) -> Floats | None:
    """(n, 3) direction of the last travel; an empty cell is 0."""
    if not table.one_of(APPROACH):
        return None
    return np.nan_to_num(table.block(APPROACH, blank=True, missing=0.0))


def declared(noise: NoiseModel, scales: Scales, channels: Sequence[Channel]) -> Floats:
    """(c,) declared standard deviations; NaN where none is."""
    values = [getattr(noise, c.name, None) for c in channels]
    return np.asarray(scales.motion(tuple(channels)) * np.array([np.nan if v is None else v for v in values]))


def sigma(model: ExperimentFile, table: Table, scales: Scales, channels: tuple[Channel, ...]) -> Floats:
    """(n, c) standard deviation of each reading: its own column, else that of the file."""
    common = declared(model.noise, scales, channels)
    for i, c in enumerate(channels):
        own = model.joints[c.name].noise if c.joint else None
        common[i] = common[i] if own is None else scales.own[c.name] * own
    each = scales.motion(channels) * table.block([f"u_{c.name}" for c in channels], blank=True)
    table.check(~(each < 0).any(axis=1), lambda _: "a standard deviation is negative")
    return np.where(np.isfinite(each), each, common)


def ids(table: Table) -> tuple[str, ...]:
    """Names of the rows, each once."""
    if "id" not in table:
        return tuple(str(i + 1) for i in range(len(table)))
    names = table.text("id")
    first = {name: i for i, name in reversed(list(enumerate(names)))}
    table.check(
        [first[name] == i for i, name in enumerate(names)],
        lambda i: f"column 'id': '{names[i]}' occurs twice (first in line {table.lines[first[names[i]]]})",
    )
    return tuple(names)


def whole(table: Table, column: str) -> Integers | None:
    """Whole numbers."""
    if column not in table:
        return None
    values = table.numbers(column)
    good = (values == np.round(values)) & (np.abs(values) <= 2**53)
    table.check(good, lambda _: f"column '{column}': expected whole numbers")
    return values.astype(np.intp)


def words(table: Table, column: str, empty: str = "") -> tuple[str, ...]:
    """Words of a column, `empty` where a cell is; nothing where there is no column."""
    return tuple(cell or empty for cell in table.text(column)) if column in table else ()


def branch(table: Table) -> tuple[str, ...]:
    """``loading``, ``unloading`` or nothing."""
    cells = words(table, "branch")
    table.check(
        [cell in BRANCHES for cell in cells],
        lambda i: f"column 'branch': expected loading or unloading; found '{cells[i]}'",
    )
    return cells
