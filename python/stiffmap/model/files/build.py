"""A validated file to the SI description of a machine."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from stiffmap.common.errors import unknown_name
from stiffmap.common.units import LENGTH, NONE, UnitSystem
from stiffmap.common.yaml_text import Document
from stiffmap.model.description import (
    TASK,
    AppliedEffect,
    ExternalSpring,
    Joint,
    Leg,
    MachineDescription,
    Offset,
    Pose,
)
from stiffmap.model.description.machine import GRAVITY_LIMIT
from stiffmap.model.description.pose import Vector
from stiffmap.model.description.strokes import as_rows
from stiffmap.model.description.tree import ENDS, Elements, edit_path, spring_points, walk
from stiffmap.model.files.build_elements import HOME, build_elements
from stiffmap.model.files.build_springs import with_strokes
from stiffmap.model.files.build_values import (
    build_number,
    build_numbers,
    build_pose,
    build_range,
    build_vector,
)
from stiffmap.model.files.context import Context, Gathered, LinkUse
from stiffmap.model.files.schema import MachineFile
from stiffmap.model.files.schema.base import BoxModel, Number
from stiffmap.model.files.schema.elements import ElementModel
from stiffmap.model.files.schema.machine import EffectModel, ExternalSpringModel, LegModel


def build(
    model: MachineFile, document: Document, file: str = "", folder: Path = Path()
) -> MachineDescription:
    """Description without its effects, which the caller applies; raises `FileError` with every problem."""
    units = UnitSystem(**model.units.model_dump())
    context = Context(file, document, folder, units, model.materials, Gathered())
    tried = context.attempt
    templates = {name: t for name, t in model.templates.items() if isinstance(t, list)}
    legs = [tried(build_leg, *leg, templates, context) for leg in model.legs.items()]
    springs = [
        tried(_external_spring, name, s, context.at("external_springs", name).named(name, s))
        for name, s in model.external_springs.items()
    ]
    home = tried(build_pose, model.home, context.at("home"), "home.") or Pose()
    description = MachineDescription(
        task=tuple(c for c in TASK if c in model.task),
        freedoms=tuple(c for c in TASK if c in model.freedoms),
        name=model.name,
        legs=tuple(leg for leg in legs if leg is not None),
        base=build_elements(model.base, context.at("base").inside("base")),
        platform=build_elements(model.platform, context.at("platform").inside("platform")),
        home=home,
        search_home=model.home is not None and model.home.solve,
        workspace=tried(build_workspace, model.workspace, context.at("workspace"), model.task, home),
        gravity=tried(_gravity, model.gravity, context.at("gravity")),
        external_springs=tuple(s for s in springs if s is not None),
        modal_damping=tried(_ratios, model.modal_damping, context.at("modal_damping")) or (),
        title=model.title,
        source=model.source,
        extra=tuple((key, _tuples(value)) for key, value in model.extra.items()),
        units=units,
    )
    context.raise_problems()
    gathered = context.gathered
    description = with_strokes(description, gathered)
    context.raise_problems()
    points = spring_points(description)
    for spring in description.external_springs:
        if spring.point not in points:
            here = context.at("external_springs", spring.name, "point")
            here.fail(unknown_name("point", spring.point, points))
    return replace(
        description,
        uncertainty=tuple({**gathered.uncertainty, **model.uncertainty}.items()),
        extra=with_links(description.extra, gathered.links, context),
        notes=tuple({**gathered.notes, **model.notes}.items()),
        sources=tuple({**gathered.sources, **model.sources}.items()),
    )


def build_workspace(
    box: BoxModel | None, context: Context, task: Sequence[str], home: Pose
) -> tuple[Vector, Vector] | None:
    """The box; flat at home along an axis that it leaves out, which the tool is not commanded along."""
    if box is None:
        return None
    ranges = []
    for axis, at_home in zip("xyz", home.translation, strict=True):
        given = getattr(box, axis)
        if given is None and axis in task:
            context.fail(
                f"missing key '{axis}': the tool is commanded along {axis} (task), so the box needs [min, max]"
            )
        if given is None:
            ranges.append((at_home, at_home))
            continue
        low, high = given
        if low.value != high.value:
            ranges.append(build_range(given, LENGTH, context, axis))
        elif axis in task:
            context.at(axis).fail(
                f"{low.value} to {high.value} is no interval; where the tool does not move, give some room around it: "
                f"[{float(low.value) - 1:g}, {float(high.value) + 1:g}]"
            )
        else:
            ranges.append((context.si(low, LENGTH),) * 2)
    (x0, x1), (y0, y1), (z0, z1) = ranges
    return (x0, y0, z0), (x1, y1, z1)


def _gravity(numbers: list[Number] | None, context: Context) -> Vector | None:
    if numbers is None:
        return None
    gravity = build_vector(numbers, NONE, context, "gravity")
    if max(abs(g) for g in gravity) > GRAVITY_LIMIT:
        context.fail(f"gravity is in m/s^2 whatever the length unit; found {list(gravity)}")
    return gravity


def _ratios(given: Number | list[Number] | None, context: Context) -> tuple[float, ...]:
    numbers = given if isinstance(given, list) else [] if given is None else [given]
    ratios = tuple(context.si(n, NONE, f"modal_damping.{i + 1}") for i, n in enumerate(numbers))
    if isinstance(given, list) and not ratios:
        context.fail("expected at least one damping ratio; found an empty list")
    for r in ratios:
        if not 0.0 <= r < 1.0:
            context.fail(f"expected damping ratios from 0 to below 1 (0.02 is 2 %); found {r:g}")
    return ratios


def _external_spring(name: str, model: ExternalSpringModel, context: Context) -> ExternalSpring:
    numbers = build_numbers(model, ExternalSpring, False, context)
    return ExternalSpring(name, model.point, **numbers, tension_only=model.tension_only)


def build_effect(model: EffectModel) -> AppliedEffect:
    """Record of an effect (already SI)."""
    numbers, words = tuple(model.parameters.items()), tuple(model.options.items())
    return AppliedEffect(model.kind, model.element, tuple(model.legs), numbers, words)


def _tuples(value: object) -> object:
    """Lists as tuples: a description is immutable."""
    if isinstance(value, list):
        return tuple(_tuples(v) for v in value)
    if isinstance(value, dict):
        return tuple((k, _tuples(v)) for k, v in value.items())
    return value


KEY = "link_covariance"
Extra = tuple[tuple[str, Any], ...]


def with_links(extra: Extra, new: dict[str, LinkUse], context: Context) -> Extra:
    """``extra`` with the covariances of springs that name link files, merged with those it keeps.

    A spring that now names a link file leaves the kept entry it was in. Springs of one file join, since one
    file is one error.

    Raises:
        FileError: the kept value is not (file, springs, 21 x 21 numbers) entries, or a file's covariance is
            another one than that kept for its other springs.
    """
    linked = {spring for use in new.values() for spring in use.springs}
    kept = {}
    for file, use in _kept(dict(extra).get(KEY, ()), context).items():
        if left := [s for s in use.springs if s not in linked]:
            kept[file] = LinkUse(use.covariance, left)
    for file, use in new.items():
        old = kept.setdefault(file, LinkUse(use.covariance))
        if old.covariance != use.covariance:
            context.at("extra", KEY).fail(
                f"{file} has another covariance than the one kept here for {', '.join(old.springs)}; "
                "let all its springs name the file"
            )
        old.springs.extend(use.springs)
    uses = tuple((file, tuple(use.springs), use.covariance) for file, use in kept.items())
    return tuple(e for e in extra if e[0] != KEY) + (((KEY, uses),) if uses else ())


def _kept(entries: Any, context: Context) -> dict[str, LinkUse]:
    kept = {}
    try:
        for file, springs, rows in entries:
            if np.array(rows, dtype=float).shape != (21, 21):
                raise ValueError
            kept[str(file)] = LinkUse(as_rows(rows), [str(s) for s in springs])
    except (TypeError, ValueError):
        context.at("extra", KEY).fail("expected [file, [springs], 21 x 21 numbers] per link file")
    return kept


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
    edited = edit_path(elements, path, lambda e: _at_home(e, home, context) if isinstance(e, Joint) else None)
    if edited is None:
        known = [name.partition(".")[2] for name, e in walk(elements, "") if isinstance(e, Joint)]
        context.fail(unknown_name("joint", path, known))
    return edited


def _at_home(joint: Joint, home: Home, context: Context) -> Joint:
    numbers = home if isinstance(home, list) else [home]
    if len(numbers) != len(joint.axes):
        context.fail(f"joint '{joint.name}' has {len(joint.axes)} coordinates; found {len(numbers)}")
    return replace(joint, home=build_number(HOME, numbers, joint.kind != "prismatic", context))
