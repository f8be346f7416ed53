"""YAML text to plain data and back, with the line of every key.

Numbers follow YAML 1.2 (``1e6`` is a number, ``no`` is text); mapping keys are always text; a key
given twice is an error.
"""

from __future__ import annotations

import re
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from stiffmap.common.errors import FileError, StiffmapError, reading
from stiffmap.common.number_text import bounded

KeyPath = tuple[str | int, ...]
LONGEST_INTEGER = 300  # digits: what a float can hold


class _Loader(yaml.SafeLoader):
    file = ""


# YAML 1.2 core schema, in place of PyYAML's 1.1
_Loader.yaml_implicit_resolvers = {
    first: [(tag, regexp) for tag, regexp in entries if tag.rsplit(":", 1)[1] in ("null", "merge")]
    for first, entries in yaml.SafeLoader.yaml_implicit_resolvers.items()
}
_Loader.add_implicit_resolver(
    "tag:yaml.org,2002:bool", re.compile(r"^(?:true|false)$", re.IGNORECASE), list("tTfF")
)
_Loader.add_implicit_resolver("tag:yaml.org,2002:int", re.compile(r"^[-+]?[0-9]+$"), list("-+0123456789"))
_Loader.add_implicit_resolver(
    "tag:yaml.org,2002:float",
    re.compile(
        r"^(?:[-+]?(?:\.[0-9]+|[0-9]+(?:\.[0-9]*)?)(?:[eE][-+]?[0-9]+)?|[-+]?\.inf|\.nan)$", re.IGNORECASE
    ),
    list("-+.0123456789"),
)


def _construct_int(loader: Any, node: Any) -> int:
    digits = loader.construct_scalar(node)
    if len(digits) > LONGEST_INTEGER:
        raise yaml.constructor.ConstructorError(
            problem=f"expected an integer of at most {LONGEST_INTEGER} digits, found {len(digits)}",
            problem_mark=node.start_mark,
        )
    _sized(loader, node)
    return int(digits)  # decimal, also with a leading zero


def _sized(loader: Any, node: Any) -> float:
    """A number within the bounds of what is read."""
    try:
        return bounded(loader.construct_yaml_float(node))
    except StiffmapError as error:
        raise FileError(str(error), file=loader.file, line=node.start_mark.line + 1) from error


_MERGE = "tag:yaml.org,2002:merge"
_PLAIN = {f"tag:yaml.org,2002:{t}" for t in ("null", "bool", "int", "float", "str", "seq", "map")}
_Loader.add_constructor("tag:yaml.org,2002:int", _construct_int)
_Loader.add_constructor("tag:yaml.org,2002:float", _sized)
_Fast: Any = type("_Fast", (getattr(yaml, "CSafeLoader", yaml.SafeLoader),),
                  {"yaml_implicit_resolvers": _Loader.yaml_implicit_resolvers})  # fmt: skip
_READ_OTHERWISE = re.compile("[\t?!%\ufeff\x85\u2028\u2029]")
"""With these libyaml may accept what PyYAML refuses, or read it otherwise."""


@dataclass(frozen=True)
class Document:
    """Plain data of a file, and the line (from 1) at which each key path starts."""

    data: Any
    lines: dict[KeyPath, int] = field(default_factory=dict)

    def line(self, path: KeyPath) -> int | None:
        """Line of the longest part of ``path`` that exists in the file."""
        for n in range(len(path), 0, -1):
            if path[:n] in self.lines:
                return self.lines[path[:n]]
        return None


def parse(text: str, file: str = "") -> Document:
    """Parse YAML text; raises `FileError` with the line of a syntax error or a repeated key."""
    check_size(text, file)
    try:
        loader = _Loader(text)  # refuses characters that YAML has not
        loader.file = file
    except yaml.YAMLError as error:
        raise FileError(f"not valid YAML: {' '.join(str(error).split())}", file=file) from error
    try:
        node = _composed(loader, text)
        lines: dict[KeyPath, int] = {}
        if node is None:
            raise FileError("the file is empty", file=file)
        _text_keys(node, (), lines, file, ())
        return Document(loader.construct_document(node), lines)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        line = None if mark is None else mark.line + 1
        raise FileError(f"not valid YAML: {error.problem or error.context}", file=file, line=line) from error
    except FileError:
        raise
    except (yaml.YAMLError, ValueError) as error:  # ValueError: an explicit tag that does not fit, !!float x
        raise FileError(f"not valid YAML: {' '.join(str(error).split())}", file=file) from error
    finally:
        loader.dispose()


def _composed(loader: Any, text: str) -> Any:
    """By libyaml, a sixth of the time, where both read the same; what it refuses is judged by PyYAML."""
    if not _READ_OTHERWISE.search(text):
        with suppress(yaml.YAMLError):
            return _Fast(text).get_single_node()
    return loader.get_single_node()


def _text_keys(
    node: Any, path: KeyPath, lines: dict[KeyPath, int], file: str, above: tuple[int, ...]
) -> None:
    """Record lines, make every key text, and refuse repeated keys and self-containing anchors."""
    line = node.start_mark.line + 1
    lines.setdefault(path, line)
    if id(node) in above:
        raise FileError("an anchor contains itself", file=file, line=line)
    if node.tag not in _PLAIN:
        raise FileError(f"expected plain data, found the tag {node.tag}", file=file, line=line)
    above = (*above, id(node))
    if isinstance(node, yaml.SequenceNode):
        for i, item in enumerate(node.value):
            _text_keys(item, (*path, i), lines, file, above)
    elif isinstance(node, yaml.MappingNode):
        merges = [value for key, value in node.value if key.tag == _MERGE]
        # by the text of keys, of which the first source counts: PyYAML 6.0.4 compares their addresses
        pairs: dict[str, Any] = {}
        sources = [s for v in merges for s in (v.value if isinstance(v, yaml.SequenceNode) else [v])]
        for source in reversed(sources):
            if len(merges) > 1 or not isinstance(source, yaml.MappingNode):
                raise FileError("expected '<<' once, with a mapping or a list of them", file=file, line=line)
            _text_keys(source, path, lines, file, above)
            pairs |= {key.value: (key, value) for key, value in source.value}
        seen: set[str] = set()
        for key, value in (pair for pair in node.value if pair[0].tag != _MERGE):
            line = key.start_mark.line + 1
            if not isinstance(key, yaml.ScalarNode):
                raise FileError("a key must be plain text", file=file, line=line)
            key.tag = "tag:yaml.org,2002:str"
            here = (*path, key.value)
            if key.value in seen:
                where = ".".join(map(str, here))
                raise FileError(f"'{key.value}' is given twice", file=file, line=line, key=where)
            seen.add(key.value)
            lines[here] = line
            _text_keys(value, here, lines, file, above)
            pairs[key.value] = key, value
        node.value = [*pairs.values()]


def read(path: Path) -> Document:
    """Parse a file; raises `FileError` where it cannot be read."""
    try:
        with reading(path):
            text = path.read_text(encoding="utf-8")
    except UnicodeDecodeError as error:
        raise FileError("not UTF-8 text", file=str(path)) from error
    return parse(text, str(path))


_RESERVED = frozenset(["true", "false", "null", "yes", "no", "on", "off"])


class _Dumper(yaml.SafeDumper):
    def ignore_aliases(self, data: object) -> bool:
        return True


def _is_flat(data: Any) -> bool:
    return not any(isinstance(v, (list, dict)) for v in data)


def _list(dumper: Any, data: list[Any]) -> Any:
    flat = _is_flat(data) or all(isinstance(v, list) and _is_flat(v) and len(v) <= 3 for v in data)
    return dumper.represent_sequence("tag:yaml.org,2002:seq", data, flow_style=flat)


def _text(dumper: Any, data: str) -> Any:
    # quote what this module's reader or a YAML 1.1 reader would not read as text
    plain = re.fullmatch(r"[A-Za-z_][\w .,()/°²³·-]*", data) and data.lower() not in _RESERVED
    return dumper.represent_scalar("tag:yaml.org,2002:str", data, style=None if plain else '"')


_Dumper.add_representer(list, _list)
_Dumper.add_representer(str, _text)
_Dumper.add_multi_representer(np.generic, lambda dumper, data: dumper.represent_data(data.item()))  # type: ignore[type-abstract]


def text_of(data: Any) -> str:
    """YAML text; floats are written so that they read back exactly."""
    text: str = yaml.dump(data, Dumper=_Dumper, sort_keys=False, allow_unicode=True, width=100)
    return text


MOST_CHARACTERS = 20_000_000
DEEPEST = 60
MOST_VALUES = 500_000
"""After every anchor has been written out."""


def check_size(text: str, file: str = "") -> None:
    """FileError for text that is too long, too deep, or too large once its anchors are written out.

    Reads events only, which takes neither recursion nor copies. Errors of syntax are left to the reader.
    """
    if len(text) > MOST_CHARACTERS:
        raise FileError(f"expected at most {MOST_CHARACTERS} characters, found {len(text)}", file=file)
    # libyaml is fast, but has limits and faults of its own, by version: what it refuses is judged as the reader sees it.
    for loader in (getattr(yaml, "CSafeLoader", yaml.SafeLoader), yaml.SafeLoader):
        try:
            _check_events(yaml.parse(text, Loader=loader), file)
            return
        except yaml.YAMLError:
            continue


def _check_events(events: Any, file: str) -> None:
    anchored: dict[str, int] = {}
    open_: list[tuple[str | None, int]] = []  # anchor and number of values before it
    count = 0
    for event in events:
        line = event.start_mark.line + 1
        if isinstance(event, yaml.AliasEvent):
            count += anchored.get(str(event.anchor), 0)
        elif isinstance(event, yaml.CollectionStartEvent):
            open_.append((event.anchor, count))
            count += 1
        elif isinstance(event, yaml.ScalarEvent):
            count += 1
            if event.anchor:
                anchored[event.anchor] = 1
        elif isinstance(event, yaml.CollectionEndEvent):
            anchor, before = open_.pop()
            if anchor:
                anchored[anchor] = count - before
        if len(open_) > DEEPEST:
            raise FileError(
                f"expected at most {DEEPEST} levels inside each other, found more", file=file, line=line
            )
        if count > MOST_VALUES:
            what = f"expected at most {MOST_VALUES} values with all anchors written out, found more"
            raise FileError(what, file=file, line=line)
