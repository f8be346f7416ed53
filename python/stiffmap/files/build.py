"""A validated file to the SI description of a machine."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from stiffmap.description import (
    AppliedEffect,
    Block,
    Branch,
    Element,
    ExternalSpring,
    Joint,
    Leg,
    MachineDescription,
    Offset,
    Pose,
)
from stiffmap.description.pose import Vector
from stiffmap.files.build_elements import build_elements, build_range, home_coordinates
from stiffmap.files.build_geometry import build_pose, build_vector
from stiffmap.files.context import Context, Gathered
from stiffmap.files.schema import MachineFile
from stiffmap.files.schema.base import Number, suggestion
from stiffmap.files.schema.geometry import Box
from stiffmap.files.schema.machine import EffectModel, ExternalSpringModel, LegModel
from stiffmap.files.units import ANGLE, LENGTH, NONE, Dimension, UnitSystem
from stiffmap.files.yaml_text import Document

GRAVITY_LIMIT = 1000.0  # m/s²; above it, the file gave mm/s²


def build(model: MachineFile, document: Document, file: str = "", folder: Path = Path()) -> MachineDescription:
    """Description without its effects, which the caller applies; raises `FileError`."""
    units = UnitSystem(**model.units.model_dump())
    context = Context(file, document, folder, units, model.materials, Gathered())
    description = MachineDescription(
        name=model.name,
        legs=tuple(_leg(name, leg, model, context) for name, leg in model.legs.items()),
        base=build_elements(model.base, context.at("base").inside("base")),
        platform=build_elements(model.platform, context.at("platform").inside("platform")),
        home=build_pose(model.home, context.at("home"), "home."),
        workspace=_workspace(model.workspace, context.at("workspace")),
        gravity=_gravity(model.gravity, context.at("gravity")),
        external_springs=tuple(
            _external_spring(name, spring, context.at("external_springs", name).inside(name))
            for name, spring in model.external_springs.items()
        ),
        title=model.title,
        source=model.source,
        extra=tuple((key, _tuples(value)) for key, value in model.extra.items()),
    )
    gathered = context.gathered
    return replace(
        description,
        uncertainty=tuple({**gathered.uncertainty, **model.uncertainty}.items()),
        notes=tuple({**gathered.notes, **model.notes}.items()),
    )


def _leg(name: str, leg: LegModel, model: MachineFile, context: Context) -> Leg:
    here = context.at("legs", name).inside(name)
    here.note(leg.note)
    if leg.template is not None:
        if leg.template not in model.templates:
            known = list(model.templates)
            near = suggestion(leg.template, known)
            here.at("template").fail(f"no template '{leg.template}'{near}; there are: {', '.join(known) or 'none'}")
        template = replace(here, path=("templates", leg.template))
        elements = build_elements(model.templates[leg.template], template)
    else:
        elements = build_elements(leg.elements or [], here.at("elements"))
    for joint, home in (leg.home or {}).items():
        elements = _with_home(elements, joint.split("."), home, here.at("home", joint).inside(joint))
    return Leg(name, (*_frame(leg, here, elements), *elements, *_attach(leg, here, elements)))


def _frame(leg: LegModel, context: Context, elements: tuple[Element, ...]) -> tuple[Element, ...]:
    if leg.frame is None:
        return ()
    here = context.at("frame")
    _refuse_taken("frame", elements, here)
    return (Offset("frame", build_pose(leg.frame, here.inside("frame"))),)


def _attach(leg: LegModel, context: Context, elements: tuple[Element, ...]) -> tuple[Element, ...]:
    if leg.attach is None:
        return ()
    here = context.at("attach")
    _refuse_taken("attach", elements, here)
    if leg.attach != "base_axes":
        return (Offset("attach", build_pose(leg.attach, here.inside("attach"))),)
    turned = build_pose(leg.frame, replace(context, gathered=Gathered()).at("frame"))
    return (Offset("attach", Pose(rotation=turned.inverse().rotation)),)


def _refuse_taken(name: str, elements: tuple[Element, ...], context: Context) -> None:
    if any(element.name == name for element in elements):
        context.fail(f"the leg already has an element called '{name}', which is the name of this offset")


def _with_home(
    elements: tuple[Element, ...], names: list[str], home: Number | list[Number], context: Context
) -> tuple[Element, ...]:
    """The sequence with other home coordinates of one joint, named from here on."""
    for i, element in enumerate(elements):
        if isinstance(element, Joint) and names == [element.name]:
            numbers = home if isinstance(home, list) else [home]
            if len(numbers) != len(element.axes):
                context.fail(f"joint {element.name} has {len(element.axes)} coordinates; found {len(numbers)}")
            dimension = LENGTH if element.kind == "prismatic" else ANGLE
            element = replace(element, home=home_coordinates(numbers, dimension, context))
            return (*elements[:i], element, *elements[i + 1 :])
        if isinstance(element, Block):
            for k, branch in enumerate(element.branches):
                if branch.name == names[0] and len(names) > 1:
                    inner = Branch(branch.name, _with_home(branch.elements, names[1:], home, context))
                    block = replace(element, branches=(*element.branches[:k], inner, *element.branches[k + 1 :]))
                    return (*elements[:i], block, *elements[i + 1 :])
    known = [e.name for e in elements if isinstance(e, Joint)]
    known += [f"{b.name}." for e in elements if isinstance(e, Block) for b in e.branches]
    context.fail(f"no joint '{names[-1]}' here{suggestion(names[-1], known)}; there are: {', '.join(known)}")


def _workspace(box: Box | None, context: Context) -> tuple[Vector, Vector] | None:
    if box is None:
        return None
    ranges = [build_range(getattr(box, axis), LENGTH, context, axis) for axis in "xyz"]
    (x0, x1), (y0, y1), (z0, z1) = ranges
    return (x0, y0, z0), (x1, y1, z1)


def _gravity(numbers: list[Number] | None, context: Context) -> Vector | None:
    if numbers is None:
        return None
    gravity = build_vector(numbers, NONE, context, "gravity")
    if max(abs(g) for g in gravity) > GRAVITY_LIMIT:
        context.fail(f"gravity is in m/s^2 whatever the length unit; found {list(gravity)}")
    return gravity


def _external_spring(name: str, model: ExternalSpringModel, context: Context) -> ExternalSpring:
    context.note(model.note)
    for key in ("stiffness", "length"):
        if getattr(model, key).value < 0.0:
            context.at(key).fail(f"must not be negative; found {getattr(model, key).value}")
    return ExternalSpring(
        name,
        model.point,
        build_vector(model.anchor, LENGTH, context, "anchor"),
        context.si(model.stiffness, Dimension(length=-1, force=1), "stiffness"),
        context.si(model.length, LENGTH, "length"),
        model.tension_only,
    )


def build_effect(model: EffectModel) -> AppliedEffect:
    """Record of an effect (already SI)."""
    return AppliedEffect(
        model.kind,
        model.element,
        tuple(model.legs),
        tuple(model.parameters.items()),
        tuple(model.options.items()),
    )


def _tuples(value: Any) -> Any:
    """Lists as tuples: a description is immutable."""
    if isinstance(value, list):
        return tuple(_tuples(v) for v in value)
    if isinstance(value, dict):
        return tuple((k, _tuples(v)) for k, v in value.items())
    return value
