"""Where the numbers of a machine come from."""

from __future__ import annotations

from collections.abc import Mapping
from fnmatch import fnmatchcase

from stiffmap.common.number_text import percents
from stiffmap.model.description.machine import MachineDescription

SOURCES = ("assumed", "measured", "computed", "catalogue")
UNMARKED = "not marked"
MASSES = ("mass", "com", "inertia")
"""Numbers of an element that do not make it yield."""


def source_of(description: MachineDescription, element: str) -> str:
    """Where the stiffness of an element comes from: of its numbers the least sure, else as it is marked, else its leg, else a
    name with ``*``; ``not marked`` where nothing says it."""
    known = dict(description.sources)
    own = [s for k, s in known.items() if k.startswith(f"{element}/") and k.rpartition("/")[2] not in MASSES]
    if own:
        return min(own, key=SOURCES.index)
    name = element
    while name:
        if name in known:
            return known[name]
        name = name.rpartition(".")[0]
    return next((s for k, s in known.items() if "*" in k and fnmatchcase(element, k)), UNMARKED)


def in_words(by_source: Mapping[str, float]) -> str:
    """``83 % of it rests on assumed numbers, 17 % on computed ones``; empty where no number is marked or nothing moves."""
    if set(by_source) <= {UNMARKED}:
        return ""
    shares = zip(percents(list(by_source.values())), by_source, strict=True)
    shown = [f"{share} % of it rests on numbers that are {s}" for share, s in shares if share]
    more = (p.replace(" of it rests on numbers that are ", " on ") + " ones" for p in shown[1:])
    return ", ".join([*shown[:1], *more])
