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
from stiffmap.common.yaml_text import Document
from stiffmap.model.description import Element, MachineDescription
from stiffmap.model.description.pose import Vector
from stiffmap.model.description.tree import edit_path
from stiffmap.model.files.build import build_workspace
from stiffmap.model.files.build_elements import build_element
from stiffmap.model.files.context import Context, Gathered
from stiffmap.model.files.load import describe_document, validate
from stiffmap.model.files.schema.base import BoxModel
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


def edited(data: object, values: dict[str, float]) -> Any:
    """A machine file's data with these numbers (place: value); StiffmapError names the step that is not there."""
    data = unshared(data)
    for place, value in values.items():
        _set(data, indices(data, place), value)
    return data


def indices(data: object, place: str) -> tuple[str | int, ...]:
    """The place as keys and numbers alone; StiffmapError names the step that is not there."""
    at: Any = data
    out: list[str | int] = []
    for step in steps(place):
        out.append(_key(at, step, place))
        at = at[out[-1]]
    return tuple(out)


def _key(at: object, step: str | int | tuple[str, str], place: str) -> str | int:
    if isinstance(step, tuple):
        sort, name = step
        if isinstance(at, dict) and sort in at and isinstance(at[sort], dict | list):
            raise StiffmapError(f"'{place}': write {sort}.{name}, not {sort}[{name}]")
        row = at if isinstance(at, list) else []
        found = [i for i, e in enumerate(row) if isinstance(e, dict) and str(e.get(sort)) == name]
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


def _elements(at: object) -> list[str]:
    sorts = ("actuator", "joint", "spring", "body", "offset", "block", "point")
    if not isinstance(at, list):
        return []
    return [f"{s}[{e[s]}]" for e in at if isinstance(e, dict) for s in sorts if s in e]


def unshared(data: object) -> Any:
    """Anchors of YAML are one object in several places: each place gets its own."""
    if isinstance(data, dict):
        return {k: unshared(v) for k, v in data.items()}
    if isinstance(data, list):
        return [unshared(v) for v in data]
    return data


Address = tuple[str | int, ...]
_MODEL: TypeAdapter[Any] = TypeAdapter(ElementModel)


def described(data: object, document: Document, file: str) -> MachineDescription:
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
        self.document, self.file = document, file
        self.can = True
        try:
            self._prepare(places)
        except (StiffmapError, ValidationError, LookupError, TypeError):
            self.can = False

    def _prepare(self, places: list[str]) -> None:
        data = self.document.data
        text = str(data)
        if data.get("effects") or "stroke" in text or "link:" in text or "'of':" in text:
            raise LookupError("tied together")
        model = validate(self.document, self.file)
        self.base: MachineDescription = described(data, self.document, self.file)
        self.context = Context(
            self.file, self.document, Path(self.file).parent, self.base.units, model.materials, Gathered()
        )
        self.elements: dict[tuple[Address, Address], list[tuple[str, Address]]] = {}
        self.space: list[tuple[str, Address]] = []
        for place in places:
            path = indices(data, place)
            if path[0] == "workspace" and len(path) == 3:
                self.space.append((place, path[1:]))
                continue
            start = _start(path)
            end = start + _depth(path[start:])
            self.elements.setdefault((path[:start], path[start:end]), []).append((place, path[end:]))
        self.legs = {sequence: self._legs_of(sequence) for sequence, _ in self.elements}

    def _legs_of(self, sequence: Address) -> list[str]:
        """Names of the legs that are made of a sequence."""
        name, legs = str(sequence[1]), self.document.data["legs"]
        users = [name] if sequence[0] == "legs" else [n for n in legs if legs[n].get("template") == name]
        if any("home" in legs[n] for n in users):
            raise LookupError("homes per leg")
        return users

    def description(self, values: dict[str, float]) -> MachineDescription:
        """The machine with these numbers (place: value in the file's units); StiffmapError where it cannot be."""
        if not self.can:
            return described(edited(self.document.data, values), self.document, self.file)
        known: dict[str, Element] = {}
        legs = {leg.name: leg for leg in self.base.legs}
        for (sequence, address), places in self.elements.items():
            raw = self._raw((*sequence, *address), places, values)
            key = repr(raw)
            if key not in known:
                known[key] = self._element(raw, (*sequence, *address))
            path = ".".join([*map(str, address[2::3]), known[key].name])  # branches, then the element
            for name in self.legs[sequence]:
                elements = edit_path(legs[name].elements, path, partial(_if_alike, known[key]))
                legs[name] = replace(legs[name], elements=elements or legs[name].elements)
        return replace(self.base, legs=tuple(legs.values()), workspace=self._workspace(values))

    def _raw(self, at: Address, places: list[tuple[str, Address]], values: dict[str, float]) -> Any:
        """A part of the file's data with the numbers of some places, each with the way to it inside the part."""
        raw = unshared(reduce(getitem, at, self.document.data))
        for place, inner in places:
            _set(raw, inner, values[place])
        return raw

    def _element(self, raw: object, address: Address) -> Element:
        here = self.context.at(*address)
        try:
            return build_element(_MODEL.validate_python(raw), here)
        except ValidationError as error:
            first = error.errors()[0]
            here.fail(str(first.get("ctx", {}).get("error", first["msg"])))

    def _workspace(self, values: dict[str, float]) -> tuple[Vector, Vector] | None:
        if not self.space:
            return self.base.workspace
        box = BoxModel.model_validate(self._raw(("workspace",), self.space, values))
        return build_workspace(box, self.context.at("workspace"), self.base.task, self.base.home)


def _start(path: Address) -> int:
    """Length of the way to the sequence of a template or leg."""
    if path[0] == "templates" and isinstance(path[2], int):
        return 2
    if path[0] == "legs" and path[2] == "elements":
        return 3
    raise LookupError("a place outside elements and workspace")


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
