"""Columns of data.csv as arrays in SI, each with its own refusals.

Commanded orientations are a rotation vector, quaternion, Euler angles or a matrix, *against home* in base axes: a row without them
stands as at home, and the commanded orientation is R = turn · R_home. A file that gives orientations of the tool itself says
``orientation: {against: base}``. Only the machine knows its home, so `against_base` comes later.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from stiffmap.common.errors import FileError
from stiffmap.common.tables.orientation import VECTOR, matrices_of, off_unit
from stiffmap.common.tables.table import Table
from stiffmap.experiment.channels import Channel
from stiffmap.experiment.experiment import BRANCHES, Floats, Integers
from stiffmap.experiment.files import fields
from stiffmap.experiment.files.schema import ExperimentFile, NoiseModel, OrientationModel
from stiffmap.experiment.files.table import Units
from stiffmap.experiment.readings import kind_of

UNIT = {fields.QUATERNION: (1e-3, "a quaternion of length 1"), fields.MATRIX: (1e-4, "a rotation matrix")}
"""How far a quaternion's length, or a matrix from a rotation, may be off: printed digits, no more."""


def position(table: Table, commanded: bool) -> Floats:
    """(n, 3) m; NaN where actuator coordinates are commanded instead."""
    if commanded:
        twice = table.one_of((*fields.POSE, *fields.TURNED))
        if twice:
            table.fail(f"column '{twice}': actuators are commanded (command:), so the pose follows from them")
        return np.full((len(table), 3), np.nan)
    return table.block(fields.POSE, blank=False, missing=None)


def command(model: ExperimentFile, table: Table, behind: str = "") -> Floats | None:
    """(n, actuators) m, rad, in the order of the file; None where nothing is commanded.

    `behind` the names of its columns: ``2`` for the second command of a distance, of which cells may be empty.
    """
    names = [f"{c}{behind}" for c in model.command]
    if not names or (behind and not table.one_of(names)):
        return None
    return table.block(names, blank=bool(behind), missing=None)


def seen(table: Table) -> Floats | None:
    """(n, 3) m: coordinates of the target in the instrument's frame."""
    if not table.one_of(fields.SEEN):
        return None
    out = table.block(fields.SEEN, blank=True, missing=None)
    return np.where(np.asarray(np.isfinite(out).all(axis=1))[:, None], out, np.nan)


def seen_rotation(model: ExperimentFile, table: Table) -> Floats | None:
    """(n, 3, 3) of the target in the instrument's frame, from three angles or a quaternion; NaN where blank."""
    names = next((g for g in (fields.SEEN_TURNED, fields.SEEN_QUATERNION) if table.one_of(g)), None)
    if names is None:
        return None
    turns = "" if names is fields.SEEN_QUATERNION else model.target_orientation
    values = table.block(names if turns else [*names[3:], *names[:3]], blank=True, missing=None)
    if not turns:
        unit = off_unit(values) <= 1e-2
        table.check(unit, lambda _: "columns 'pqx' to 'pqw': expected a quaternion of length 1, x y z w")
    good = np.asarray(np.isfinite(values).all(axis=1))[:, None, None]
    return np.where(good, matrices_of(values, turns), np.nan)


def rotations(table: Table, model: OrientationModel) -> tuple[Floats | None, Floats | None]:
    """Orientations (n, 3, 3) of a row and of its second pose, against what `model` says; the second is
    as the first where the file does not say. Raises `FileError` naming column and row."""
    first, second = (_orientation(table, model, second) for second in (False, True))
    if second is not None and first is None:
        first = np.tile(np.eye(3), (len(table), 1, 1))
    return first, first if second is None else second


def _orientation(table: Table, model: OrientationModel, second: bool) -> Floats | None:
    names = dict(zip(fields.TURNED, fields.TURNED2 if second else fields.TURNED, strict=True))
    forms = [f for f in fields.FORMS if table.one_of(names[c] for c in f)]
    if not forms:
        return None
    if len(forms) > 1:
        one, two = names[forms[0][0]], table.one_of(names[c] for c in forms[1])
        table.fail(f"column '{two}': orientations are given twice, as {one} … and as {two} …; keep one")
    form = forms[0]
    # a turn about one axis may leave out the others
    missing = 0.0 if form is fields.VECTOR else None
    cells = table.block([names[c] for c in form], blank=second, missing=missing)
    if form in UNIT:
        most, what = UNIT[form]
        off = off_unit(cells)
        table.check(off <= most, lambda i: f"column '{names[form[0]]}': expected {what}; off by {off[i]:.2g}")
        return matrices_of(cells)
    if form is fields.VECTOR:
        return matrices_of(np.nan_to_num(cells), VECTOR)
    if model.euler is None:
        table.fail(
            f"column '{names[form[0]]}': Euler angles need their convention: orientation: {{euler: XYZ}} for turns "
            "about x, the turned y, the twice turned z; {euler: xyz} for turns about fixed axes"
        )
    return matrices_of(cells, model.euler)


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
    model: ExperimentFile, table: Table, reading: Floats, channels: tuple[Channel, ...]
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
    out = table.block(fields.POSE2, blank=True, missing=None)
    read = np.isfinite(reading[:, at]).any(axis=1)
    same = np.abs(out - table.block(fields.POSE, blank=True)).max(axis=1) < 1e-9
    told = f"column '{kind.name}': {kind.title}"
    table.check(~read | np.isfinite(out).all(axis=1), lambda _: f"{told} has no second pose (x2, y2, z2)")
    table.check(~same, lambda _: f"{told} is between a pose and itself")
    return out


def approach(table: Table) -> Floats | None:
    """(n, 3) direction of the last travel; an empty cell is 0."""
    if not table.one_of(fields.APPROACH):
        return None
    return np.nan_to_num(table.block(fields.APPROACH, blank=True, missing=0.0))


def declared(noise: NoiseModel, units: Units, channels: Sequence[Channel]) -> Floats:
    """(c,) declared standard deviations; NaN where none is."""
    values = {c.name: getattr(noise, c.name, None) for c in channels}
    return np.array([np.nan if v is None else units.size(n, np.nan) * v for n, v in values.items()])


def sigma(model: ExperimentFile, table: Table, units: Units, channels: tuple[Channel, ...]) -> Floats:
    """(n, c) standard deviation of each reading: its own column, else that of the file."""
    common = declared(model.noise, units, channels)
    for i, c in enumerate(channels):
        own = model.joints[c.name].noise if c.joint else None
        common[i] = common[i] if own is None else units.own[c.name] * own
    each = table.block([f"u_{c.name}" for c in channels], blank=True)
    table.check(~(each < 0).any(axis=1), lambda _: "a standard deviation is negative")
    return np.where(np.isfinite(each), each, common)


def ids(table: Table) -> tuple[str, ...]:
    """Names of the rows, each once."""
    if "id" not in table:
        return tuple(str(i + 1) for i in range(len(table)))
    names, rows = table.text("id"), dict[str, int]()
    first = [rows.setdefault(name, i) for i, name in enumerate(names)]
    table.check(
        np.array(first) == np.arange(len(names)),
        lambda i: f"column 'id': '{names[i]}' occurs twice (first in line {table.lines[first[i]]})",
    )
    return tuple(names)


def whole(table: Table, column: str) -> Integers | None:
    """Whole numbers."""
    if column not in table:
        return None
    values = table.si(column)
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
