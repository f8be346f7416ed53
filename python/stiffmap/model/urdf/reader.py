"""Reading a URDF file: geometry, limits and masses; what is drawn is not read."""

from __future__ import annotations

import re
import xml.etree.ElementTree as xml
from collections import Counter
from difflib import get_close_matches
from functools import partial
from pathlib import Path
from xml.parsers import expat

import numpy as np

from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import FileError, reading, suggestion
from stiffmap.common.number_text import LARGEST, number_in
from stiffmap.common.rotations import rotation_about
from stiffmap.common.short import first_of
from stiffmap.model.description import Body, Pose
from stiffmap.model.description.pose import vector
from stiffmap.model.urdf.model import Mimic, UrdfJoint, UrdfModel, tensor

KINDS = {"revolute": "revolute", "continuous": "revolute", "prismatic": "prismatic", "fixed": "fixed"}
ATTRIBUTES = {
    "mass": ("value",), "inertia": ("ixx", "iyy", "izz", "ixy", "ixz", "iyz"), "origin": ("xyz", "rpy"), "axis": ("xyz",),
    "parent": ("link",), "child": ("link",), "limit": ("lower", "upper", "effort", "velocity"),
    "mimic": ("joint", "multiplier", "offset"),
}  # fmt: skip
HOLDS = {"robot": ("link", "joint"), "link": ("inertial", "origin"), "inertial": ("origin", "mass", "inertia"),
         "joint": ("origin", "axis", "parent", "child", "limit", "mimic")}  # fmt: skip
READ = ("link", "joint", "inertial", *ATTRIBUTES)
"""Elements whose content counts, in those that hold them; the origin of a link says nothing."""
SHORT = {"min": "lower", "max": "upper", "iyx": "ixy", "izx": "ixz", "izy": "iyz", "pose": "origin", "transform": "origin",
         "position": "origin"}  # fmt: skip
X, Y, Z = np.eye(3)
MOST, TURN = 4 * np.pi, 3.2
"""Angle of an origin, two turns, beyond which none is in radians; and one beyond which whole and half ones are in degrees."""
OTHERS = {"mujoco": "MuJoCo's format", "sdf": "SDF", "gazebo": "SDF", "COLLADA": "COLLADA"}
Wrong = partial[FileError]
"""Makes the error of a place of the file from a message."""


def read_urdf(path: Path) -> UrdfModel:
    """Model of a URDF file; FileError for what cannot be used, one line each."""
    file = str(path)
    wrong = partial(FileError, file=file)
    with reading(path):
        text = path.read_bytes()
    if text.startswith(b"version https://git-lfs"):
        raise wrong("this is a pointer of Git LFS and not the file itself, fetch that with: git lfs pull")
    if b"<html" in text[:1000].lower():
        raise wrong("this is a web page and not the file that it shows; download the raw file")
    robot = _parsed(text, wrong)
    if path.suffix == ".xacro" or any(_is_xacro(e) for e in robot.iter()):
        plain = path.name.removesuffix(".xacro").removesuffix(".urdf")
        out = f"{plain}.urdf" if f"{plain}.urdf" != path.name else f"{plain}_expanded.urdf"
        raise wrong(f"this is xacro, expand it with: xacro {path.name} > {out}")
    if robot.tag != "robot":
        other = (
            f", which is {OTHERS[robot.tag]}: give a URDF, or convert this first"
            if robot.tag in OTHERS
            else ""
        )
        raise wrong(f"expected a URDF, whose root element is <robot>; found <{robot.tag}>{other}")
    if robot.find("link") is None:
        raise wrong("the robot has no <link>, as in an SRDF or in macros of xacro; expected its URDF")
    _check_tags(robot, wrong)
    links = [(_name(e, wrong), _body(e, wrong)) for e in robot.findall("link")]
    joints = [_joint(e, wrong) for e in robot.findall("joint")]
    _check_tree([name for name, _ in links], joints, wrong)
    return UrdfModel(file, robot.get("name") or path.stem, dict(links), {j.child: j for j in joints})


def _parsed(text: bytes, wrong: Wrong) -> xml.Element:
    """Root element; prefixes need no explanation, which XML asks for and readers of URDF do not."""
    tree, parser = xml.TreeBuilder(), expat.ParserCreate()
    parser.StartElementHandler, parser.EndElementHandler = tree.start, tree.end
    parser.CharacterDataHandler = tree.data
    try:
        parser.Parse(tolerated(text), True)
    except (expat.ExpatError, LookupError, ValueError) as error:  # the latter two: no such encoding
        raise wrong(f"not XML: {error}; expected a URDF (xacro puts a calibration into it)") from None
    return tree.close()


def tolerated(text: bytes) -> bytes:
    """The file, as long as it was, without what readers of URDF pass over and XML does not allow: dashes in comments,
    lines before the declaration, an & in the name of a mesh, letters of another encoding in comments."""
    text = re.sub(rb"<!--.*?-->", lambda found: re.sub(rb"[^\n]", b" ", found[0]), text, flags=re.DOTALL)
    text = re.sub(rb"^(\s+)(<\?xml.*?\?>)", rb"\2\1", text, flags=re.DOTALL)
    return re.sub(rb"&(?!#?\w+;|\0)", b"_", text)  # a zero follows in UTF-16


def _is_xacro(e: xml.Element) -> bool:
    """An element of xacro, or a number or name that xacro fills in."""
    texts = [str(v) for k, v in e.attrib.items() if k != "filename"]
    return "xacro" in str(e.tag).partition(":")[0] or any("${" in t or "$(" in t for t in texts)


def _check_tags(robot: xml.Element, wrong: Wrong) -> None:
    """FileError for elements that would be passed over: a robot in the robot, and names that differ from known ones by a slip."""
    for top in robot:
        if top.tag == "robot":
            raise wrong(f"expected one <robot>, found another in it: '{top.get('name', '')}'")
        key = f"{top.tag} {top.get('name', '')}"
        inner = [("inertial", e) for inertial in top.findall("inertial") for e in inertial]
        for within, e in (("robot", top), *((top.tag, e) for e in top), *inner):
            known = HOLDS.get(within, ())
            if known and e.tag in READ and e.tag not in known:
                place = " or ".join(f"<{name}>" for name, tags in HOLDS.items() if e.tag in tags)
                raise wrong(f"expected <{e.tag}> in {place}, found it in <{within}>", key=key)
            meant = [] if e.tag in READ else get_close_matches(e.tag.lower(), READ, 1, 0.8)
            meant = meant or [name for name in known if name == SHORT.get(e.tag)]
            if meant:
                raise wrong(f"expected <{meant[0]}>, found <{e.tag}>", key="" if e is top else key)
            names = ATTRIBUTES.get(e.tag, ())
            inside = (e.text or "").strip() or "".join(f"<{part.tag}>" for part in e)
            if names and inside and known:
                raise wrong(f"expected <{e.tag} {names[0]}=...>, found '{inside}' in it", key=key)
            for k in (k for k in e.attrib if names and k not in names):
                close = [SHORT[k]] if k in SHORT else get_close_matches(k.lower(), names, 1, 0.8)
                if close:
                    raise wrong(f"{e.tag}: expected {close[0]}, found {k}='{e.get(k)}'", key=key)


def _name(element: xml.Element, wrong: Wrong) -> str:
    name = element.get("name")
    if not name:
        raise wrong(f"a <{element.tag}> has no name")
    return name


def _check_tree(links: list[str], joints: list[UrdfJoint], wrong: Wrong) -> None:
    for tag, names in {"link": links, "joint": [j.name for j in joints]}.items():
        name, times = Counter(names).most_common(1)[0] if names else ("", 0)
        if times > 1:
            raise wrong(f"there are {times} of this name", key=f"{tag} {name}")
    for joint in joints:
        for end in (joint.parent, joint.child):
            if end not in links:
                raise wrong(f"no link '{end}'{suggestion(end, links)}", key=f"joint {joint.name}")
    children = [j.child for j in joints]
    twice = next((c for c in children if children.count(c) > 1), None)
    if twice:
        raise wrong(f"link '{twice}' hangs on two joints; loops belong in the sidecar")
    roots = [link for link in links if link not in children]
    if len(roots) != 1:
        found = f"found {len(roots)}: {first_of(roots) or 'none'}"
        raise wrong(f"expected one root link, {found}; every other hangs on a joint, which may be fixed")
    reached = set(roots)
    while more := {j.child for j in joints if j.parent in reached} - reached:
        reached |= more
    ring = [link for link in links if link not in reached]
    if ring:
        raise wrong(
            f"links hang on each other in a ring and not on the root link '{roots[0]}': {first_of(ring)}"
        )


def _joint(e: xml.Element, wrong: Wrong) -> UrdfJoint:
    name = _name(e, wrong)
    wrong, kind = partial(wrong, key=f"joint {name}"), e.get("type", "")
    parent, child = (str(_wanted(e, tag, "link", wrong).get("link")) for tag in ("parent", "child"))
    along = _only(e, "axis", wrong)
    axis = _numbers(along, "xyz", X if along is None else np.zeros(3), wrong)
    largest = float(np.abs(axis).max())  # taken out first: the square of 1e308 overflows
    axis = axis / (largest or 1.0)
    length = float(np.linalg.norm(axis))
    if KINDS.get(kind) in ("revolute", "prismatic") and length == 0:
        raise wrong("a zero-length axis has no direction")
    limit, mimic = _only(e, "limit", wrong), _only(e, "mimic", wrong)
    lower, upper = (_limit(limit, k, wrong) for k in ("lower", "upper"))
    ranged = kind != "continuous" and lower != upper and max(abs(lower), abs(upper)) < LARGEST
    return UrdfJoint(
        name, KINDS.get(kind, kind), parent, child, _origin(e, wrong),
        rpy=vector(_numbers(e.find("origin"), "rpy", np.zeros(3), wrong)), axis=vector(axis / (length or 1.0)),
        limits=(lower, upper) if ranged else None,
        effort=_largest(limit, "effort", wrong),
        velocity=_largest(limit, "velocity", wrong),
        mimic=None if mimic is None or kind == "fixed" else Mimic(mimic.get("joint", "?"), _number(
            mimic, "multiplier", wrong, 1.0), _number(mimic, "offset", wrong)),
    )  # fmt: skip


def _only(e: xml.Element, tag: str, wrong: Wrong) -> xml.Element | None:
    """The one element of a tag, if there is one; FileError where there are several."""
    found = e.findall(tag)
    if len(found) > 1:
        raise wrong(f"expected one <{tag}>, found {len(found)}")
    return found[0] if found else None


def _wanted(e: xml.Element, tag: str, attribute: str, wrong: Wrong) -> xml.Element:
    """The one element of a tag, with an attribute that must be there."""
    found = _only(e, tag, wrong)
    if found is None or not found.get(attribute):
        raise wrong(f"has no <{tag} {attribute}=...>")
    return found


def _body(e: xml.Element, wrong: Wrong) -> Body | None:
    name = _name(e, wrong)
    wrong = partial(wrong, key=f"link {name}")
    inertial = _only(e, "inertial", wrong)
    if inertial is None or not len(inertial):
        return None
    mass = _number(_wanted(inertial, "mass", "value", wrong), "value", wrong)
    if mass == 0:
        return None
    if mass < 0:
        raise wrong(f"the mass is negative: {mass}")
    at, given = _origin(inertial, wrong), _only(inertial, "inertia", wrong)
    for k in ("ixx", "iyy", "izz") if given is not None else ():
        _wanted(inertial, "inertia", k, wrong)
    xx, yy, zz, xy, xz, yz = (_number(given, k, wrong) for k in ("ixx", "iyy", "izz", "ixy", "ixz", "iyz"))
    about_com = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    return Body(name, mass, at.translation, tensor(at.r @ about_com @ at.r.T, mass))


def _origin(e: xml.Element, wrong: Wrong) -> Pose:
    found = _only(e, "origin", wrong)
    other = [k for k in (found.attrib if found is not None else ()) if k not in ("xyz", "rpy")]
    if found is not None and other:
        raise wrong(f"origin: expected xyz and rpy, found {other[0]}='{found.get(other[0])}'")
    angles = _numbers(found, "rpy", np.zeros(3), wrong)
    if found is not None and any(a > MOST or (a > TURN and a % 0.5 == 0) for a in np.abs(angles)):
        raise wrong(f"rpy: expected radians, found '{found.get('rpy')}', as degrees are")
    roll, pitch, yaw = angles
    turned = rotation_about(Z, yaw) @ rotation_about(Y, pitch) @ rotation_about(X, roll)
    return Pose.of(_numbers(found, "xyz", np.zeros(3), wrong), turned)


def _numbers(e: xml.Element | None, attribute: str, default: Floats, wrong: Wrong) -> Floats:
    text = None if e is None else e.get(attribute)
    if text is None:
        return default
    try:
        values = np.array([number_in(part) for part in text.split()])
    except ValueError:
        values = np.zeros(0)
    if values.shape != (3,) or not np.isfinite(values).all():
        raise wrong(f"{attribute}: expected three numbers, found '{text}'")
    return values


def _limit(e: xml.Element | None, attribute: str, wrong: Wrong) -> float:
    """A limit as it is written; endless where it is too large for a machine, as exporters write 'none'."""
    try:
        value = abs(float((e.get(attribute) if e is not None else None) or 0.0))
    except ValueError:
        value = 0.0
    return np.inf if value >= LARGEST else _number(e, attribute, wrong)


def _largest(e: xml.Element | None, attribute: str, wrong: Wrong) -> float | None:
    """The largest effort or speed; None where it is not given: 0, negative, or endless."""
    value = _limit(e, attribute, wrong)
    return value if 0 < value < LARGEST else None


def _number(e: xml.Element | None, attribute: str, wrong: Wrong, default: float = 0.0) -> float:
    text = None if e is None else e.get(attribute)
    try:
        value = number_in(text) if text is not None else default
    except ValueError:
        raise wrong(f"{attribute}: expected a number, found '{text}'") from None
    if not np.isfinite(value):
        raise wrong(f"{attribute}: expected a finite number, found '{text}'")
    return value
