"""Refuses YAML that would take the parser down: nested without end, or multiplied by its own anchors."""

from __future__ import annotations

from typing import Any

import yaml

from stiffmap.common.errors import FileError

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
            raise FileError(
                f"expected at most {MOST_VALUES} values with all anchors written out, found more",
                file=file,
                line=line,
            )
