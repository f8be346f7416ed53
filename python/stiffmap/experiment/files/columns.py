"""Columns of data.csv as arrays in SI, each with its own refusals."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from stiffmap.common.errors import FileError
from stiffmap.experiment.channels import Channel
from stiffmap.experiment.experiment import ASKED, AXES, BRANCHES, WRENCH, Floats, Integers
from stiffmap.experiment.files.orientation import TURNED, TURNED2
from stiffmap.experiment.files.schema import ExperimentFile, NoiseModel
from stiffmap.experiment.files.table import Table
from stiffmap.experiment.files.units import Scales
from stiffmap.experiment.readings import kind_of, kinds

WORDS = ("id", "branch", "setup", "point", "load_point", "instrument", "target")
SEEN, SEEN_TURNED, SEEN_QUATERNION = ("px", "py", "pz"), ("prx", "pry", "prz"), ("pqx", "pqy", "pqz", "pqw")
POSE, POSE2 = ("x", "y", "z"), ("x2", "y2", "z2")
APPROACH = ("approach_x", "approach_y", "approach_z")
COUNTED = ("repeat", "order", "hours", "temperature")
PLAN = (*WORDS, *POSE, *TURNED, *POSE2, *TURNED2, *APPROACH, *WRENCH, *ASKED, *COUNTED)
"""Columns of a plan: all but readings."""


def read() -> tuple[str, ...]:
    """Columns of readings, measured minus commanded."""
    return (*AXES, *(k.name for k in kinds()))


def absolute() -> tuple[str, ...]:
    """Columns of readings in coordinates of their own."""
    return (*SEEN, *SEEN_TURNED, *SEEN_QUATERNION, *(k.absolute for k in kinds() if k.absolute))


def known() -> tuple[str, ...]:
    """All columns that have a meaning."""
    return (*PLAN, *read(), *(f"u_{a}" for a in read()), *absolute())


def block(table: Table, names: Sequence[str], *, blank: bool, missing: float = np.nan) -> Floats:
    """(n, names) numbers; a column that is not there is `missing`."""
    n = len(table)
    return np.column_stack(
        [table.numbers(c, blank=blank) if c in table else np.full(n, missing) for c in names]
    )


def position(table: Table, scales: Scales, commanded: bool) -> Floats:
    """(n, 3) m; NaN where actuator coordinates are commanded instead."""
    if commanded:
        twice = [c for c in (*POSE, *TURNED) if c in table]
        if twice:
            raise FileError(
                f"column '{twice[0]}': actuators are commanded (command:), so the pose follows from them",
                file=table.file,
                line=1,
            )
        return np.full((len(table), 3), np.nan)
    if scales.length < 1e-5 and not set(POSE) & set(scales.own):
        raise FileError(
            "units: with length: um the poses x, y, z would be in µm as well; write their unit, as in "
            "{length: mm, dx: um, dy: um, dz: um} (or x: um, if they are)",
            file=scales.file,
        )
    return np.asarray(scales.lengths(POSE) * np.column_stack([table.numbers(c) for c in POSE]))


def command(model: ExperimentFile, table: Table, scales: Scales) -> Floats | None:
    """(n, actuators) m, rad, in the order of the file."""
    if not model.command:
        return None
    return np.column_stack([scales.own[c] * table.numbers(c) for c in model.command])


def other_command(model: ExperimentFile, table: Table, scales: Scales) -> Floats | None:
    """(n, actuators) m, rad: the second command of a distance, in columns named as the first with a 2 behind."""
    wanted = [f"{c}2" for c in model.command]
    if not any(c in table for c in wanted):
        return None
    columns = [
        scales.own[c] * table.numbers(w, blank=True) for c, w in zip(model.command, wanted, strict=True)
    ]
    return np.column_stack(columns)


def seen(table: Table, scales: Scales) -> Floats | None:
    """(n, 3) m: coordinates of the target in the instrument's frame."""
    if not any(c in table for c in SEEN):
        return None
    out = scales.length * np.column_stack([table.numbers(c, blank=True) for c in SEEN])
    return np.where(np.asarray(np.isfinite(out).all(axis=1))[:, None], out, np.nan)


def seen_rotation(model: ExperimentFile, table: Table, scales: Scales) -> Floats | None:
    """(n, 3, 3) of the target in the instrument's frame, from three angles or a quaternion; NaN where blank."""
    names = next((g for g in (SEEN_TURNED, SEEN_QUATERNION) if any(c in table for c in g)), None)
    if names is None:
        return None
    values = np.column_stack([table.numbers(c, blank=True) for c in names])
    good = np.asarray(np.isfinite(values).all(axis=1))
    if names is SEEN_QUATERNION:
        filled = np.where(good[:, None], values, [0.0, 0.0, 0.0, 1.0])
        wrong = np.flatnonzero(np.abs(np.linalg.norm(filled, axis=1) - 1.0) > 1e-2)
        if wrong.size:
            raise FileError(
                "columns 'pqx' to 'pqw': expected a quaternion of length 1, x y z w",
                file=table.file,
                line=table.lines[int(wrong[0])],
            )
        turned = Rotation.from_quat(filled)
    else:
        filled = scales.angle(names[0]) * np.where(good[:, None], values, 0.0)
        word = model.target_orientation
        turned = Rotation.from_rotvec(filled) if word == "rotvec" else Rotation.from_euler(word, filled)
    return np.where(good[:, None, None], turned.as_matrix(), np.nan)


def gravities(model: ExperimentFile, table: Table) -> tuple[tuple[float, float, float] | None, Floats | None]:
    """Gravity of all rows, or (n, 3) where the file gives one for each set-up."""
    given = model.gravity
    if given is None or isinstance(given, list):
        return (None if given is None else (given[0], given[1], given[2])), None
    if "setup" not in table:
        raise FileError("gravity: a gravity for each set-up needs the column 'setup'", file=table.file)
    labels = table.text("setup")
    for row, label in zip(table.lines, labels, strict=True):
        if label not in given:
            raise FileError(
                f"gravity: no gravity for set-up '{label}'; given for {', '.join(given)}",
                file=table.file,
                line=row,
            )
    return None, np.array([given[label] for label in labels])


def labels(table: Table, name: str) -> tuple[str, ...]:
    """Words of a column, or nothing."""
    return tuple(table.text(name)) if name in table else ()


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
    out = scales.lengths(POSE2) * np.column_stack([table.numbers(c, blank=True) for c in POSE2])
    lost = np.isfinite(reading[:, at]).any(axis=1) & ~np.isfinite(out).all(axis=1)
    same = np.abs(out - scales.lengths(POSE) * block(table, POSE, blank=True)).max(axis=1) < 1e-9
    for wrong, why in ((lost, "has no second pose (x2, y2, z2)"), (same, "is between a pose and itself")):
        if wrong.any():
            line = table.lines[int(np.flatnonzero(wrong)[0])]
            raise FileError(f"column '{kind.name}': {kind.title} {why}", file=table.file, line=line)
    return np.asarray(out)


def approach(table: Table) -> Floats | None:
    """(n, 3) direction of the last travel; an empty cell is 0."""
    if not any(c in table for c in APPROACH):
        return None
    return np.nan_to_num(block(table, APPROACH, blank=True, missing=0.0))


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
    each = scales.motion(channels) * block(table, [f"u_{c.name}" for c in channels], blank=True)
    if np.any(each < 0):
        row = int(np.flatnonzero((each < 0).any(axis=1))[0])
        raise FileError("a standard deviation is negative", file=table.file, line=table.lines[row])
    return np.where(np.isfinite(each), each, common)


def ids(table: Table) -> tuple[str, ...]:
    """Names of the rows, each once."""
    if "id" not in table:
        return tuple(str(i + 1) for i in range(len(table)))
    seen: dict[str, int] = {}
    for name, line in zip(table.text("id"), table.lines, strict=True):
        if name in seen:
            raise FileError(
                f"column 'id': '{name}' occurs twice (first in line {seen[name]})", file=table.file, line=line
            )
        seen[name] = line
    return tuple(seen)


def whole(table: Table, column: str) -> Integers | None:
    """Whole numbers."""
    if column not in table:
        return None
    values = table.numbers(column)
    wrong = np.flatnonzero((values != np.round(values)) | (np.abs(values) > 2**53))
    if wrong.size:
        raise FileError(
            f"column '{column}': expected whole numbers", file=table.file, line=table.lines[wrong[0]]
        )
    return values.astype(np.intp)


def branch(table: Table) -> tuple[str, ...]:
    """``loading``, ``unloading`` or nothing."""
    if "branch" not in table:
        return ()
    cells = table.text("branch")
    for cell, line in zip(cells, table.lines, strict=True):
        if cell not in BRANCHES:
            raise FileError(
                f"column 'branch': expected loading or unloading; found '{cell}'", file=table.file, line=line
            )
    return tuple(cells)


def named(table: Table, column: str, common: str) -> tuple[str, ...]:
    """Named point of each row; an empty cell is the file's."""
    return tuple(cell or common for cell in table.text(column)) if column in table else ()
