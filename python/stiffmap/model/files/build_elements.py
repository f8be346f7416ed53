"""Elements of a file to the SI elements of a description."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stiffmap.common.units import ANGLE, INERTIA, LENGTH, MASS, NONE, Dimension
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
from stiffmap.model.description.numbers import JointNumber, numbers_of
from stiffmap.model.description.pose import Rows, Vector, vector
from stiffmap.model.files.build_geometry import build_pose, build_vector
from stiffmap.model.files.build_springs import beam_body, build_law, build_spring
from stiffmap.model.files.context import Context
from stiffmap.model.files.schema.base import Number
from stiffmap.model.files.schema.elements import (
    ActuatorModel,
    BlockModel,
    BodyModel,
    CableModel,
    CommandErrorModel,
    ElementModel,
    JointModel,
    OffsetModel,
    PointModel,
    SpringModel,
)

ZERO = Number(value=0.0)


def build_elements(models: Sequence[ElementModel], context: Context) -> tuple[Element, ...]:
    """A sequence; problems (also a name that occurs twice) are kept in ``context`` for the end.

    Bodies and points have names of their own sort: a body may be called as the spring that follows it.
    """
    taken: set[tuple[str, str]] = set()
    elements = []
    for i, model in enumerate(models):
        here = context.at(i)
        element = context.attempt(partial(build_element, model, here, (i, models)))
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
    model: ElementModel, context: Context, among: tuple[int, Sequence[ElementModel]] = (0, ())
) -> Element:
    """One element; `among`: its number and the sequence it is in."""
    match model:
        case OffsetModel():
            return _offset(model, _named(model.offset, model, context))
        case JointModel():
            return _joint(model, _named(model.joint, model, context))
        case ActuatorModel():
            return _actuator(model, _named(model.actuator, model, context))
        case CableModel():
            return _cable(model, _named(model.cable, model, context))
        case SpringModel():
            return build_spring(model, _named(model.spring, model, context))
        case BodyModel():
            return _body(model, _named(model.body, model, context), *among)
        case PointModel():
            return _point(model, _named(model.point, model, context))
        case BlockModel():
            return _block(model, context)


def _named(name: str, model: ElementModel, context: Context) -> Context:
    inside = context.inside(name)
    inside.note(model.note)
    inside.mark(model.source)
    return inside


def _offset(model: OffsetModel, context: Context) -> Offset:
    actual = None
    if model.actual is not None:
        actual = build_pose(model.actual, context.at("actual"), "actual.")
    return Offset(model.offset, build_pose(model, context), actual)


def _joint(model: JointModel, context: Context) -> Joint:
    axes = tuple(model.axes) if model.axes is not None else (model.axis,)
    angular = model.kind != "prismatic"
    coordinate = ANGLE if angular else LENGTH
    home = _list(model.home) if model.home is not None else [ZERO] * len(axes)
    return Joint(
        model.joint,
        model.kind,
        tuple(a for a in axes if a is not None),
        coordinates(home, coordinate, context),
        **_laws(model, angular, context),
        rest=None if model.rest is None else coordinates(_list(model.rest), coordinate, context, "rest"),
        **build_numbers(model, Joint, angular, context),
    )


def _list(numbers: Number | list[Number]) -> list[Number]:
    return numbers if isinstance(numbers, list) else [numbers]


def _laws(model: JointModel, angular: bool, context: Context) -> dict[str, Any]:
    """``law``, or ``axis_laws`` where there is a list."""
    for key in ("stiffness", "compliance"):
        given = getattr(model, key)
        if isinstance(given, list):
            one = [
                _linear_law(key, number, angular, context.at(key, i), f".{i + 1}")
                for i, number in enumerate(given)
            ]
            return {"law": one[0]} if len(one) == 1 else {"axis_laws": tuple(one)}
    return {"law": _law(model, angular, context)}


def coordinates(
    numbers: Sequence[Number], dimension: Dimension, context: Context, key: str = "home"
) -> tuple[float, ...]:
    """SI coordinates, one per axis."""
    names = [key] if len(numbers) == 1 else [f"{key}.{i + 1}" for i in range(len(numbers))]
    return tuple(context.si(n, dimension, name) for n, name in zip(numbers, names, strict=True))


def _law(model: JointModel | ActuatorModel, angular: bool, context: Context) -> Law | None:
    for key in ("stiffness", "compliance"):
        number = getattr(model, key)
        if number is not None:
            return _linear_law(key, number, angular, context.at(key))
    if model.law is not None:
        return build_law(model.law, angular, context.at("law"), "law")
    return None


def _linear_law(key: str, number: Number, angular: bool, context: Context, axis: str = "") -> Law:
    """The law of one stiffness or compliance at this place of the file."""
    linear = Dimension(length=1, force=1, angle=-1) if angular else Dimension(length=-1, force=1)
    if key == "compliance":
        return Law(context.inverse(number, Dimension(*(-n for n in linear)), f"stiffness{axis}"))
    if number.value <= 0.0:
        context.fail(f"must be positive; found {number.value}")
    return Law(context.si(number, linear, f"stiffness{axis}"))


def build_range(pair: list[Number], dimension: Dimension, context: Context, name: str) -> tuple[float, float]:
    """SI interval; raises `FileError` where it is empty."""
    low, high = (context.si(n, dimension, f"{name}.{w}") for n, w in zip(pair, ("min", "max"), strict=True))
    if low >= high:
        context.at(name).fail(f"the lower end {pair[0].value} is not below the upper end {pair[1].value}")
    return (low, high)


def build_numbers(
    model: JointModel | ActuatorModel | CableModel, holder: type, angular: bool, context: Context
) -> dict[str, Any]:
    """Values of the numbers that `holder` declares and the file gives, SI; raises `FileError` out of bounds."""
    out: dict[str, Any] = {}
    for n in numbers_of(holder):
        keys = n.key.split(".")
        given: Any = model
        for key in keys:
            given = getattr(given, key, None)
        if given is None:
            continue
        if n.interval:
            out[n.name] = build_range(given, n.dimension(angular), context, n.key)
            continue
        out[n.name] = context.si(given, n.dimension(angular), n.key)
        if not n.lower <= out[n.name] <= n.upper:
            context.at(*keys).fail(f"expected {_bounds(n)}; found {given.value}")
    return out


def _bounds(n: JointNumber) -> str:
    if n.upper == float("inf"):
        return "a number that is not negative" if n.lower == 0.0 else f"{n.lower:g} or more (SI)"
    return f"{n.lower:g} to {n.upper:g} (SI)"


def _actuator(model: ActuatorModel, context: Context) -> Joint:
    angular = model.kind == "revolute"
    coordinate = ANGLE if angular else LENGTH

    drive = Drive(**build_numbers(model, Drive, angular, context))
    return Joint(
        model.actuator,
        model.kind,
        (model.axis,),
        coordinates([model.home or ZERO], coordinate, context),
        actuated=True,
        law=_law(model, angular, context),
        command_errors=tuple(_command_error(e, coordinate, context) for e in model.command_errors or []),
        **build_numbers(model, Joint, angular, context),
        drive=drive,
    )


def _cable(model: CableModel, context: Context) -> Cable:
    drive = Drive(**build_numbers(model, Drive, False, context))
    numbers = build_numbers(model, Cable, False, context)
    if not (numbers.get("elasticity") or numbers.get("stiffness")):
        context.fail("a cable without elasticity and stiffness; at least one must be positive")
    return Cable(
        model.cable,
        anchor=build_vector(model.anchor, LENGTH, context, "anchor"),
        at=build_vector(model.at, LENGTH, context, "at") if model.at else (0.0, 0.0, 0.0),
        guide=model.guide or (0.0, 0.0, 1.0),
        command_errors=tuple(_command_error(e, LENGTH, context) for e in model.command_errors or []),
        drive=drive,
        **numbers,
    )


def _command_error(model: CommandErrorModel, coordinate: Dimension, context: Context) -> CommandError:
    dimensions = {"slope": NONE, "phase": ANGLE}
    given = {
        key: context.si(getattr(model, key), dimensions.get(key, coordinate), f"command_errors.{key}")
        for key in CommandErrorModel.model_fields
        if key != "knots" and getattr(model, key) is not None
    }
    knots = tuple(
        (context.si(u, coordinate), context.si(error, coordinate)) for u, error in model.knots or []
    )
    if any(b <= a for (a, _), (b, _) in pairwise(knots)):
        context.at("command_errors").at("knots").fail("knots need rising coordinates")
    return replace(CommandError(), **given, knots=knots)


def _body(model: BodyModel, context: Context, place: int, models: Sequence[ElementModel]) -> Body:
    mass, com, inertia = 0.0, (0.0, 0.0, 0.0), None
    if model.of is not None:
        mass, com, inertia = _of_beam(model.of, context, place, models)
    if model.mass is not None:
        if model.mass.value < 0.0:
            context.at("mass").fail(f"must not be negative; found {model.mass.value}")
        declared = context.si(model.mass, MASS, "mass")
        if inertia is not None:  # a link as heavy as declared, spread as its section says
            inertia = inertia * (declared / mass)
        mass = declared
    if model.com is not None:
        com = build_vector(model.com, LENGTH, context, "com")
    if model.inertia is not None:
        return Body(model.body, mass, com, _inertia(model.inertia, context))
    if inertia is None:
        return Body(model.body, mass, com)
    a, b, c = (vector(row) for row in inertia)
    return Body(model.body, mass, com, (a, b, c))


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
    rows = [[ZERO] * 3 for _ in range(3)]
    for i, term in enumerate(terms):
        if len(terms) != 3 or isinstance(term, list) != isinstance(terms[0], list):
            here.fail("expected three moments about x, y, z, or three rows of three")
        if isinstance(term, list):
            rows[i] = term
        else:
            rows[i][i] = term
    matrix = np.array(
        [
            [
                context.si(n, INERTIA, f"inertia.{'xyz'[min(i, j)]}{'xyz'[max(i, j)]}")
                for j, n in enumerate(row)
            ]
            for i, row in enumerate(rows)
        ]
    )
    if np.any(matrix != matrix.T):
        here.fail(f"the inertia is not symmetric (by {np.abs(matrix - matrix.T).max():.3g} kg m^2)")
    principal = np.linalg.eigvalsh(matrix)
    if principal[0] < -1e-12 * principal[2]:
        here.fail(f"the inertia has a negative principal moment ({principal[0]:.3g} kg m^2)")
    a, b, c = (vector(row) for row in matrix)
    return (a, b, c)


def _point(model: PointModel, context: Context) -> Point:
    if model.at is None:
        return Point(model.point)
    return Point(model.point, build_vector(model.at, LENGTH, context, "at"))


def _block(model: BlockModel, context: Context) -> Block:
    context.inside(model.block).note(model.note)
    context.inside(model.block).mark(model.source)
    branches = tuple(
        # a full name holds the branch, not the block
        Branch(name, build_elements(models, context.at("branches", name).inside(name)))
        for name, models in model.branches.items()
    )
    return Block(model.block, branches)
