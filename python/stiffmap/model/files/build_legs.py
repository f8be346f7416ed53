"""Legs: a template or their own elements, between a frame in the base and the platform."""

from __future__ import annotations

from dataclasses import replace

from stiffmap.common.errors import unknown_name
from stiffmap.model.description import Joint, Leg, Offset, Pose
from stiffmap.model.description.tree import ENDS, Elements, edit_path, walk
from stiffmap.model.files.build_elements import HOME, build_elements
from stiffmap.model.files.build_geometry import build_pose
from stiffmap.model.files.build_numbers import build_number
from stiffmap.model.files.context import Context, Gathered
from stiffmap.model.files.schema.base import Number
from stiffmap.model.files.schema.elements import ElementModel
from stiffmap.model.files.schema.machine import LegModel


def build_leg(name: str, leg: LegModel, templates: dict[str, list[ElementModel]], context: Context) -> Leg:
    """A leg placed in the base; raises `FileError`."""
    here = context.at("legs", name).named(name, leg)
    if name in ENDS:
        here.fail(f"'{name}' cannot be a leg's name: full names use it")
    problems = len(context.gathered.problems)
    if leg.template is not None:
        if leg.template not in templates:
            here.at("template").fail(unknown_name("template", leg.template, templates))
        template = replace(here, path=("templates", leg.template))
        elements = build_elements(templates[leg.template], template)
    else:
        elements = build_elements(leg.elements or [], here.at("elements"))
    if len(context.gathered.problems) > problems:
        context.raise_problems()  # what follows refers to the elements
    for joint, home in (leg.home or {}).items():
        elements = with_home(elements, joint, home, here.at("home", joint).inside(joint))
    first, last = (_end(end, leg, here, elements) for end in ("frame", "attach"))
    return Leg(name, (*first, *elements, *last))


def _end(name: str, leg: LegModel, context: Context, elements: Elements) -> Elements:
    """The offset that a leg begins (``frame``) or ends with (``attach``); none where the file gives none."""
    given, here = getattr(leg, name), context.at(name)
    if given is None:
        return ()
    if any(element.name == name for element in elements):
        here.fail(f"the leg already has an element called '{name}', which is the name of this offset")
    if given != "base_axes":
        return (Offset(name, build_pose(given, here.inside(name))),)
    turned = build_pose(leg.frame, replace(context, gathered=Gathered()).at("frame"))
    return (Offset(name, Pose(rotation=turned.inverse().rotation)),)


Home = Number | list[Number]


def with_home(elements: Elements, path: str, home: Home, context: Context) -> Elements:
    """The sequence with other home coordinates of the joint ``path`` (branches, then joint)."""
    edited = edit_path(elements, path, lambda e: _joint(e, home, context) if isinstance(e, Joint) else None)
    if edited is None:
        known = [name.partition(".")[2] for name, e in walk(elements, "") if isinstance(e, Joint)]
        context.fail(unknown_name("joint", path, known))
    return edited


def _joint(joint: Joint, home: Home, context: Context) -> Joint:
    numbers = home if isinstance(home, list) else [home]
    if len(numbers) != len(joint.axes):
        context.fail(f"joint '{joint.name}' has {len(joint.axes)} coordinates; found {len(numbers)}")
    return replace(joint, home=build_number(HOME, numbers, joint.kind != "prismatic", context))
