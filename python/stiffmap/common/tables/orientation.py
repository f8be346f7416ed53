"""Orientations as controllers, instruments and programs write them: three angles, a rotation vector, a quaternion or a matrix."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from stiffmap.common.broadcasting import Floats, Integers
from stiffmap.common.tables.header import IN_SI, with_unit
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
MATRICES = (
    *([rf"(r|rot(ation)?|m)[ _.]?{i + k}[ _,]?{j + k}" for i in range(3) for j in range(3)] for k in (1, 0)),
    [f"{column}{row}" for row in "xyz" for column in "noa"],
)
"""Names of the entries of a matrix, row by row: r11 … r33, from 0, or its columns n, o, a."""
HOMOGENEOUS = [
    [f"{i + k}{j + k}" if pairs else str(4 * i + j + k) for i in range(rows) for j in range(4)]
    for rows in (4, 3)
    for k in (0, 1)
    for pairs in (True, False)
]
"""Numbers in the names of the entries of a homogeneous matrix, row by row."""
ROUNDED = 0.01
"""By how much digits of a table may change the length of a quaternion, or an entry of a matrix."""

HALF_A_TURN = 180.1
"""deg, with what digits of a table may add."""


class Orientation(NamedTuple):
    """Columns of a table that are an orientation."""

    columns: list[int]
    """None where there is no orientation."""
    turns: str
    """How the angles turn, as scipy writes it, or `VECTOR`; nothing of a quaternion, w first, or of a matrix, row by row."""
    words: str

    def matrices(self, sheet: Table, usual: str = "") -> Floats:
        """(n, 3, 3) of quaternions, matrices, a vector or angles, in the `usual` unit, else degrees, where none is given nor known.
        FileError for an empty cell."""
        values = np.stack([sheet.numbers(i) for i in self.columns], axis=1)
        first = self.columns[0]
        sheet.check(~np.isnan(values).any(axis=1), lambda _: f"{sheet.header[first]} …: found an empty cell")
        if not self.turns:
            return matrices_of(values)
        usual = "rad" if IN_SI.fullmatch(sheet.names[first]) else usual or "deg"
        units = (unit_of(sheet.unit(i) or usual, "angle") for i in self.columns)
        return matrices_of(values * [u.size for u in units if u], self.turns)


def matrices_of(values: Floats, turns: str = "") -> Floats:
    """(n, 3, 3) of quaternions, w first, or matrices, row by row, or of what `turns` says, rad; the unit matrix where one is not finite."""
    from scipy.spatial.transform import Rotation

    good = np.isfinite(values).all(axis=1)
    out, v = np.tile(np.eye(3), (len(values), 1, 1)), values[good]
    if turns:
        turned = Rotation.from_rotvec(v) if turns == VECTOR else Rotation.from_euler(turns, v)
    else:
        four = v.shape[1] == 4
        turned = Rotation.from_quat(v[:, [1, 2, 3, 0]]) if four else Rotation.from_matrix(v.reshape(-1, 3, 3))
    out[good] = turned.as_matrix()
    return out


def no_vector(values: Floats) -> str:
    """Why numbers (n, 3), rad, are no rotation vectors: one is longer than half a turn, as angles about axes may be; else nothing."""
    longest = np.degrees(np.linalg.norm(np.nan_to_num(values), axis=1).max(initial=0.0))
    if longest <= HALF_A_TURN:
        return ""
    return (
        f"a rotation vector is at most 180 deg long, found {longest:.0f} deg; of turns about the fixed x, y, z say --map roll=, pitch=, "
        "yaw= of the columns, of those about z, the new y, the new x --map A=, B=, C="
    )


def off_unit(values: Floats) -> Floats:
    """(n,) how far quaternions or matrices are from length one or from a rotation; 0 where a number is not finite."""
    if values.shape[1] == 4:
        return np.asarray(np.nan_to_num(np.abs(np.linalg.norm(values, axis=1) - 1.0)))
    r = values.reshape(-1, 3, 3)
    off = np.abs(r @ r.transpose(0, 2, 1) - np.eye(3)).max(axis=(1, 2))
    return np.asarray(np.nan_to_num(np.where(np.linalg.det(r) < 0.0, 2.0, off)))


def orientation_of(sheet: Table, taken: Collection[int] = ()) -> Orientation:
    """An orientation whose columns are none of the `taken` ones."""
    forms = [Orientation(quaternion(sheet), "", "quaternions, w first")]
    forms += [Orientation(_all_of(sheet, MATRICES), "", "rotation matrices, row by row")]
    forms += [
        Orientation(homogeneous(sheet)[:3, :3].ravel().tolist(), "", "rotations of homogeneous matrices")
    ]
    forms += [Orientation(_angles(sheet, names), turns, words) for names, turns, words in TURNS]
    return next((f for f in forms if f.columns and not {*taken} & {*f.columns}), Orientation([], "", ""))


def homogeneous(sheet: Table) -> Integers:
    """Columns (3 or 4, 4) of the entries of a homogeneous matrix; (0, 4) where there is none.

    Its entries have one name and 12 or 16 numbers: T00 … T33, T(1,1) …, or O_T_EE_0 … O_T_EE_15, row by row or, as the last row of
    zeros shows, column by column.
    """
    entries: dict[str, dict[str, int]] = {}
    for i, name in enumerate(sheet.names):
        stem = re.match(r".*[^\W\d_]", name)
        if stem and (numbers := re.findall(r"\d+", name[stem.end() :])):
            entries.setdefault(stem[0], {}).setdefault("".join(numbers), i)
    for there in entries.values():
        order = next((o for o in HOMOGENEOUS if {*o} == {*there}), None)
        if order is None or not all(map(sheet.is_numeric, there.values())):
            continue
        at = np.array([there[n] for n in order])
        values = np.stack([sheet.numbers(i) for i in at.tolist()], axis=1)
        values, at = values[np.isfinite(values).all(axis=1)].reshape(-1, len(at) // 4, 4), at.reshape(-1, 4)
        ways = [(at, values), (at.T, values.transpose(0, 2, 1))]
        for columns, entry in ways[: 1 + (len(at) == 4)]:
            last = (entry[:, 3:] == (0.0, 0.0, 0.0, 1.0)).all()
            if len(entry) and last and off_unit(entry[:, :3, :3].reshape(-1, 9)).max() < ROUNDED:
                return columns
    return np.zeros((0, 4), dtype=int)


def spread(table: Table) -> Table:
    """With x, y, z and r11 … r33 in place of the entries of a homogeneous matrix, where there is one."""
    entries = homogeneous(table)
    names = dict[int, str]()
    for i, (*turned, place) in enumerate(entries[:3].tolist()):
        names |= {place: with_unit("xyz"[i], table.unit(place))}
        names |= {column: f"r{i + 1}{j + 1}" for j, column in enumerate(turned)}
    kept = [i for i in range(len(table.header)) if i not in entries[3:]]
    header = tuple(names.get(i, table.header[i]) for i in kept)
    return replace(table, header=header, columns=tuple(table.columns[i] for i in kept))


def quaternion(sheet: Table) -> list[int]:
    """Columns w x y z of quaternions, by their names (Motive: Rotation W, ROS: pose.orientation.w) and length of one, or none."""
    # q1 is a joint next to Q0 to Q3
    numbered = ([f"(?-i:{q}{k + i})" for i in range(4)] for k in (1, 0) for q in "qQ")
    return _all_of(sheet, (WXYZ, *numbered, ("q0", *WXYZ[1:])))


def _all_of(sheet: Table, ways: Iterable[Sequence[str]]) -> list[int]:
    """Columns that have all names of one of the `ways`, and numbers of quaternions or rotation matrices; or none."""
    for names in ways:
        at = [i for i in map(sheet.find, names) if i is not None and sheet.is_numeric(i)]
        if len(at) == len(names):
            values = np.stack([sheet.numbers(i) for i in at], axis=1)
            if np.isfinite(values).all(axis=1).any() and off_unit(values).max() < ROUNDED:
                return at
    return []


def _angles(sheet: Table, names: str) -> list[int]:
    """Three columns of angles, or none."""
    at = [sheet.find(ANGLE.format(name)) for name in names.split()]
    columns = [i for i in at if i is not None and sheet.is_numeric(i)]
    gauges = any((u := sheet.unit(i)) and unit_of(u, "angle") is None for i in columns)
    return [] if gauges or len(columns) < 3 else columns
