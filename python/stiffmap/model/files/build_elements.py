"""Elements of a file to the SI elements of a description."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stiffmap.common.units import INERTIA
from stiffmap.model.description import (
    Block,
    Body,
    Branch,
    Cable,
    CommandError,
    Drive,
    Element,
    Joint,
    Law,
    Offset,
    Point,
)
from stiffmap.model.description.numbers import numbers_of
from stiffmap.model.description.pose import Rows, Vector, rows, vector
from stiffmap.model.description.strokes import entry_dimension
from stiffmap.model.files.build_springs import beam_body, build_law, build_spring
from stiffmap.model.files.build_values import build_number, build_numbers, build_pose
from stiffmap.model.files.context import Context
from stiffmap.model.files.schema.base import Number
from stiffmap.model.files.schema.elements import (
    ActuatorModel,
    BodyModel,
    CableModel,
    ElementModel,
    JointModel,
    OffsetModel,
    PointModel,
    SpringModel,
    sort_of,
)

ZERO = Number(value=0.0)
HOME, REST = (n for n in numbers_of(Joint) if n.shape == "axes")


def build_elements(models: Sequence[ElementModel], context: Context) -> tuple[Element, ...]:
    """A sequence; problems (also a name that occurs twice) are kept in ``context`` for the end.

    Bodies and points have names of their own sort: a body may be called as the spring that follows it.
    """
    taken: set[tuple[str, str]] = set()
    elements = []
    for i, model in enumerate(models):
        here = context.at(i)
        element = context.attempt(build_element, model, here, (i, models))
        if element is None:
            continue
        names = [element.name]
        if isinstance(element, Block):
            names += [branch.name for branch in element.branches]
        sort = {Body: "body", Point: "point"}.get(type(element), "element")
        for name in names:
            if (sort, name) in taken:
                taken_by = f"the name '{name}' is taken by an earlier {sort} of this sequence"
                context.gathered.problems.append(here.error(taken_by))
            taken.add((sort, name))
        elements.append(element)
    return tuple(elements)


def build_element(
    model: ElementModel, context: Context, among: tuple[int, Sequence[ElementModel]]
) -> Element:
    """One element; `among`: its number and the sequence it is in."""
    here = context.named(getattr(model, str(sort_of(model))), model)
    match model:
        case OffsetModel():
            there = here.at("actual")
            actual = None if model.actual is None else build_pose(model.actual, there, "actual.")
            return Offset(model.offset, build_pose(model, here), actual)
        case JointModel():
            return _joint(model, here)
        case ActuatorModel():
            return _actuator(model, here, among[1])
        case CableModel():
            return _cable(model, here)
        case SpringModel():
            return build_spring(model, here)
        case BodyModel():
            return _body(model, here, *among)
        case PointModel():
            return Point(model.point, **build_numbers(model, Point, False, here))
    branches = (  # a full name holds the branch, not the block
        Branch(name, build_elements(models, context.at("branches", name).inside(name)))
        for name, models in model.branches.items()
    )
    return Block(model.block, tuple(branches))


def _joint(model: JointModel, context: Context) -> Joint:
    axes = tuple(model.axes) if model.axes is not None else (model.axis,)
    angular = model.kind != "prismatic"
    home = [ZERO] * len(axes) if model.home is None else model.home
    return Joint(
        model.joint,
        model.kind,
        tuple(a for a in axes if a is not None),
        build_number(HOME, home, angular, context),
        **_laws(model, angular, context),
        rest=None if model.rest is None else build_number(REST, model.rest, angular, context),
        **build_numbers(model, Joint, angular, context),
    )


def _laws(model: JointModel | ActuatorModel, angular: bool, context: Context) -> dict[str, Any]:
    """``law``, or ``axis_laws`` where there are several numbers."""
    for key in ("stiffness", "compliance"):
        given, here = getattr(model, key), context.at(key)
        if isinstance(given, list):
            each = [_linear_law(key, n, angular, here.at(i), f".{i + 1}") for i, n in enumerate(given)]
            return {"law": each[0]} if len(each) == 1 else {"axis_laws": tuple(each)}
        if given is not None:
            return {"law": _linear_law(key, given, angular, here)}
    return {"law": model.law and build_law(model.law, angular, context.at("law"), "law")}


def _linear_law(key: str, number: Number, angular: bool, context: Context, axis: str = "") -> Law:
    """The law of one stiffness or compliance at this place of the file."""
    dimension = entry_dimension(key, *(3 * angular,) * 2)
    if key == "compliance":
        return Law(context.inverse(number, dimension, f"stiffness{axis}"))
    if number.value <= 0.0:
        context.fail(f"must be positive; found {number.value}")
    return Law(context.si(number, dimension, f"stiffness{axis}"))


def _actuator(model: ActuatorModel, context: Context, models: Sequence[ElementModel]) -> Joint:
    angular = model.kind == "revolute"
    alike = {m.actuator for m in models if isinstance(m, ActuatorModel) and m.kind == model.kind}
    for name in model.coupled or {}:
        if name not in alike - {model.actuator}:
            context.at("coupled").fail(f"expected {model.kind} drives of the same sequence; found '{name}'")
    drive = Drive(**build_numbers(model, Drive, angular, context))
    return Joint(
        model.actuator,
        model.kind,
        (model.axis,),
        build_number(HOME, model.home or ZERO, angular, context),
        actuated=True,
        **_laws(model, angular, context),
        command_errors=_command_errors(model, angular, context),
        coupled=tuple((model.coupled or {}).items()),
        **build_numbers(model, Joint, angular, context),
        drive=drive,
    )


def _cable(model: CableModel, context: Context) -> Cable:
    drive = Drive(**build_numbers(model, Drive, False, context))
    numbers = build_numbers(model, Cable, False, context)
    if not (numbers.get("elasticity") or numbers.get("stiffness")):
        context.fail("a cable without elasticity and stiffness; at least one must be positive")
    errors = _command_errors(model, False, context)
    return Cable(model.cable, guide=model.guide or Cable.guide, command_errors=errors, drive=drive, **numbers)


def _command_errors(
    model: ActuatorModel | CableModel, angular: bool, context: Context
) -> tuple[CommandError, ...]:
    errors = tuple(
        CommandError(**build_numbers(e, CommandError, angular, context, "command_errors."))
        for e in model.command_errors or []
    )
    if any(b <= a for error in errors for (a, _), (b, _) in pairwise(error.knots)):
        context.at("command_errors").at("knots").fail("knots need rising coordinates")
    return errors


def _body(model: BodyModel, context: Context, place: int, models: Sequence[ElementModel]) -> Body:
    of: dict[str, Any] = {}
    inertia = None
    if model.of is not None:
        mass, com, inertia = _of_beam(model.of, context, place, models)
        of = {"mass": mass, "com": com}
    numbers = {**of, **build_numbers(model, Body, False, context)}
    if inertia is not None:  # a link as heavy as declared, spread as its section says
        numbers["inertia"] = rows(inertia * (numbers["mass"] / of["mass"]))
    if model.inertia is not None:
        numbers["inertia"] = _inertia(model.inertia, context)
    return Body(model.body, **numbers)


def _of_beam(
    name: str, context: Context, place: int, models: Sequence[ElementModel]
) -> tuple[float, Vector, NDArray[np.float64]]:
    """Mass, centre and inertia of the beam of a spring of this sequence. The body stands at the beam's root where
    offsets lead from it to the spring, else at its end."""
    beams = {m.spring: i for i, m in enumerate(models) if isinstance(m, SpringModel) and m.beam is not None}
    if name not in beams:
        there = ", ".join(beams) or "none"
        context.at("of").fail(f"no spring '{name}' with a beam in this sequence; there are: {there}")
    spring = models[beams[name]]
    assert isinstance(spring, SpringModel) and spring.beam is not None
    beam = spring.beam
    mass, length, inertia = beam_body(beam, context.at("of"))
    axis, sign = "xyz".index(beam.along[-1]), -1.0 if beam.along.startswith("-") else 1.0
    between = [m for m in models[place : beams[name]] if isinstance(m, OffsetModel)]
    way = sum(build_pose(m, context).translation[axis] for m in between)
    com = [0.0, 0.0, 0.0]
    com[axis] = (sign if sign * way > length / 2 else -sign) * length / 2
    return mass, vector(np.array(com)), inertia


def _inertia(terms: list[Number | list[Number]], context: Context) -> Rows:
    here = context.at("inertia")
    given = [[ZERO] * 3 for _ in range(3)]
    for i, term in enumerate(terms):
        if len(terms) != 3 or isinstance(term, list) != isinstance(terms[0], list):
            here.fail("expected three moments about x, y, z, or three rows of three")
        if isinstance(term, list):
            given[i] = term
        else:
            given[i][i] = term
    matrix = np.zeros((3, 3))
    for i, j in np.ndindex(3, 3):
        key = f"inertia.{'xyz'[min(i, j)]}{'xyz'[max(i, j)]}"
        matrix[i, j] = context.si(given[i][j], INERTIA, key)
    if np.any(matrix != matrix.T):
        here.fail(f"the inertia is not symmetric (by {np.abs(matrix - matrix.T).max():.3g} kg m^2)")
    principal = np.linalg.eigvalsh(matrix)
    if principal[0] < -1e-12 * principal[2]:
        here.fail(f"the inertia has a negative principal moment ({principal[0]:.3g} kg m^2)")
    return rows(matrix)
