"""Orientations as controllers and instruments write them: three angles, a rotation vector or a quaternion."""

from __future__ import annotations

from collections.abc import Collection
from typing import NamedTuple

import numpy as np

from stiffmap.common.broadcasting import Floats
from stiffmap.common.tables.header import IN_SI
from stiffmap.common.tables.table import Table
from stiffmap.common.units import unit_of

ANGLE = r"(tcp|pos|ist|soll|nominal|cmd|orientation|ori|rot)?[ _.-]?{}"
VECTOR = "rotvec"
TURNS = (
    ("a b c", "ZYX", "turns about z, the new y, the new x (KUKA's A, B, C; degrees where no unit is given)"),
    ("w p r", "xyz", "turns about the fixed x, y, z (Fanuc's W, P, R; degrees where no unit is given)"),
    ("roll pitch yaw", "xyz", "turns about the fixed x, y, z (degrees where no unit is given)"),
    ("(rx|target_tcp_pose_3) (ry|target_tcp_pose_4) (rz|target_tcp_pose_5)", VECTOR, "a rotation vector (UR's RX, RY, RZ)"),
)  # fmt: skip
"""Names of three angles, how they turn, and that in words."""
WXYZ = tuple(rf"(.*[./ ])?(q|quat(ernion)?|rot(ation)?|orientation)[ _./]?{a}" for a in "wxyz")
ROUNDED = 0.01
"""By how much digits of a table may change the length of a quaternion."""


class Orientation(NamedTuple):
    """Columns of a table that are an orientation."""

    columns: list[int]
    """None where there is no orientation."""
    turns: str
    """How the angles turn, as scipy writes it, or `VECTOR`; nothing of a quaternion, w first."""
    words: str

    @property
    def is_vector(self) -> bool:
        """Whether it is a rotation vector."""
        return self.turns == VECTOR

    def matrices(self, sheet: Table) -> Floats:
        """(n, 3, 3) of quaternions, of a vector or of angles, degrees where no unit is given nor known. FileError for an empty cell."""
        from scipy.spatial.transform import Rotation

        values = np.stack([sheet.numbers(i) for i in self.columns], axis=1)
        first = sheet.header[self.columns[0]]
        sheet.check(~np.isnan(values).any(axis=1), lambda _: f"{first} …: found an empty cell")
        if not self.turns:
            return np.asarray(Rotation.from_quat(values[:, [1, 2, 3, 0]]).as_matrix())
        usual = "rad" if IN_SI.fullmatch(sheet.names[self.columns[0]]) else "deg"
        units = (unit_of(sheet.unit(i) or usual, "angle") for i in self.columns)
        sizes = [u.size for u in units if u]
        if self.is_vector:
            return np.asarray(Rotation.from_rotvec(sizes * values).as_matrix())
        return np.asarray(Rotation.from_euler(self.turns, sizes * values).as_matrix())


NONE = Orientation([], "", "")


def orientation_of(sheet: Table, taken: Collection[int] = ()) -> Orientation:
    """An orientation whose columns are none of the `taken` ones."""
    forms = [Orientation(quaternion(sheet), "", "quaternions, w first")]
    forms += [Orientation(_angles(sheet, names), turns, words) for names, turns, words in TURNS]
    return next((f for f in forms if f.columns and not {*taken} & {*f.columns}), NONE)


def quaternion(sheet: Table) -> list[int]:
    """Columns w x y z of quaternions, by their names (Motive: Rotation W, ROS: pose.orientation.w) and length of one, or none."""
    # q1 is a joint next to Q0 to Q3
    numbered = ([f"(?-i:{q}{k + i})" for i in range(4)] for k in (1, 0) for q in "qQ")
    for names in (WXYZ, *numbered, ("q0", *WXYZ[1:])):
        at = [i for i in map(sheet.find, names) if i is not None and sheet.is_numeric(i)]
        if len(at) == 4:
            size = np.linalg.norm([sheet.numbers(i) for i in at], axis=0)
            if np.nanmax(np.abs(size - 1.0), initial=0.0) < ROUNDED and not np.isnan(size).all():
                return at
    return []


def _angles(sheet: Table, names: str) -> list[int]:
    """Three columns of angles, or none."""
    at = [sheet.find(ANGLE.format(name)) for name in names.split()]
    columns = [i for i in at if i is not None and sheet.is_numeric(i)]
    gauges = any((u := sheet.unit(i)) and unit_of(u, "angle") is None for i in columns)
    return [] if gauges or len(columns) < 3 else columns
