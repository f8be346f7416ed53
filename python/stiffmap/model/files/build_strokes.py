"""Strokes of springs: built once all joints of the machine are known."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

from stiffmap.common.errors import unknown_name
from stiffmap.common.units import ANGLE, LENGTH, Dimension
from stiffmap.model.description import BeamStroke, Element, Joint, MachineDescription, Spring, TableStroke
from stiffmap.model.description.tree import all_elements, edit
from stiffmap.model.files.build_springs import build_matrix
from stiffmap.model.files.context import Context, Gathered
from stiffmap.model.files.schema.base import Number
from stiffmap.model.files.schema.elements import SpringModel


def with_strokes(description: MachineDescription, gathered: Gathered) -> MachineDescription:
    """The machine with the strokes that its file gives; problems are kept in ``gathered``."""
    for spring, context in gathered.strokes:
        stroke = context.attempt(_stroke, description, spring, context)
        if stroke is not None:
            description = edit(description, context.full, partial(_with_stroke, stroke)) or description
    return description


def _with_stroke(stroke: BeamStroke | TableStroke, element: Element) -> Element | None:
    return replace(element, stroke=stroke) if isinstance(element, Spring) else None


def _stroke(
    description: MachineDescription, spring: SpringModel, context: Context
) -> BeamStroke | TableStroke:
    model = spring.stroke
    assert model is not None
    joint = stroke_joint(description, model.joint, context)
    coordinate = LENGTH if joint.kind == "prismatic" else ANGLE
    if model.table is None:
        return _beam(spring, context, joint, coordinate)
    at = tuple(context.at("table", i, "at").si(row.at, coordinate) for i, row in enumerate(model.table))
    for i in range(1, len(at)):
        if at[i] <= at[i - 1]:
            context.at("table", i, "at").fail("the coordinates of a table must rise")
    quiet = replace(context, gathered=Gathered())  # uncertainties are those of the first row
    rows = tuple(
        build_matrix(row.compliance, "compliance", quiet.at("table", i, "compliance"))
        for i, row in enumerate(model.table)
    )
    for end in (*joint.home, *(joint.ends or ())):
        if not at[0] <= end <= at[-1]:
            say = context.units.say
            context.at("table").fail(
                f"the table goes from {say(at[0], coordinate)} to {say(at[-1], coordinate)}, "
                f"'{model.joint}' to {say(end, coordinate)}"
            )
    return TableStroke(model.joint, at, rows)


def _beam(spring: SpringModel, context: Context, joint: Joint, coordinate: Dimension) -> BeamStroke:
    model, beam = spring.stroke, spring.beam
    assert model is not None
    length, along = model.length or (beam and beam.length), model.along or (beam and beam.along)
    assert length and along  # the schema asks for them
    per = Dimension(*(a - b for a, b in zip(LENGTH, coordinate, strict=True)))
    out = BeamStroke(
        model.joint,
        length=context.si(length, LENGTH),
        along="xyz".index(along[-1]),
        at=0.0 if model.at is None else context.at("at").si(model.at, coordinate),
        rate=context.at("rate").si(model.rate or Number(value=1.0), per),
    )
    for end in (*joint.home, *(joint.ends or ())):
        left = out.length + out.rate * (end - out.at)
        if left <= 0.0:
            say = context.units.say
            context.fail(
                f"with '{model.joint}' at {say(end, coordinate)} the beam would be {say(left, LENGTH)} long"
            )
    return out


def stroke_joint(description: MachineDescription, name: str, context: Context) -> Joint:
    """The joint that the spring at this place varies with; raises `FileError`."""
    joints = {n: e for n, e in all_elements(description) if isinstance(e, Joint) and len(e.axes) == 1}
    scope = context.full
    while scope:
        scope = scope.rpartition(".")[0]
        found = joints.get(f"{scope}.{name}" if scope else name)
        if found is not None:
            return found
    own = context.full.partition(".")[0]
    near = [n.partition(".")[2] if n.partition(".")[0] == own else n for n in joints]
    raise context.at("joint").error(unknown_name("joint of one axis", name, near))
