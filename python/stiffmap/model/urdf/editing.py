"""Origins of joints in the text of a URDF; every other byte stays."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from xml.parsers import expat

import numpy as np

from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import FileError
from stiffmap.common.number_text import number_in
from stiffmap.common.rotations import rotation_about
from stiffmap.model.description import Pose
from stiffmap.model.urdf.reader import tolerated

SAME = 1e-14  # m, and of a rotation matrix
LOCKED = 1e-12  # cosine of the pitch: below it roll and yaw turn about one axis
TAG = re.compile(rb"""<[^\s/>]+(?:[^>"']|"[^"]*"|'[^']*')*?(?=\s*/?>)""")


def with_origins(path: Path, origins: Mapping[str, tuple[Pose, Pose]]) -> bytes:
    """The file with other origins (m; rpy in rad), joint -> (as it is, as it shall be); a number that stays keeps its text.

    FileError where the file has an encoding in which no tag can be found.
    """
    text = path.read_bytes()
    at = _tags(text)
    edits = []
    for joint, (old, new) in origins.items():
        start = at.get((joint, "origin"), at[joint, "joint"])
        tag = TAG.match(text, start)
        if tag is None:
            raise FileError("expected a URDF in UTF-8 or another encoding of ASCII", file=str(path))
        if (joint, "origin") in at:
            edits.append((start, tag.end(), _moved(tag[0], old, new)))
        else:
            end = text.index(b">", tag.end()) + 1
            space = re.match(rb"\s*", text[end:])
            edits.append((end, end, (space[0] if space else b"") + _moved(b"<origin", old, new) + b"/>"))
    for start, end, tag_text in sorted(edits, reverse=True):
        text = text[:start] + tag_text + text[end:]
    return text


def _tags(text: bytes) -> dict[tuple[str, str], int]:
    """Where the tag of each joint of the robot begins, and that of its first origin."""
    at: dict[tuple[str, str], int] = {}
    parser, above = expat.ParserCreate(), [""]

    def start(tag: str, attributes: dict[str, str]) -> None:
        above.append(attributes.get("name", "") if (len(above), tag) == (2, "joint") else tag)
        if (len(above), tag) == (3, "joint") or (len(above), tag, above[1]) == (4, "origin", "robot"):
            at.setdefault((above[2], tag), parser.CurrentByteIndex)

    parser.StartElementHandler, parser.EndElementHandler = start, lambda tag: above.pop()
    parser.Parse(tolerated(text), True)
    return at


def _moved(tag: bytes, old: Pose, new: Pose) -> bytes:
    if np.abs(new.p - old.p).max() > SAME:
        tag = _with_numbers(tag, b"xyz", new.p)
    if np.abs(new.r - old.r).max() > SAME:
        tag = _with_numbers(tag, b"rpy", new.r)
    return tag


def _with_numbers(tag: bytes, key: bytes, wanted: Floats) -> bytes:
    """The tag with three numbers, or those of a rotation (3, 3)."""
    found = re.search(rb"""(\s%b\s*=\s*)(["'])(.*?)\2""" % key, tag, re.DOTALL)
    parts = re.split(rb"(\s+)", found[3].strip()) if found else [b"0", b" ", b"0", b" ", b"0"]
    was = np.array([number_in(p.decode()) for p in parts[::2]])
    values = wanted if wanted.ndim == 1 else rpy_of(wanted, was)
    for i, (a, b) in enumerate(zip(was, values, strict=True)):
        parts[2 * i] = parts[2 * i] if abs(a - b) <= SAME else repr(round(float(b), 15) + 0.0).encode()
    numbers = b"".join(parts)
    if found is None:
        return tag + b' %b="%b"' % (key, numbers)
    return tag[: found.start(3)] + numbers + tag[found.end(3) :]


def rpy_of(r: Floats, near: Floats) -> Floats:
    """Roll, pitch and yaw (rad) of a rotation (3, 3), Rz(yaw) Ry(pitch) Rx(roll), those closest to `near`.

    Exact near a pitch of a quarter turn too: roll and pitch are taken from what the yaw leaves.
    """
    yaw = near[2] if np.hypot(r[0, 0], r[1, 0]) < LOCKED else np.arctan2(r[1, 0], r[0, 0])
    either = []
    for z in (yaw, yaw + np.pi):
        left = rotation_about(np.eye(3)[2], -z) @ r
        one = np.array([np.arctan2(-left[1, 2], left[1, 1]), np.arctan2(-left[2, 0], left[0, 0]), z])
        either.append(one - 2 * np.pi * np.round((one - near) / (2 * np.pi)))
    return min(either, key=lambda one: float(np.abs(one - near).max()))
