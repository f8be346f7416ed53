"""Elements of a description as plain data of a machine file, in SI units."""

from __future__ import annotations

from typing import Any

import numpy as np

from stiffmap.common.errors import StiffmapError
from stiffmap.model.description import (
    BeamStroke,
    Block,
    Body,
    Cable,
    CommandError,
    Element,
    Joint,
    Law,
    Offset,
    Point,
    Pose,
    Spring,
    TableStroke,
)
from stiffmap.model.description.numbers import numbers_of
from stiffmap.model.description.pose import IDENTITY, Rows
from stiffmap.model.description.strokes import present_rows
from stiffmap.model.files.schema.geometry import NAMED
from stiffmap.model.files.schema.springs import DIRECTIONS

Plain = dict[str, Any]
ZERO3 = (0.0, 0.0, 0.0)
_NAMES = {vector: name for name, vector in NAMED.items()}


def floats(values: Any) -> list[Any]:
    """Nested lists of Python floats."""
    return [floats(v) if isinstance(v, (tuple, list)) else float(v) for v in values]


def dump_elements(elements: tuple[Element, ...]) -> list[Plain]:
    """A sequence."""
    return [dump_element(element) for element in elements]


def dump_element(element: Element) -> Plain:
    """One element; the key that says its sort comes first."""
    match element:
        case Offset():
            actual = {} if element.actual is None else {"actual": dump_pose(element.actual)}
            return {"offset": element.name, **dump_pose(element.nominal), **actual}
        case Cable():
            return _cable(element)
        case Joint():
            return _actuator(element) if element.actuated else _joint(element)
        case Spring():
            return _spring(element)
        case Body():
            return _body(element)
        case Point():
            return {"point": element.name, "at": floats(element.offset)}
        case Block():
            branches = {branch.name: dump_elements(branch.elements) for branch in element.branches}
            return {"block": element.name, "branches": branches}


def dump_pose(pose: Pose) -> Plain:
    """Translation and, where there is one, rotation: by axis names where it permutes the axes."""
    plain: Plain = {"translation": floats(pose.translation)}
    if pose.rotation != IDENTITY:
        plain.update(dump_rotation(pose.rotation))
    return plain


def dump_rotation(rotation: Rows) -> Plain:
    """``axes`` or ``rotation``."""
    columns = list(zip(*rotation, strict=True))
    if all(column in _NAMES for column in columns):
        return {"axes": "".join(_NAMES[column] for column in columns)}
    return {"rotation": floats(rotation)}


def _axis(axis: tuple[float, float, float]) -> Any:
    return _NAMES.get(axis, floats(axis))


def _refuse_unsaved(joint: Joint) -> None:
    """Files hold these as effects only: nothing may be lost in silence."""
    if joint.guide_errors or joint.friction or any(e.reference is None for e in joint.command_errors):
        raise StiffmapError(
            f"{joint.name}: friction, straightness and errors counted from home are saved as effects; "
            "use with_effect"
        )


def _joint(joint: Joint) -> Plain:
    _refuse_unsaved(joint)
    plain: Plain = {"joint": joint.name, "kind": joint.kind}
    if len(joint.axes) == 1:
        plain["axis"] = _axis(joint.axes[0])
    else:
        plain["axes"] = [_axis(axis) for axis in joint.axes]
    plain["home"] = float(joint.home[0]) if len(joint.home) == 1 else floats(joint.home)
    plain.update(_numbers(joint))
    if joint.rest is not None:
        plain["rest"] = float(joint.rest[0]) if len(joint.rest) == 1 else floats(joint.rest)
    return {**plain, **_law(joint.law), **_axis_laws(joint)}


def _axis_laws(joint: Joint) -> Plain:
    if not joint.axis_laws:
        return {}
    if any(set(_law_terms(one)) != {"stiffness"} for one in joint.axis_laws):
        raise StiffmapError(f"{joint.name}: a file holds one stiffness per axis, no other laws")
    return {"stiffness": [float(one.stiffness) for one in joint.axis_laws]}


def _actuator(joint: Joint) -> Plain:
    _refuse_unsaved(joint)
    plain: Plain = {
        "actuator": joint.name,
        "kind": joint.kind,
        "axis": _axis(joint.axes[0]),
        "home": float(joint.home[0]),
        **(_law(joint.law) or {"rigid": True}),
    }
    plain.update(_numbers(joint))
    if joint.command_errors:
        plain["command_errors"] = [_command_error(error) for error in joint.command_errors]
    return plain


def _cable(cable: Cable) -> Plain:
    _refuse_unsaved(cable)
    plain: Plain = {"cable": cable.name, "anchor": floats(cable.anchor), "at": floats(cable.at)}
    if cable.guide != Cable.guide:
        plain["guide"] = _axis(cable.guide)
    plain.update(_numbers(cable))
    if cable.command_errors:
        plain["command_errors"] = [_command_error(error) for error in cable.command_errors]
    return plain


def _numbers(joint: Joint) -> Plain:
    """What the joint and its drive declare and have, under the keys of a file."""
    plain: Plain = {}
    for holder in (joint, joint.drive):
        for n in () if holder is None else numbers_of(holder):
            value = getattr(holder, n.name)
            if value is None or value == n.default:
                continue
            outer, _, inner = n.key.partition(".")
            entry = floats(value) if n.interval else float(value)
            if inner:
                plain.setdefault(outer, {})[inner] = entry
            else:
                plain[outer] = entry
    return plain


def _command_error(error: CommandError) -> Plain:
    changed = {key: value for key, value in vars(error).items() if value != getattr(CommandError, key)}
    return {key: floats(value) if key == "knots" else float(value) for key, value in changed.items()}


def _law(law: Law | None) -> Plain:
    if law is None:
        return {}
    plain = _law_terms(law)
    return plain if len(plain) == 1 and law.stiffness > 0.0 else {"law": plain}


def _law_terms(law: Law) -> Plain:
    plain: Plain = {"stiffness": float(law.stiffness)}
    if law.cubic:
        plain["cubic"] = float(law.cubic)
    if law.knots:
        plain["knots"] = floats(law.knots)
    return plain


def _spring(spring: Spring) -> Plain:
    plain: Plain = {"spring": spring.name}
    for word in ("compliance", "stiffness"):
        if getattr(spring, word) is not None and not isinstance(spring.stroke, TableStroke):
            plain[word] = dump_matrix(getattr(spring, word))
    if spring.laws:
        plain["laws"] = {DIRECTIONS[i]: _law_terms(law) for i, law in spring.laws}
    if any(spring.rest):
        plain["rest"] = floats(spring.rest)
    if spring.loss_factor is not None:
        plain["loss_factor"] = float(spring.loss_factor)
    return {**plain, **_stroke(spring)}


def _stroke(spring: Spring) -> Plain:
    match spring.stroke:
        case BeamStroke() as s:
            beam = {"at": s.at, "length": s.length, "along": "xyz"[s.along], "rate": s.rate}
            return {"stroke": {"joint": s.joint, **beam}}
        case TableStroke() as s:
            assert spring.compliance is not None
            rows = zip(s.at, present_rows(s, spring.compliance), strict=True)
            return {
                "stroke": {
                    "joint": s.joint,
                    "table": [{"at": u, "compliance": dump_matrix(c)} for u, c in rows],
                }
            }
    return {}


def dump_matrix(rows: Any) -> Any:
    """Diagonal, entries of the upper triangle, or all rows where the triangles differ by rounding."""
    matrix = np.array(rows, dtype=float)
    if np.any(matrix != matrix.T):
        return floats(rows)
    if np.count_nonzero(matrix - np.diag(np.diag(matrix))) == 0:
        return floats(np.diag(matrix))
    diagonal = {f"k{i}{i}": float(matrix[i - 1, i - 1]) for i in range(1, 7)}
    upper = {
        f"k{i + 1}{j + 1}": float(matrix[i, j])
        for i in range(6)
        for j in range(i + 1, 6)
        if matrix[i, j] != 0.0
    }
    return {**diagonal, **upper}


def _body(body: Body) -> Plain:
    plain: Plain = {"body": body.name, "mass": float(body.mass)}
    if body.com != ZERO3:
        plain["com"] = floats(body.com)
    inertia = np.array(body.inertia)
    if np.any(inertia != np.diag(np.diag(inertia))):
        plain["inertia"] = floats(body.inertia)
    elif np.any(inertia):
        plain["inertia"] = floats(np.diag(inertia))
    return plain
