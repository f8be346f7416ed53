"""How poses are solved: the options that `Machine.solve`, maps, experiments and commands pass on."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from inspect import Parameter, signature
from typing import Any, ParamSpec, TypedDict, TypeVar, get_type_hints

import numpy as np
from numpy.typing import ArrayLike

from stiffmap.solve.closing import Start


@dataclass(frozen=True, eq=False)
class SolveOptions:
    """Everything about a solution but the machine, its poses and the wrench."""

    point: str = "tcp"
    """Named point where the wrench acts and displacement, stiffness and compliance are."""
    rotation: ArrayLike | None = None
    """(..., 3, 3), commanded orientation; None: as at home."""
    wrenches: Mapping[str, ArrayLike] = field(default_factory=dict)
    """More wrenches: point name -> (..., 6) N, N·m."""
    load_type: str | Mapping[str, str] = "dead"
    """How wrenches follow their bodies: dead, follower or semitangential; a mapping says it by point."""
    read_points: Sequence[str] = ()
    """Further points whose displacement is wanted."""
    gravity: ArrayLike | None = None
    """(3,) m/s², base axes; None: what the machine file says."""
    method: str = "fast"
    """``fast`` or ``reference``."""
    load_steps: int | str = "auto"
    """``auto`` (adaptive continuation) or the number of equal steps."""
    stiffness: bool = True
    """False: displacements, status, flags and iterations only."""
    start: Start | None = None
    """Joint coordinates that name the assembly mode: docs/conventions.md. None: that of home."""
    threads: int | None = None
    """None: all cores that this process may use."""

    def as_plain(self) -> dict[str, Any]:
        """What of the shared options changes numbers, as JSON data; threads do not."""
        out = {k: getattr(self, k) for k in ("point", "load_type", "method", "load_steps")}
        out |= {"rotation": _listed(self.rotation), "gravity": _listed(self.gravity)}
        if isinstance(self.start, Mapping):
            out["start"] = {k: _listed(v) for k, v in self.start.items()}
        elif self.start is not None:
            out["start"] = _listed(self.start)
        return out


def _listed(value: ArrayLike | None) -> object:
    return None if value is None else np.asarray(value, dtype=float).tolist()


class LoadingKeywords(TypedDict, total=False):
    """Fields of `SolveOptions` that one pose, a map, a polar diagram and a sweep share."""

    point: str
    rotation: ArrayLike | None
    gravity: ArrayLike | None
    load_type: str | Mapping[str, str]
    method: str
    load_steps: int | str
    start: Start | None
    threads: int | None


class SolveKeywords(LoadingKeywords, total=False):
    """All fields of `SolveOptions`, as keywords of `Machine.solve`."""

    wrenches: Mapping[str, ArrayLike] | None
    read_points: Sequence[str]
    stiffness: bool


P = ParamSpec("P")
R = TypeVar("R")


def spelled_out(keywords: type) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Let `help` and editors show the keywords (a TypedDict of fields of `SolveOptions`) that a function takes as ``**given``.

    What is called stays the function itself; a call pays nothing.
    """
    defaults = SolveOptions()
    known = get_type_hints(keywords)
    return _showing(
        Parameter(
            n,
            Parameter.KEYWORD_ONLY,
            default=None if n == "wrenches" else getattr(defaults, n),
            annotation=hint,
        )
        for n, hint in SolveOptions.__annotations__.items()
        if n in known
    )


def keywords_of(other: Callable[..., object]) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Let `help` and editors show the keywords of another function, to which this one hands its ``**call`` on."""
    return _showing(p for p in signature(other).parameters.values() if p.kind is Parameter.KEYWORD_ONLY)


def _showing(keywords: Iterable[Parameter]) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Let a function show these in the place of its ``**keywords``, those that it has itself apart."""
    more = list(keywords)

    def show(function: Callable[P, R]) -> Callable[P, R]:
        own = signature(function)
        shown = [p for p in own.parameters.values() if p.kind is not Parameter.VAR_KEYWORD]
        named = [p for p in more if p.name not in own.parameters]
        function.__signature__ = own.replace(parameters=[*shown, *named])  # type: ignore[attr-defined]
        return function

    return show


def options_of(given: SolveKeywords | LoadingKeywords) -> SolveOptions:
    """Options with some fields as given; TypeError for a keyword that is none."""
    known: dict[str, Any] = {k: v for k, v in given.items() if not (k == "wrenches" and v is None)}
    return SolveOptions(**known)
