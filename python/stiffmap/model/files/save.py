"""Writing machine files, with the promise that they load back equal."""

from __future__ import annotations

from dataclasses import fields, replace
from os import PathLike

import yaml

from stiffmap.common.errors import StiffmapError
from stiffmap.common.outputs import write_text
from stiffmap.common.yaml_text import text_of
from stiffmap.model.description import TASK, AppliedEffect, Element, Joint, Leg, MachineDescription, Offset
from stiffmap.model.description.tree import Elements, edit_elements, walk
from stiffmap.model.files.dump_elements import Plain, dump_elements, dump_numbers, dump_pose, floats
from stiffmap.model.files.load import description_from_text


def save_description(description: MachineDescription, path: str | PathLike[str]) -> None:
    """Write a machine file (SI units) that loads back equal, floats exactly.

    A machine with effects is saved as the declared machine and its effect records.
    Raises `StiffmapError` where a file cannot hold the machine, or cannot be written.
    """
    write_text(path, description_text(description))


def description_text(description: MachineDescription) -> str:
    """The text that `save_description` writes; raises `StiffmapError`."""
    try:
        text = text_of(dump(description))
        back = description_from_text(text, f"machine '{description.name}' as a file")
    except yaml.YAMLError as error:
        raise StiffmapError(f"machine '{description.name}' cannot be saved: {error}") from error
    if back != description:
        compared = [f.name for f in fields(description) if f.compare]
        changed = [name for name in compared if getattr(back, name) != getattr(description, name)]
        raise StiffmapError(
            f"machine '{description.name}' cannot be saved unchanged: a file would not keep its "
            f"{', '.join(changed)}"
        )
    return text


UNITS = {"length": "m", "force": "N", "angle": "rad", "mass": "kg"}
TEMPLATE = "leg"


def dump(description: MachineDescription) -> Plain:
    """Plain data of the declared machine and of the effects added to it.

    Uncertainties, sources and notes are gathered at the end, by full names. Raises `StiffmapError` for a
    machine with effects whose declared machine is unknown.
    """
    declared = description.declared or description
    if description.effects and description.declared is None:
        raise StiffmapError(
            f"machine '{description.name}' has effects but not the machine before them (`declared`), "
            "so it cannot be saved"
        )
    plain: Plain = {
        "name": description.name,
        "title": description.title,
        "source": description.source,
        "units": dict(UNITS),
        "gravity": None if declared.gravity is None else floats(declared.gravity),
        "home": {**dump_pose(declared.home), **({"solve": True} if declared.search_home else {})},
        "task": None if declared.task == TASK else list(declared.task),
        "freedoms": None if declared.freedoms == TASK else list(declared.freedoms),
        "workspace": declared.workspace
        and {
            axis: floats(ends)
            for axis, ends in zip("xyz", zip(*declared.workspace, strict=True), strict=True)
        },
        **_legs(declared.legs),
        "base": dump_elements(declared.base),
        "platform": dump_elements(declared.platform),
        "modal_damping": floats(declared.modal_damping),
        "external_springs": {
            s.name: {"point": s.point, **dump_numbers(s), "tension_only": bool(s.tension_only)}
            for s in declared.external_springs
        },
        "effects": [dump_effect(effect) for effect in description.effects],
        "uncertainty": {key: float(value) for key, value in description.uncertainty},
        "sources": dict(description.sources),
        "notes": dict(description.notes),
        "extra": {key: _lists(value) for key, value in description.extra},
    }
    return {key: value for key, value in plain.items() if value not in (None, "", [], {})}


def dump_effect(effect: AppliedEffect) -> Plain:
    """An effect, in SI units."""
    return {
        "kind": effect.kind,
        "element": effect.element,
        "legs": list(effect.legs),
        "parameters": {key: float(value) for key, value in effect.parameters},
        "options": dict(effect.options),
    }


def _legs(legs: tuple[Leg, ...]) -> Plain:
    """Legs that differ by their frames and home coordinates only share a template."""
    if not legs:
        return {}
    placed = [_placed(leg) for leg in legs]
    middles = [middle for _, middle in placed]
    template = middles[0]
    bare = [edit_elements(middle, _without_home) for middle in middles]
    shared = len(legs) > 1 and all(b == bare[0] for b in bare)
    plain = {}
    for leg, (ends, middle) in zip(legs, placed, strict=True):
        chain: Plain = {"template": TEMPLATE} if shared else {"elements": dump_elements(middle)}
        home = _different_homes(middle, template) if shared else {}
        plain[leg.name] = {**chain, **ends, **({"home": home} if home else {})}
    return {"templates": {TEMPLATE: dump_elements(template)} if shared else {}, "legs": plain}


def _placed(leg: Leg) -> tuple[Plain, Elements]:
    """Frame and attachment of a leg, and the elements between."""
    ends: Plain = {}
    middle = list(leg.elements)
    for name, i in (("frame", 0), ("attach", -1)):
        match middle and middle[i]:
            case Offset(found, pose, None) if found == name:
                ends[name] = dump_pose(pose)
                del middle[i]
    return ends, tuple(middle)


def _without_home(element: Element) -> Element:
    return replace(element, home=(0.0,) * len(element.home)) if isinstance(element, Joint) else element


def _different_homes(elements: Elements, template: Elements) -> Plain:
    pairs = zip(walk(elements, ""), walk(template, ""), strict=True)
    return {
        name.removeprefix("."): dump_numbers(joint)["home"]
        for (name, joint), (_, other) in pairs
        if isinstance(joint, Joint) and isinstance(other, Joint) and joint.home != other.home
    }


def _lists(value: object) -> object:
    return [_lists(v) for v in value] if isinstance(value, (tuple, list)) else value
