"""Reading a URDF file: geometry, limits and masses; meshes are looked for, not read."""

from __future__ import annotations

import xml.etree.ElementTree as xml
from pathlib import Path

import numpy as np

from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import FileError
from stiffmap.common.number_text import number_in
from stiffmap.common.rotations import rotation_about
from stiffmap.model.description import Body, Pose
from stiffmap.model.description.pose import vector
from stiffmap.model.urdf.model import UrdfJoint, UrdfModel

KINDS = {"revolute": "revolute", "continuous": "revolute", "prismatic": "prismatic", "fixed": "fixed"}
X, Y, Z = np.eye(3)


def read_urdf(path: Path, meshes: bool = True) -> UrdfModel:
    """Model of a URDF file; FileError for what cannot be used, one line each."""
    file = str(path)
    try:
        robot = xml.parse(path).getroot()
    except OSError as error:
        raise FileError(f"cannot be read: {error.strerror}", file=file) from None
    except (
        xml.ParseError,
        LookupError,
        ValueError,
    ) as error:  # the latter two: an encoding that there is not
        raise FileError(f"not XML: {error}", file=file) from None
    if robot.tag != "robot":
        raise FileError(f"expected a URDF, whose root element is <robot>; found <{robot.tag}>", file=file)
    if meshes:
        _check_meshes(robot, path)
    links = {_name(e, file): _body(e, file) for e in robot.findall("link")}
    joints = [_joint(e, file) for e in robot.findall("joint")]
    _check_tree(links, joints, file)
    return UrdfModel(file, robot.get("name", path.stem), links, {j.child: j for j in joints})


def _name(element: xml.Element, file: str) -> str:
    name = element.get("name")
    if not name:
        raise FileError(f"a <{element.tag}> has no name", file=file)
    return name


def _check_tree(links: dict[str, Body | None], joints: list[UrdfJoint], file: str) -> None:
    for joint in joints:
        for end in (joint.parent, joint.child):
            if end not in links:
                raise FileError(f"no link '{end}'", file=file, key=f"joint {joint.name}")
    children = [j.child for j in joints]
    twice = next((c for c in children if children.count(c) > 1), None)
    if twice:
        raise FileError(f"link '{twice}' hangs on two joints; loops belong in the sidecar", file=file)
    roots = [link for link in links if link not in children]
    if len(roots) != 1:
        raise FileError(
            f"expected one root link, found {len(roots)}: {', '.join(roots) or 'none'}", file=file
        )


def _joint(e: xml.Element, file: str) -> UrdfJoint:
    name = _name(e, file)
    key, kind = f"joint {name}", e.get("type", "")
    if e.find("mimic") is not None:
        of = e.find("mimic").get("joint", "?")  # type: ignore[union-attr]
        raise FileError(f"mimics joint '{of}': coupled joints cannot be imported; write the loop that "
                        "couples them, or make the joint fixed", file=file, key=key)  # fmt: skip
    if kind not in KINDS:
        known = ", ".join(KINDS)
        raise FileError(f"type '{kind}' cannot be imported; known are {known}", file=file, key=key)
    parent, child = (_link(e, tag, file, key) for tag in ("parent", "child"))
    axis = _numbers(e.find("axis"), "xyz", X, file, key)
    largest = float(np.abs(axis).max())  # taken out first: the square of 1e308 overflows
    axis = axis / (largest or 1.0)
    length = float(np.linalg.norm(axis))
    if KINDS[kind] != "fixed" and length == 0:
        raise FileError("a zero-length axis has no direction", file=file, key=key)
    limit = e.find("limit")
    both = limit is not None and limit.get("lower") is not None and limit.get("upper") is not None
    return UrdfJoint(
        name, KINDS[kind], parent, child, _origin(e, file, key),
        axis=vector(axis / (length or 1.0)),
        limits=(_number(limit, "lower", file, key), _number(limit, "upper", file, key)) if both else None,
        effort=_number(limit, "effort", file, key) or None,
        velocity=_number(limit, "velocity", file, key) or None,
    )  # fmt: skip


def _link(e: xml.Element, tag: str, file: str, key: str) -> str:
    found = e.find(tag)
    if found is None or not found.get("link"):
        raise FileError(f"has no <{tag} link=...>", file=file, key=key)
    return str(found.get("link"))


def _body(e: xml.Element, file: str) -> Body | None:
    inertial, name = e.find("inertial"), _name(e, file)
    if inertial is None:
        return None
    key = f"link {name}"
    mass = _number(inertial.find("mass"), "value", file, key)
    if mass == 0:
        return None
    if mass < 0:
        raise FileError(f"the mass is negative: {mass}", file=file, key=key)
    at, tensor = _origin(inertial, file, key), inertial.find("inertia")
    xx, yy, zz, xy, xz, yz = (
        _number(tensor, k, file, key) for k in ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
    )
    turned = at.r @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ at.r.T
    rows = Pose.of(rotation=turned).rotation
    return Body(name, mass, at.translation, rows)


def _origin(e: xml.Element, file: str, key: str) -> Pose:
    found = e.find("origin")
    roll, pitch, yaw = _numbers(found, "rpy", np.zeros(3), file, key)
    turned = rotation_about(Z, yaw) @ rotation_about(Y, pitch) @ rotation_about(X, roll)
    return Pose.of(_numbers(found, "xyz", np.zeros(3), file, key), turned)


def _numbers(e: xml.Element | None, attribute: str, default: Floats, file: str, key: str) -> Floats:
    text = None if e is None else e.get(attribute)
    if text is None:
        return default
    try:
        values = np.array([number_in(part) for part in text.split()])
    except ValueError:
        values = np.zeros(0)
    if values.shape != (3,) or not np.isfinite(values).all():
        raise FileError(f"{attribute}: expected three numbers, found '{text}'", file=file, key=key)
    return values


def _number(e: xml.Element | None, attribute: str, file: str, key: str) -> float:
    text = None if e is None else e.get(attribute)
    try:
        value = number_in(text) if text is not None else 0.0
    except ValueError:
        raise FileError(f"{attribute}: expected a number, found '{text}'", file=file, key=key) from None
    if not np.isfinite(value):
        raise FileError(f"{attribute}: expected a finite number, found '{text}'", file=file, key=key)
    return value


def _check_meshes(robot: xml.Element, path: Path) -> None:
    for link in robot.findall("link"):
        for mesh in link.iter("mesh"):
            given = mesh.get("filename", "")
            if not _found(given, path.parent):
                raise FileError(
                    f"mesh '{given}' is missing; stiffness does not need it: import with --without-meshes",
                    file=str(path), key=f"link {link.get('name')}",
                )  # fmt: skip


def _found(given: str, folder: Path) -> bool:
    """A mesh next to the file, or, for package://, below any folder above it."""
    if given.startswith("package://"):
        rest = given.removeprefix("package://")
        tails = [Path(rest), *([Path(rest.split("/", 1)[1])] if "/" in rest else [])]
        return any((up / t).is_file() for up in (folder, *folder.resolve().parents) for t in tails)
    return (folder / given.removeprefix("file://")).is_file()
