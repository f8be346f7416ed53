"""The numbers that an element of a machine has, by their keys in a machine file."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache, partial
from typing import Any, NamedTuple

import numpy as np

from stiffmap.common.errors import StiffmapError
from stiffmap.common.units import INERTIA, MODULUS, Dimension
from stiffmap.model import beams
from stiffmap.model.description import Body, Cable, Element, Joint, Law, Offset, Pose, Spring
from stiffmap.model.description.numbers import DIRECTIONS, DeclaredNumber, numbers_of, with_entry, with_part
from stiffmap.model.description.pose import Vector
from stiffmap.model.description.strokes import Matrix6, entry_dimension

SHORT = {MODULUS: "Pa", Dimension(force=-1, angle=1): "1/N"}
POWERS = {1: "", 2: "²", 3: "³"}
UNBOUNDED = DeclaredNumber("")


@cache
def unit_text(d: Dimension, time: int = 0) -> str:
    """``N·m/rad``; dimensionless: empty."""
    if d in SHORT:
        return SHORT[d]
    units = (("N", d.force), ("kg", d.mass), ("m", d.length), ("rad", d.angle), ("s", time))
    above = "·".join(name + POWERS[power] for name, power in units if power > 0)
    below = [name + POWERS[-power] for name, power in units if power < 0]
    if not below:
        return above
    return f"{above or '1'}/{below[0]}" if len(below) == 1 else f"{above or '1'}/({'·'.join(below)})"


class Field(NamedTuple):
    """A number (SI) of an element: its value, its unit, and the element with another value in its place.

    ``listed`` is False for another way to give a number that is listed already; ``bounds`` are those of a design.
    """

    value: float
    unit: str
    put: Callable[[float], Any]
    listed: bool = True
    bounds: DeclaredNumber = UNBOUNDED

    def inside(self, around: Callable[[Any], Any]) -> Field:
        """The same number where its element is a part of something else."""
        return self._replace(put=lambda x: around(self.put(x)))


Fields = dict[str, Field]


def fields(element: Element) -> Fields:
    """Field names and numbers of one element, in the order of a file."""
    match element:
        case Offset():
            return _offset(element)
        case Joint():
            return _joint(element)
        case Spring():
            return _spring(element)
        case Body():
            return _body(element)
    return declared(element)


def field_of(element: Element, key: str) -> Field | None:
    """The number under this key, also of an entry below the diagonal of a matrix; None: the element has none."""
    word, _, entry = key.rpartition(".k")
    if word and entry.isdigit() and len(entry) == 2:
        key = f"{word}.k{''.join(sorted(entry))}"
    return fields(element).get(key)


def declared(holder: object, angular: bool = False) -> Fields:
    """The numbers that a dataclass declares and has."""
    out: Fields = {}
    for n in numbers_of(holder):
        value = getattr(holder, n.name)
        if value is None or not n.address:
            continue
        for i, key in enumerate(n.keys(value)):
            unit = unit_text(n.dimension(n.turns(i, angular)), n.time)
            out[key] = Field(value[i] if n.shape else value, unit, partial(with_part, holder, n, i), bounds=n)
    return out


def vector_fields(v: Vector, key: str, unit: str, put: Callable[[Any], Any]) -> Iterator[tuple[str, Field]]:
    """The three components of a vector; ``put`` makes what holds it from three other numbers."""
    for i, part in enumerate("xyz"):
        yield key + part, Field(v[i], unit, lambda x, i=i: put((*v[:i], x, *v[i + 1 :])))  # type: ignore[misc]


def _offset(e: Offset) -> Fields:
    def shifted(translation: Any) -> Offset:
        """Nominal at `translation`; an error of the machine as built is kept."""
        new = Pose.of(translation, e.nominal.r)
        if e.actual is None:
            return replace(e, nominal=new)
        return replace(e, nominal=new, actual=Pose.of(e.actual.p + new.p - e.nominal.p, e.actual.r))

    t = e.nominal.translation
    out = dict(vector_fields(t, "translation.", "m", shifted))
    length = float(np.linalg.norm(t))
    if length > 0.0:
        out["length"] = Field(length, "m", lambda x: shifted(_along(t, length, x)), listed=False)
    if (a := e.actual) is not None:
        built = vector_fields(
            a.translation, "actual.translation.", "m", lambda v: replace(e, actual=Pose(v, a.rotation))
        )
        out |= dict(built)
    return out


def _along(t: Vector, length: float, new: float) -> tuple[float, ...]:
    if not new > 0.0:
        raise StiffmapError(f"length: expected a positive number (m), got {new!r}")
    one = sum(1 for v in t if v != 0.0) == 1  # along an axis: exactly the number that was given
    return tuple(0.0 if v == 0.0 else float(np.copysign(new, v)) if one else v / length * new for v in t)


def _joint(e: Joint) -> Fields:
    angular = e.kind != "prismatic"
    own = declared(e, angular)
    places = ("home", "rest", "anchor.", "at.")
    before_laws = {key: field for key, field in own.items() if key.startswith(places)}
    laws = {} if isinstance(e, Cable) else _laws(e, angular)
    drive = {} if e.drive is None else declared(e.drive, angular)
    of_drive = {key: field.inside(lambda new: replace(e, drive=new)) for key, field in drive.items()}
    return {**before_laws, **laws, **own, **of_drive}


def _laws(e: Joint, angular: bool) -> Fields:
    out: Fields = {}
    for i, one in enumerate(e.axis_laws):
        out[f"stiffness.{i + 1}"] = _stiffness(one, angular).inside(partial(with_entry, e, "axis_laws", i))
    law = e.law
    if law is None:
        return out
    plain = not law.cubic and not law.knots
    stiffness = _stiffness(law, angular).inside(lambda new: replace(e, law=new))
    out["stiffness"] = stiffness._replace(listed=plain)
    out["law.stiffness"] = stiffness._replace(listed=not plain)
    if plain:
        unit = unit_text(entry_dimension("compliance", *(3 * angular,) * 2))
        out["compliance"] = Field(
            1.0 / law.stiffness, unit, lambda x: stiffness.put(1.0 / _positive(x)), listed=False
        )
    cubic = declared(law, angular)["cubic"].inside(lambda new: replace(e, law=new))
    out["law.cubic"] = cubic._replace(listed=law.cubic != 0.0)
    return out


def _stiffness(law: Law, angular: bool) -> Field:
    field = declared(law, angular)["stiffness"]
    return field._replace(put=lambda x: field.put(_positive(x)))


def _positive(value: float) -> float:
    if not value > 0.0:
        raise StiffmapError(f"expected a positive number, got {value!r}")
    return value


def _spring(e: Spring) -> Fields:
    out: Fields = {}
    word = "compliance" if e.compliance is not None else "stiffness"
    matrix: Matrix6 = getattr(e, word)
    beam = e.beam if e.beam is not None and beams.compliance(e.beam) == matrix else None
    for key, value in beam.numbers if beam is not None else ():

        def put(x: float, key: str = key) -> Spring:
            assert beam is not None
            new = beams.changed(beam, key, x)
            return replace(e, compliance=beams.compliance(new), beam=new)

        out[f"beam.{key}"] = Field(value, unit_text(beams.dimension(key)), put)
    entries = _symmetric(matrix, partial(entry_dimension, word), lambda m: replace(e, **{word: m}))
    for (i, j), field in entries.items():
        there = matrix[i][j] != 0.0 or i == j
        out[f"{word}.k{i + 1}{j + 1}"] = field._replace(listed=beam is None and there)
    for at, (i, law) in enumerate(e.laws):
        around = lambda new, at=at, i=i: with_entry(e, "laws", at, (i, new))  # noqa: E731
        out[f"laws.{DIRECTIONS[i]}.stiffness"] = declared(law, i > 2)["stiffness"].inside(around)
    zero_rest = {f"rest.{d}" for d, value in zip(DIRECTIONS, e.rest, strict=True) if not value}
    return out | {key: field for key, field in declared(e).items() if key not in zero_rest}


def _symmetric(
    matrix: tuple[tuple[float, ...], ...], unit: Callable[[int, int], Dimension], put: Callable[[Any], Any]
) -> dict[tuple[int, int], Field]:
    """The entries of the upper triangle by row and column; ``put`` makes the element with another matrix."""

    def changed(x: float, i: int, j: int) -> object:
        rows = [list(row) for row in matrix]
        rows[i][j] = rows[j][i] = x
        return put(tuple(tuple(row) for row in rows))

    pairs = [(i, j) for i in range(len(matrix)) for j in range(i, len(matrix))]
    return {(i, j): Field(matrix[i][j], unit_text(unit(i, j)), partial(changed, i=i, j=j)) for i, j in pairs}


def _body(e: Body) -> Fields:
    out = declared(e)
    entries = _symmetric(e.inertia, lambda i, j: INERTIA, lambda m: replace(e, inertia=m))
    bounds = {True: out["mass"].bounds, False: UNBOUNDED}
    terms = {
        f"inertia.{'xyz'[i]}{'xyz'[j]}": f._replace(bounds=bounds[i == j]) for (i, j), f in entries.items()
    }
    return out | {key: field for key, field in terms.items() if field.value != 0.0}
