"""Templates with parameters: unlike legs of one kind, each in one line.

``$name`` in a template's elements stands for a parameter; ``$length/2`` and other sums, products and quotients
are computed from the numbers of the file, in the file's units.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from stiffmap.common.arithmetic import sum_of_numbers
from stiffmap.common.errors import FileError, suggestion, together, unknown_name
from stiffmap.common.yaml_text import Document, KeyPath
from stiffmap.model.files.report import key_text
from stiffmap.model.files.schema.base import describe, unknown_key

_REFERENCE = re.compile(r"\$([A-Za-z_]\w*)")


def expanded(document: Document, file: str) -> Document:
    """The document with the elements written out of every leg whose template has parameters.

    Raises `FileError` with every problem found; other mistakes are left to the schema.
    """
    data = document.data
    templates = data.get("templates")
    if not isinstance(templates, dict) or not isinstance(data.get("legs"), dict):
        return document
    with_parameters = {name: t for name, t in templates.items() if isinstance(t, dict)}
    work = _Expansion(document, file, with_parameters, [str(t) for t in templates])
    legs = {name: work.leg(name, leg) for name, leg in data["legs"].items()}
    if work.problems:
        raise together(work.problems)
    kept = {name: t for name, t in templates.items() if name not in with_parameters}
    return Document({**data, "templates": kept, "legs": legs}, work.lines)


class _Expansion:
    def __init__(self, document: Document, file: str, templates: Mapping[Any, Any], names: list[str]) -> None:
        self.document, self.file, self.templates, self.names = document, file, templates, names
        self.lines = dict(document.lines)
        self.problems: list[FileError] = []
        for name, template in templates.items():
            known = ("parameters", "elements")
            for key in template:
                if key not in known:
                    self._fail(("templates", name, key), unknown_key(key, known))
            if not isinstance(template.get("elements"), list):
                self._fail(("templates", name), "a template with parameters needs a list of elements")
            if not isinstance(template.get("parameters", {}), dict):
                self._fail(
                    ("templates", name, "parameters"), "expected a mapping of names to numbers or nothing"
                )
        self.sound = not self.problems

    def leg(self, name: str, leg: Any) -> object:
        """A leg of the file with its elements written out; other legs as they are."""
        asked = leg.get("template") if isinstance(leg, dict) else None
        if not isinstance(asked, str | int) or not self.sound:
            return leg
        asked = str(asked)  # template 1 reads as a number in YAML
        if self.templates and asked not in self.names:
            self._fail(("legs", name, "template"), unknown_name("template", asked, self.names))
        if asked not in self.templates:
            return leg
        template = self.templates[asked]
        declared = template.get("parameters") or {}
        given = leg.get("with") or {}
        if not isinstance(given, dict):
            self._fail(("legs", name, "with"), f"expected a mapping of parameters; found {describe(given)}")
            return leg
        for key in given:
            if key not in declared:
                self._fail(("legs", name, "with", key), unknown_name("parameter", str(key), declared))
        values = {**declared, **given}
        missing = [key for key, value in values.items() if value is None]
        if missing:
            self._fail(("legs", name), f"the template needs {', '.join(missing)} under 'with'")
            return leg
        source: KeyPath = ("templates", asked, "elements")
        target: KeyPath = ("legs", name, "elements")
        for path, line in self.document.lines.items():
            if path[: len(source)] == source:
                self.lines[target + path[len(source) :]] = line
        rest = {key: value for key, value in leg.items() if key not in ("template", "with")}
        return {**rest, "elements": self._written(template["elements"], source, values)}

    def _written(self, data: object, path: KeyPath, values: Mapping[str, object]) -> object:
        """Plain data with every reference replaced."""
        if isinstance(data, dict):
            return {key: self._written(value, (*path, key), values) for key, value in data.items()}
        if isinstance(data, list):
            return [self._written(value, (*path, i), values) for i, value in enumerate(data)]
        if not isinstance(data, str) or "$" not in data:
            return data
        unknown = [name for name in _REFERENCE.findall(data) if name not in values]
        if unknown:
            near = suggestion(unknown[0], values)
            self._fail(path, f"no parameter '{unknown[0]}'{near}; there are: {', '.join(values)}")
            return data
        alone = _REFERENCE.fullmatch(data.strip())
        if alone:
            return values[alone[1]]
        try:
            return sum_of_numbers(_REFERENCE.sub(lambda m: repr(_number(m[1], values)), data))
        except (SyntaxError, TypeError, ZeroDivisionError, RecursionError, MemoryError):
            self._fail(
                path, f"expected $name, or numbers and $names with + - * / ( ); found {describe(data)}"
            )
            return data

    def _fail(self, path: KeyPath, message: str) -> None:
        line = self.document.line(path)
        self.problems.append(FileError(message, file=self.file, line=line, key=key_text(path)))


def _number(name: str, values: Mapping[str, object]) -> float:
    value = values[name]
    if isinstance(value, dict):  # with its uncertainty, which a formula does not keep
        value = value.get("value")
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise TypeError(name)
    return float(value)
