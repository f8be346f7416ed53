"""The whole machine, and where its numbers come from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from typing import Any

from stiffmap.common.number_text import percents
from stiffmap.common.units import LENGTH, UnitSystem
from stiffmap.model.description.elements import Element
from stiffmap.model.description.numbers import required
from stiffmap.model.description.pose import Pose, Vector


@dataclass(frozen=True)
class Leg:
    """A chain from the base to the platform."""

    name: str
    elements: tuple[Element, ...]


@dataclass(frozen=True)
class ExternalSpring:
    """A straight spring between two points: a cable, a hose, a counterbalance.

    ``anchor`` is fixed in base axes (m); ``point`` is the full name of a `Point` on the machine, or ``tcp``.
    Force ``stiffness * (distance - length)`` along the line; zero when slack if ``tension_only``.
    """

    name: str
    point: str
    anchor: tuple[float, float, float] = required("anchor", fixed=LENGTH, shape="vector")
    stiffness: float = required("stiffness", coordinate=-1, effort=1, lower=0.0)
    length: float = required("length", fixed=LENGTH, lower=0.0)
    tension_only: bool = False


@dataclass(frozen=True)
class AppliedEffect:
    """Record of an effect that has been added: its kind, place and parameters (SI)."""

    kind: str
    element: str
    legs: tuple[str, ...] = ()
    parameters: tuple[tuple[str, float], ...] = ()
    options: tuple[tuple[str, str], ...] = ()


TASK = ("x", "y", "z", "rx", "ry", "rz")
GRAVITY_LIMIT = 1000.0  # m/s²; above it, mm/s² were given


@dataclass(frozen=True)
class MachineDescription:
    """Base elements, then legs in parallel, then platform elements; the last frame is the TCP.

    A serial arm has one leg. ``home`` is the TCP pose of the home configuration, in which every
    joint has its ``home`` coordinate; what the file's digits leave open is closed, and the closed
    configuration is the home that everything counts from (docs/machine_files.md). With ``search_home``
    the coordinates are a first guess. ``workspace`` is an axis-aligned box of TCP positions.
    ``task`` names the pose components that are commanded, translations along base axes, rotations about
    the axes of the commanded TCP frame; the machine's closure decides the others.
    ``gravity`` (m/s², base axes) applies unless a call says otherwise; ``None`` is none.
    A machine without legs hangs in its cables; ``freedoms`` names the components in which its platform can move
    (translations along base axes, rotations about those of the base at home), guides hold the others.
    ``modal_damping`` holds damping ratios of the modes, lowest frequency first, the last for all further ones;
    empty: none is declared.
    ``uncertainty`` holds a standard uncertainty (SI) of any number, keyed by
    ``full.element.name/field``; ``notes`` says where numbers come from, by the same keys, and so does
    ``sources``: assumed, measured, computed or catalogue; its keys may be names of elements, legs, or hold ``*``.
    ``declared`` is the machine before its effects were added (``None``: no effect has been);
    files save it together with the records in ``effects``. ``units`` are those of the file, for
    messages. Neither counts in comparisons.
    """

    name: str
    legs: tuple[Leg, ...]
    base: tuple[Element, ...] = ()
    platform: tuple[Element, ...] = ()
    home: Pose = field(default_factory=Pose)
    search_home: bool = False
    workspace: tuple[Vector, Vector] | None = None
    gravity: Vector | None = None
    external_springs: tuple[ExternalSpring, ...] = ()
    effects: tuple[AppliedEffect, ...] = ()
    task: tuple[str, ...] = TASK
    freedoms: tuple[str, ...] = TASK
    title: str = ""
    source: str = ""
    modal_damping: tuple[float, ...] = ()
    uncertainty: tuple[tuple[str, float], ...] = ()
    notes: tuple[tuple[str, str], ...] = ()
    sources: tuple[tuple[str, str], ...] = ()
    extra: tuple[tuple[str, Any], ...] = ()
    declared: MachineDescription | None = field(default=None, compare=False)
    units: UnitSystem = field(default=UnitSystem(), compare=False)


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
