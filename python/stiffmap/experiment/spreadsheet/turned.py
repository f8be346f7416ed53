"""An orientation next to a position: which columns are one, and how their numbers turn, as the commanded joints show it."""

from __future__ import annotations

import re
from collections.abc import Callable

import numpy as np
from scipy.spatial.transform import Rotation

from stiffmap.common.broadcasting import Floats
from stiffmap.common.short import first_of
from stiffmap.common.tables.orientation import (
    VECTOR as ROTATION_VECTOR,
    Orientation,
    homogeneous,
    matrices_of,
    no_vector,
    orientation_of,
)
from stiffmap.common.units import unit_of
from stiffmap.experiment.channels import AXES
from stiffmap.experiment.experiment import Integers
from stiffmap.experiment.files.fields import EULER, POSE, QUATERNION, SEEN, SEEN_TURNED, VECTOR
from stiffmap.experiment.poses.handeye import FEWEST, turns_apart
from stiffmap.experiment.spreadsheet.answers import Meant
from stiffmap.experiment.spreadsheet.guess import AXIS, MEASURED_AXIS, READINGS
from stiffmap.solve.kinematics import forward_kinematics
from stiffmap.solve.machine import Machine

TURNS = {
    ROTATION_VECTOR: "a rotation vector", "xyz": "turns about the fixed x, y, z", "XYZ": "turns about x, the new y, the new z",
    "zyx": "turns about the fixed z, y, x", "ZYX": "turns about z, the new y, the new x",
    "ZYZ": "turns about z, the new y, the new z", "zyz": "turns about the fixed z, y, z",
}  # fmt: skip
"""What three numbers of an orientation may be."""
OFF = 0.1
"""rad: a machine whose tool turns otherwise by more than this, in the median, is not the one that was read."""
CLEAR, LEAST = 3.0, 1e-4
"""How many times nearer to the machine another way of reading must be to be taken, and from how many rad on that counts."""
MOST = 300
"""Rows by which ways of reading are compared, at most."""


def positioned(m: Meant) -> None:
    """The position within homogeneous matrices is x y z, where nothing else is a position."""
    entries = homogeneous(m.sheet)
    if len(entries) and not {*POSE, *SEEN} & {c.meaning for c in m.guessed}:
        m.chosen |= {a: [m.sheet.header[i]] for a, i in zip(POSE, entries[:3, 3], strict=True)}


def oriented(m: Meant, machine: Callable[[], Machine]) -> None:
    """Angles, rotation vectors, quaternions and matrices next to X Y Z. `machine`: whose joints the sheet commands."""
    taken = {m.index(h) for v in m.chosen.values() for h in v}
    meanings = {c.meaning: c.index for c in m.guessed}
    found = orientation_of(m.sheet, taken)
    columns, turns = found.columns, found.turns
    behind = min(columns, default=0) == meanings.get("z", -1) + 1
    seen = set(SEEN) <= set(meanings) and not (behind and set(POSE) <= set(meanings))
    position = SEEN if seen else POSE
    if (
        not columns
        or (m.columns and not seen)
        or not set(position) <= {*meanings, *([] if turns else m.constants)}
    ):
        if columns and not turns:  # half angles are no readings
            m.chosen["note"] = [*m.chosen.get("note", ()), *(m.sheet.header[i] for i in columns)]
        return
    if turns == ROTATION_VECTOR:
        # a reading, unless it stands right behind the position and something else is read
        places = (re.fullmatch(MEASURED_AXIS, re.sub(AXIS, "*", n).lower()) for n in m.sheet.names)
        others = set(READINGS) & set(meanings) - set(AXES[3:]) or any(places)
        said = not seen and set(AXES[3:]) & set(m.noise)
        if said or not others or columns[0] != meanings[position[2]] + 1:
            return
    in_degrees = turns not in ("", ROTATION_VECTOR)  # as such names are where no unit is given
    values = _in_rad(m, found)
    if not m.columns and turns == ROTATION_VECTOR and values is not None and (wrong := no_vector(values)):
        m.sheet.fail(f"column '{m.sheet.header[columns[0]]}': {wrong}")
    shown = first_of([repr(m.sheet.header[i]) for i in columns], 4)
    if m.columns and values is not None:
        found = _as_the_joints_turn(m, found, values, shown, machine)
        columns, turns = found.columns, found.turns
    headers = [m.sheet.header[i] for i in columns]
    if seen and not set(AXES[3:]) <= set(m.noise):
        m.chosen["note"] = [*m.chosen.get("note", ()), *headers]
        m.said.append(f"{shown} are not used; as the orientation seen they need --noise rx=… ry=… rz=…")
        return
    if len(columns) > len(QUATERNION):
        turned = Rotation.from_matrix(found.matrices(m.sheet)).as_quat()[:, [3, 0, 1, 2]]
        headers = [f"{c} of {headers[0]} …" for c in QUATERNION]
        for name, parts in zip(headers, turned.T, strict=True):
            m.sheet = m.sheet.with_column(name, parts)
        columns = [m.sheet.header.index(name) for name in headers]
    of_pose = {"": QUATERNION, ROTATION_VECTOR: VECTOR}.get(turns, EULER)
    of_seen = SEEN_TURNED if turns else [f"p{c}" for c in QUATERNION]
    for i, header, meaning in zip(columns, headers, of_seen if seen else of_pose, strict=True):
        m.chosen[meaning] = [header]
        if in_degrees and not m.sheet.unit(i):
            m.units.setdefault(meaning, m.usual_unit("angle") or "deg")
    if seen:
        m.head |= {"target_orientation": turns} if turns else {}
    else:
        m.head["orientation"] = {"against": "base"} | ({"euler": turns} if of_pose is EULER else {})
    m.said.append(f"{shown} are the orientation: {found.words}")


def turns_behind(m: Meant, z: int | None) -> Floats | None:
    """(n, 3, 3) orientations that are commanded next to positions whose last column is `z`; None where there are none."""
    found = orientation_of(m.sheet)
    if z is None or min(found.columns, default=0) != z + 1:
        return None
    values = _in_rad(m, found)
    return None if values is None else matrices_of(values, found.turns)


def _in_rad(m: Meant, found: Orientation) -> Floats | None:
    """(n, columns) numbers of an orientation, angles in rad; None where their unit is asked for later."""
    values = np.column_stack([m.sheet.numbers(i) for i in found.columns])
    if not found.turns:
        return values
    usual = "" if found.turns == ROTATION_VECTOR else "deg"
    texts = (m.written_unit(i, c, quantity="angle") for i, c in zip(found.columns, SEEN_TURNED, strict=True))
    sizes = [u.size for text in texts if (u := unit_of(text or usual, "angle"))]
    return values * sizes if len(sizes) == len(found.columns) else None


def _as_the_joints_turn(
    m: Meant, found: Orientation, values: Floats, shown: str, machine: Callable[[], Machine]
) -> Orientation:
    """An orientation that was seen, read in the way in which it follows the commanded joints: as its names say, unless another is
    clearly nearer. Where none follows them, that is said."""
    columns = found.columns
    rows = np.flatnonzero(np.isfinite(values).all(axis=1))
    rows = rows[:: max(1, len(rows) // MOST)]
    turned = forward_kinematics(machine(), m.coordinates()[rows]).rotation
    good = np.isfinite(turned).all(axis=(1, 2))
    rows, turned = rows[good], turned[good]
    if len(rows) < FEWEST:
        return found
    ways = [found]
    if found.turns:
        ways += [Orientation(columns, t, words) for t, words in TURNS.items() if t != found.turns]
    elif len(columns) == len(QUATERNION) and re.search(r"\d$", m.sheet.names[columns[0]]):
        ways.append(Orientation([columns[3], *columns[:3]], "", "quaternions, w last"))
    blocks = [numbered(m, name)[rows] for name in ("setup", "target")]
    read = [matrices_of(values[rows][:, [columns.index(c) for c in way.columns]], way.turns) for way in ways]
    off = [turns_apart(turned, r, *blocks) for r in read]
    best = int(np.argmin(off))
    if off[best] > OFF:
        m.said.append(
            f"{shown} do not turn as the joints of the machine do, {np.degrees(off[best]):.0f} deg off in the median at best: look at its "
            "table of Denavit and Hartenberg and the convention of that, and at order, signs and units of the joints"
        )
    elif off[0] > CLEAR * max(off[best], LEAST):
        words, mean = ways[best].words, f"{np.degrees(off[best]):.2g} deg off in the median"
        words += f", as the joints show ({mean}; {np.degrees(off[0]):.2g} deg as {found.words})"
        return ways[best]._replace(words=words)
    return found


def numbered(m: Meant, meaning: str) -> Integers:
    """(n,) from 0, words of a column of this meaning; 0 where there is none."""
    at = next((c.index for c in m.guessed if c.meaning == meaning), None)
    cells = [""] * len(m.sheet) if at is None else list(m.sheet.columns[at])
    return np.unique(cells, return_inverse=True)[1]
