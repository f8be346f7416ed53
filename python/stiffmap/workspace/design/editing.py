"""Places in a machine file (``templates.leg.spring[foot].beam.EIz``, ``workspace.x[0]``), and machines whose numbers there change, made
quickly: only the elements that hold such a number are built again."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import partial, reduce
from operator import getitem
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter, ValidationError

from stiffmap.common.errors import StiffmapError
from stiffmap.common.units import LENGTH
from stiffmap.common.yaml_text import Document
from stiffmap.model.description import Element, MachineDescription
from stiffmap.model.description.pose import Vector
from stiffmap.model.description.tree import edit_path
from stiffmap.model.files.build_elements import build_element
from stiffmap.model.files.context import Context, Gathered
from stiffmap.model.files.load import describe_document, validate
from stiffmap.model.files.schema.elements import ElementModel

_STEP = re.compile(r"^([^\[\]]+)?((?:\[[^\[\]]+\])*)$")


def steps(place: str) -> list[str | int | tuple[str, str]]:
    """Keys, indices, and (sort, name) for an element of a chain."""
    out: list[str | int | tuple[str, str]] = []
    for part in place.split("."):
        match = _STEP.match(part)
        if not match or not part:
            raise StiffmapError(f"cannot read the place '{place}'")
        brackets = re.findall(r"\[([^\[\]]+)\]", match[2])
        if match[1] and len(brackets) == 1 and not brackets[0].isdigit():
            out.append((match[1], brackets[0]))
            continue
        if match[1]:
            out.append(match[1])
        out.extend(int(b) if b.isdigit() else b for b in brackets)
    return out


def edited(data: Any, values: dict[str, float]) -> Any:
    """A machine file's data with these numbers (place: value); StiffmapError names the step that is not there."""
    data = unshared(data)
    for place, value in values.items():
        _set(data, indices(data, place), value)
    return data


def indices(data: Any, place: str) -> tuple[str | int, ...]:
    """The place as keys and numbers alone; StiffmapError names the step that is not there."""
    at, out = data, list[str | int]()
    for step in steps(place):
        out.append(_key(at, step, place))
        at = at[out[-1]]
    return tuple(out)


def _key(at: Any, step: str | int | tuple[str, str], place: str) -> Any:
    if isinstance(step, tuple):
        sort, name = step
        if isinstance(at, dict) and sort in at and isinstance(at[sort], dict | list):
            raise StiffmapError(f"'{place}': write {sort}.{name}, not {sort}[{name}]")
        found = (
            [i for i, e in enumerate(at) if isinstance(e, dict) and str(e.get(sort)) == name]
            if isinstance(at, list)
            else []
        )
        if len(found) != 1:
            known = ", ".join(_elements(at)) or "none"
            raise StiffmapError(
                f"'{place}': expected one {sort} named '{name}', found {len(found)}; here are: {known}"
            )
        return found[0]
    if isinstance(step, int):
        if not isinstance(at, list) or step >= len(at):
            raise StiffmapError(f"'{place}': no entry [{step}] there")
        return step
    if not isinstance(at, dict) or step not in at:
        known = ", ".join(map(str, at)) if isinstance(at, dict) else ", ".join(_elements(at)) or "a number"
        raise StiffmapError(f"'{place}': no '{step}' there; here are: {known}")
    return step


def _elements(at: Any) -> list[str]:
    sorts = ("actuator", "joint", "spring", "body", "offset", "block", "point")
    if not isinstance(at, list):
        return []
    return [f"{s}[{e[s]}]" for e in at if isinstance(e, dict) for s in sorts if s in e]


def unshared(data: Any) -> Any:
    """Anchors of YAML are one object in several places: each place gets its own."""
    if isinstance(data, dict):
        return {k: unshared(v) for k, v in data.items()}
    if isinstance(data, list):
        return [unshared(v) for v in data]
    return data


Address = tuple[str | int, ...]
_MODEL: TypeAdapter[Any] = TypeAdapter(ElementModel)


def described(data: Any, document: Document, file: str) -> MachineDescription:
    """The machine of a file's data, with the lines of its document."""
    return describe_document(Document(data, document.lines), file, Path(file).parent)


class Editor:
    """Descriptions of one machine file with other numbers at given places.

    Places in elements of templates (or of legs without one) and in the workspace are edited in a description
    that was built once. `can` is False where a place lies elsewhere, or where the file has what ties
    elements together (effects, link files, strokes, bodies of links, homes per leg): the whole file is then to be built.
    Uncertainties and notes stay those of the file.
    """

    def __init__(self, document: Document, file: str, places: list[str]) -> None:
        self.document, self.file, self.places = document, file, places
        self.can = True
        try:
            self._prepare()
        except (StiffmapError, ValidationError, LookupError, TypeError):
            self.can = False

    def _prepare(self) -> None:
        data = self.document.data
        text = str(data)
        if data.get("effects") or "stroke" in text or "link:" in text or "'of':" in text:
            raise LookupError("tied together")
        model = validate(self.document, self.file)
        self.base: MachineDescription = described(data, self.document, self.file)
        self.context = Context(
            self.file, self.document, Path(self.file).parent, self.base.units, model.materials, Gathered()
        )
        self.elements: dict[tuple[Address, Address], list[tuple[str, Any]]] = {}
        self.space: list[tuple[str, Any]] = []
        for place in self.places:
            path = indices(data, place)
            if path[0] == "workspace" and len(path) == 3:
                self.space.append((place, path[1:]))
                continue
            sequence, inner = self._split(path)
            self.elements.setdefault((sequence, inner[: _depth(inner)]), []).append((place, inner))

    def _split(self, path: Address) -> tuple[Address, Address]:
        """Which sequence (``templates``, ``leg``) a path of keys is in, and the way inside it."""
        kind, name = path[0], str(path[1])
        if kind == "templates" and isinstance(path[2], int):
            legs = [leg for leg in self.document.data["legs"].values() if leg.get("template") == name]
            if any("home" in leg for leg in legs):
                raise LookupError("homes per leg")
            return ("templates", name), path[2:]
        if kind == "legs" and path[2] == "elements" and "home" not in self.document.data["legs"][name]:
            return ("legs", name, "elements"), path[3:]
        raise LookupError("a place outside elements and workspace")

    def description(self, values: dict[str, float]) -> MachineDescription:
        """The machine with these numbers (place: value in the file's units); StiffmapError where it cannot be."""
        if not self.can:
            return described(edited(self.document.data, values), self.document, self.file)
        built: dict[Address, dict[Address, Element]] = {}
        known: dict[str, Element] = {}
        for (sequence, address), places in self.elements.items():
            raw = unshared(reduce(getitem, (*sequence, *address), self.document.data))
            for place, inner in places:
                _set(raw, inner[len(address) :], values[place])
            key = repr(raw)
            if key not in known:
                known[key] = self._element(raw, (*sequence, *address))
            built.setdefault(sequence, {})[address] = known[key]
        legs = []
        for leg, model in zip(self.base.legs, self.document.data["legs"].values(), strict=True):
            own = ("templates", model["template"]) if "template" in model else ("legs", leg.name, "elements")
            elements = leg.elements
            for address, element in built.get(own, {}).items():
                path = ".".join([*map(str, address[2::3]), element.name])  # branches, then the element
                elements = edit_path(elements, path, partial(_if_alike, element)) or elements
            legs.append(replace(leg, elements=elements))
        return replace(self.base, legs=tuple(legs), workspace=self._workspace(values))

    def _element(self, raw: Any, address: Address) -> Element:
        here = self.context.at(*address)
        try:
            return build_element(_MODEL.validate_python(raw), here)
        except ValidationError as error:
            here.fail(str(error.errors()[0]["msg"]))

    def _workspace(self, values: dict[str, float]) -> tuple[Vector, Vector] | None:
        space = self.base.workspace
        if not self.space or space is None:
            return space
        corners = [list(corner) for corner in space]
        for place, (axis, end) in self.space:
            corners[int(end)]["xyz".index(axis)] = self.context.units.to_si(values[place], LENGTH)
        low, high = corners
        if any(a >= b for a, b in zip(low, high, strict=True)):
            self.context.at("workspace").fail(f"expected lowest below highest, got {low} and {high} m")
        return (low[0], low[1], low[2]), (high[0], high[1], high[2])


def _depth(inner: Address) -> int:
    """Length of the way to the innermost element: number, then ``branches``, name, number, and so on."""
    depth = 1
    while len(inner) > depth + 2 and inner[depth] == "branches":
        depth += 3
    return depth


def _if_alike(new: Element, old: Element) -> Element | None:
    """In place of an element of its sort: a body may be called as the spring that follows it."""
    return new if type(new) is type(old) else None


def _set(raw: Any, path: Address, value: float) -> None:
    for key in path[:-1]:
        raw = raw[key]
    last = path[-1]
    if isinstance(raw[last], dict) and "value" in raw[last]:
        raw[last]["value"] = value
    else:
        raw[last] = value
