"""Elements of a description as plain data of a machine file, in SI units."""

from __future__ import annotations

from typing import Any

import numpy as np

from stiffmap.common.errors import StiffmapError
from stiffmap.model import beams
from stiffmap.model.description import (
    BeamStroke,
    Block,
    Body,
    Cable,
    Element,
    Joint,
    Law,
    Offset,
    Point,
    Pose,
    Spring,
    TableStroke,
)
from stiffmap.model.description.numbers import DIRECTIONS, numbers_of
from stiffmap.model.description.pose import IDENTITY
from stiffmap.model.description.strokes import present_rows
from stiffmap.model.files.schema.base import NAMED

Plain = dict[str, Any]
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
        case Joint():
            _refuse_unsaved(element)
            if isinstance(element, Cable):
                return _cable(element)
            return _actuator(element) if element.actuated else _joint(element)
        case Spring():
            return _spring(element)
        case Body():
            return _body(element)
        case Point():
            return {"point": element.name, **dump_numbers(element)}
        case Block():
            branches = {branch.name: dump_elements(branch.elements) for branch in element.branches}
            return {"block": element.name, "branches": branches}


def dump_pose(pose: Pose) -> Plain:
    """Translation and, where there is one, rotation: by axis names where it permutes the axes."""
    plain: Plain = {"translation": floats(pose.translation)}
    if pose.rotation != IDENTITY:
        names = [_NAMES.get(column) for column in zip(*pose.rotation, strict=True)]
        plain |= {"rotation": floats(pose.rotation)} if None in names else {"axes": "".join(map(str, names))}
    return plain


def _axis(axis: tuple[float, float, float]) -> Any:
    return _NAMES.get(axis, floats(axis))


def _refuse_unsaved(joint: Joint) -> None:
    """Files hold these as effects only: nothing may be lost in silence."""
    if joint.guide_errors or joint.friction or any(e.reference is None or e.of for e in joint.command_errors):
        raise StiffmapError(
            f"{joint.name}: friction, straightness and errors counted from home are saved as effects; "
            "use with_effect"
        )


def _joint(joint: Joint) -> Plain:
    axes = [_axis(axis) for axis in joint.axes]
    plain: Plain = {"joint": joint.name, "kind": joint.kind}
    plain.update({"axis": axes[0]} if len(axes) == 1 else {"axes": axes})
    numbers = dump_numbers(joint)
    rest = {"rest": numbers.pop("rest")} if "rest" in numbers else {}
    if any(set(dump_numbers(one)) != {"stiffness"} for one in joint.axis_laws):
        raise StiffmapError(f"{joint.name}: a file holds one stiffness per axis, no other laws")
    each = {"stiffness": floats(one.stiffness for one in joint.axis_laws)} if joint.axis_laws else {}
    return {**plain, **numbers, **rest, **_law(joint.law), **each}


def _actuator(joint: Joint) -> Plain:
    numbers = dump_numbers(joint)
    return {
        "actuator": joint.name,
        "kind": joint.kind,
        "axis": _axis(joint.axes[0]),
        "home": numbers.pop("home"),
        **(_law(joint.law) or {"rigid": True}),
        **numbers,
        **({"coupled": dict(joint.coupled)} if joint.coupled else {}),
        **_drive(joint),
    }


def _cable(cable: Cable) -> Plain:
    numbers = dump_numbers(cable)
    places = {"anchor": numbers.pop("anchor"), "at": numbers.pop("at")}
    guide = {} if cable.guide == Cable.guide else {"guide": _axis(cable.guide)}
    return {"cable": cable.name, **places, **guide, **numbers, **_drive(cable)}


def _drive(joint: Joint) -> Plain:
    """Numbers of the motor, and errors of its commands."""
    plain = {} if joint.drive is None else dump_numbers(joint.drive)
    if joint.command_errors:
        plain["command_errors"] = [dump_numbers(error) for error in joint.command_errors]
    return plain


def dump_numbers(holder: object) -> Plain:
    """The numbers that a dataclass declares and has, under the keys of a file."""
    plain: Plain = {}
    for n in numbers_of(holder):
        value = getattr(holder, n.name)
        if value is None or (value == n.default and not n.saved):
            continue
        outer, _, inner = n.key.partition(".")
        single = not n.shape or (n.shape == "axes" and len(value) == 1)
        entry = floats(value if n.shape else [value])
        holds = plain.setdefault(outer, {}) if inner else plain
        holds[inner or outer] = entry[0] if single else entry
    return plain


def _law(law: Law | None) -> Plain:
    if law is None:
        return {}
    plain = dump_numbers(law)
    return plain if len(plain) == 1 and law.stiffness > 0.0 else {"law": plain}


def _spring(spring: Spring) -> Plain:
    plain: Plain = {"spring": spring.name}
    if spring.beam and not spring.stroke and beams.compliance(spring.beam) == spring.compliance:
        plain["beam"] = {"along": spring.beam.along}
        for key, value in spring.beam.numbers:
            *outer, inner = key.split(".")
            (plain["beam"].setdefault(*outer, {}) if outer else plain["beam"])[inner] = value
    for word in () if "beam" in plain else ("compliance", "stiffness"):
        if getattr(spring, word) is not None and not isinstance(spring.stroke, TableStroke):
            plain[word] = dump_matrix(getattr(spring, word))
    if spring.laws:
        plain["laws"] = {DIRECTIONS[i]: dump_numbers(law) for i, law in spring.laws}
    return {**plain, **dump_numbers(spring), **_stroke(spring)}


def _stroke(spring: Spring) -> Plain:
    match spring.stroke:
        case BeamStroke() as s:
            beam = {"at": s.at, "length": s.length, "along": "xyz"[s.along], "rate": s.rate}
            return {"stroke": {"joint": s.joint, **beam}}
        case TableStroke() as s:
            assert spring.compliance is not None
            rows = zip(s.at, present_rows(s, spring.compliance), strict=True)
            table = [{"at": u, "compliance": dump_matrix(c)} for u, c in rows]
            return {"stroke": {"joint": s.joint, "table": table}}
    return {}


def dump_matrix(rows: object) -> object:
    """Diagonal, entries of the upper triangle, or all rows where the triangles differ by rounding."""
    matrix = np.array(rows, dtype=float)
    if np.any(matrix != matrix.T):
        return floats(rows)
    if np.count_nonzero(matrix - np.diag(np.diag(matrix))) == 0:
        return floats(np.diag(matrix))
    diagonal = {f"k{i}{i}": float(matrix[i - 1, i - 1]) for i in range(1, 7)}
    upper = {f"k{i + 1}{j + 1}": float(matrix[i, j]) for i, j in np.argwhere(np.triu(matrix, 1))}
    return {**diagonal, **upper}


def _body(body: Body) -> Plain:
    plain: Plain = {"body": body.name, **dump_numbers(body)}
    inertia = np.array(body.inertia)
    if np.any(inertia != np.diag(np.diag(inertia))):
        plain["inertia"] = floats(body.inertia)
    elif np.any(inertia):
        plain["inertia"] = floats(np.diag(inertia))
    return plain
