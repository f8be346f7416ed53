"""Commanded orientations of data.csv: rotation vector, quaternion, Euler angles or matrix.

They are rotations *against home* in base axes: a row without them stands as at home, and the commanded
orientation is R = turn · R_home. A file that gives orientations of the tool itself says
``orientation: {against: base}``. Only the machine knows its home, so `against_base` comes later.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from stiffmap.experiment.experiment import Floats, Mask
from stiffmap.experiment.files.fields import FORMS, MATRIX, QUATERNION, TURNED, TURNED2, VECTOR
from stiffmap.experiment.files.schema import OrientationModel
from stiffmap.experiment.files.table import Table
from stiffmap.experiment.files.units import Scales

UNIT_LENGTH, ORTHONORMAL = 1e-3, 1e-4
"""How far a quaternion's length, or a matrix from a rotation, may be off: printed digits, no more."""


def rotations(
    table: Table, scales: Scales, model: OrientationModel | None = None
) -> tuple[Floats | None, Floats | None]:
    """Orientations (n, 3, 3) of a row and of its second pose, against what `model` says; the second is
    as the first where the file does not say. Raises `FileError` naming column and row."""
    given = model or OrientationModel()
    first, second = (_orientation(table, scales, given, second) for second in (False, True))
    if second is not None and first is None:
        first = np.tile(np.eye(3), (len(table), 1, 1))
    return first, first if second is None else second


def _orientation(table: Table, scales: Scales, model: OrientationModel, second: bool) -> Floats | None:
    names = dict(zip(TURNED, TURNED2 if second else TURNED, strict=True))
    forms = [f for f in FORMS if table.one_of(names[c] for c in f)]
    if not forms:
        return None
    if len(forms) > 1:
        one, two = names[forms[0][0]], table.one_of(names[c] for c in forms[1])
        table.fail(f"column '{two}': orientations are given twice, as {one} … and as {two} …; keep one")
    form = forms[0]
    # a turn about one axis may leave out the others
    cells = table.block([names[c] for c in form], blank=second, missing=0.0 if form is VECTOR else None)
    empty: Mask = np.asarray(~np.isfinite(cells).all(axis=1))
    if form in (QUATERNION, MATRIX):
        out = (_quaternions if form is QUATERNION else _matrices)(table, cells, empty)
        out[empty] = np.eye(3)
        return np.ascontiguousarray(out)
    angles = scales.angle(names[form[0]]) * np.nan_to_num(cells)
    if form is VECTOR:
        turned = Rotation.from_rotvec(angles)
    else:
        angles[empty] = 0.0
        turned = Rotation.from_euler(_sequence(table, model, names[form[0]]), angles)
    return np.ascontiguousarray(turned.as_matrix())


def _sequence(table: Table, model: OrientationModel, column: str) -> str:
    if model.euler is None:
        table.fail(
            f"column '{column}': Euler angles need their convention: orientation: {{euler: XYZ}} for turns "
            "about x, the turned y, the twice turned z; {euler: xyz} for turns about fixed axes"
        )
    return model.euler


def _quaternions(table: Table, cells: Floats, empty: Mask) -> Floats:
    length = np.linalg.norm(cells, axis=1)
    table.check(
        empty | (np.abs(length - 1.0) < UNIT_LENGTH),
        lambda i: f"column 'qw': expected a quaternion of length 1, found {length[i]:.6g}",
    )
    cells = np.where(empty[:, None], [1.0, 0.0, 0.0, 0.0], cells)
    return np.asarray(Rotation.from_quat(cells[:, [1, 2, 3, 0]]).as_matrix())


def _matrices(table: Table, cells: Floats, empty: Mask) -> Floats:
    r = np.where(empty[:, None], np.eye(3).reshape(-1), cells).reshape(-1, 3, 3)
    off = np.abs(r @ r.transpose(0, 2, 1) - np.eye(3)).max(axis=(1, 2))
    table.check(
        (off <= ORTHONORMAL) & (np.linalg.det(r) >= 0.0),
        lambda i: (
            f"column 'r11': expected a rotation matrix, found one that is off by {off[i]:.2g} "
            f"(determinant {np.linalg.det(r[i]):.3g})"
        ),
    )
    return np.asarray(Rotation.from_matrix(r).as_matrix())
