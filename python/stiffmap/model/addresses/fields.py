"""The numbers that an element of a machine has, by their keys in a machine file."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from stiffmap.common.errors import StiffmapError
from stiffmap.model.addresses import beam as beams
from stiffmap.model.addresses import units
from stiffmap.model.description import Body, Cable, Element, Joint, Law, Offset, Point, Pose, Spring
from stiffmap.model.description.elements import Matrix6
from stiffmap.model.description.numbers import numbers_of
from stiffmap.model.description.pose import Vector

DIRECTIONS = ("tx", "ty", "tz", "rx", "ry", "rz")


class Field(NamedTuple):
    """A number (SI) of an element: its value, its unit, and the element with another value in its place.

    ``listed`` is False for another way to give a number that is listed already.
    """

    value: float
    unit: str
    put: Callable[[float], Element]
    listed: bool = True


def fields(element: Element) -> dict[str, Field]:
    """Field names and numbers of one element, in the order of a file."""
    match element:
        case Offset():
            return dict(_offset(element))
        case Joint():
            return dict(_joint(element))
        case Spring():
            return dict(_spring(element))
        case Body():
            return dict(_body(element))
        case Point():
            return dict(vector_fields(element, "offset", "at", units.METRE))
    return {}


def field_of(element: Element, key: str) -> Field | None:
    """The number under this key, also of an entry below the diagonal of a matrix; None: the element has none."""
    word, _, entry = key.rpartition(".k")
    if word and entry.isdigit() and len(entry) == 2:
        key = f"{word}.k{''.join(sorted(entry))}"
    return fields(element).get(key)


def vector_fields(holder: Any, name: str, key: str, unit: str) -> Iterator[tuple[str, Field]]:
    """The three components of a vector that a dataclass holds."""
    v: Vector = getattr(holder, name)
    for i, part in enumerate("xyz"):
        yield (
            f"{key}.{part}",
            Field(v[i], unit, lambda x, i=i: replace(holder, **{name: (*v[:i], x, *v[i + 1 :])})),  # type: ignore[misc]
        )


def _offset(e: Offset) -> Iterator[tuple[str, Field]]:
    def shifted(translation: Any) -> Offset:
        """Nominal at `translation`; an error of the machine as built is kept."""
        new = Pose.of(translation, e.nominal.r)
        if e.actual is None:
            return replace(e, nominal=new)
        return replace(e, nominal=new, actual=Pose.of(e.actual.p + new.p - e.nominal.p, e.actual.r))

    t = e.nominal.translation
    for i, part in enumerate("xyz"):
        yield (
            f"translation.{part}",
            Field(t[i], units.METRE, lambda x, i=i: shifted((*t[:i], x, *t[i + 1 :]))),  # type: ignore[misc]
        )
    length = float(np.linalg.norm(t))
    if length > 0.0:
        yield "length", Field(length, units.METRE, lambda x: shifted(_along(t, length, x)), listed=False)
    if e.actual is not None:
        a = e.actual
        for i, part in enumerate("xyz"):
            yield (
                f"actual.translation.{part}",
                Field(
                    a.translation[i],
                    units.METRE,
                    lambda x, i=i: replace(  # type: ignore[misc]
                        e, actual=Pose((*a.translation[:i], x, *a.translation[i + 1 :]), a.rotation)
                    ),
                ),
            )


def _along(t: Vector, length: float, new: float) -> tuple[float, ...]:
    if not new > 0.0:
        raise StiffmapError(f"length: expected a positive number (m), got {new!r}")
    one = sum(1 for v in t if v != 0.0) == 1  # along an axis: exactly the number that was given
    return tuple(0.0 if v == 0.0 else float(np.copysign(new, v)) if one else v / length * new for v in t)


def _joint(e: Joint) -> Iterator[tuple[str, Field]]:
    angular = e.kind != "prismatic"
    if not isinstance(e, Cable):
        yield from _listed_numbers(e, "home", "home", units.coordinate(angular))
        if e.rest is not None:
            yield from _listed_numbers(e, "rest", "rest", units.coordinate(angular))
        yield from _laws(e, angular)
    else:
        yield from vector_fields(e, "anchor", "anchor", units.METRE)
        yield from vector_fields(e, "at", "at", units.METRE)
    for holder in (e, e.drive):
        for n in () if holder is None else numbers_of(holder):
            value = getattr(holder, n.name)
            if value is None:
                continue
            unit = units.of_joint_number(n, angular)

            def put(new: Any, holder: Any = holder, name: str = n.name) -> Element:
                changed = replace(holder, **{name: new})
                return changed if isinstance(changed, Joint) else replace(e, drive=changed)

            if not n.interval:
                yield n.key, Field(value, unit, put)
                continue
            low, high = value
            yield f"{n.key}.low", Field(low, unit, lambda x, put=put, high=high: put((x, high)))  # type: ignore[misc]
            yield f"{n.key}.high", Field(high, unit, lambda x, put=put, low=low: put((low, x)))  # type: ignore[misc]


def _listed_numbers(holder: Any, name: str, key: str, unit: str) -> Iterator[tuple[str, Field]]:
    values = getattr(holder, name)
    for i, value in enumerate(values):
        yield (
            key if len(values) == 1 else f"{key}.{i + 1}",
            Field(value, unit, lambda x, i=i: replace(holder, **{name: (*values[:i], x, *values[i + 1 :])})),  # type: ignore[misc]
        )


def _laws(e: Joint, angular: bool) -> Iterator[tuple[str, Field]]:
    for i, own in enumerate(e.axis_laws):
        yield (
            f"stiffness.{i + 1}",
            Field(
                own.stiffness,
                units.STIFFNESS[2 * angular],
                lambda x, i=i, law=own: replace(  # type: ignore[misc]
                    e,
                    axis_laws=(
                        *e.axis_laws[:i],
                        replace(law, stiffness=_positive(x)),
                        *e.axis_laws[i + 1 :],
                    ),
                ),
            ),
        )
    law = e.law
    if law is None:
        return

    def put(x: float, law: Law = law) -> Joint:
        return replace(e, law=replace(law, stiffness=_positive(x)))

    plain = not law.cubic and not law.knots
    stiffness = Field(law.stiffness, units.STIFFNESS[2 * angular], put)
    yield "stiffness", stiffness._replace(listed=plain)
    yield "law.stiffness", stiffness._replace(listed=not plain)
    if plain:
        inverse = Field(1.0 / law.stiffness, units.COMPLIANCE[2 * angular], lambda x: put(1.0 / _positive(x)))
        yield "compliance", inverse._replace(listed=False)
    unit = "N·m/rad³" if angular else "N/m³"
    cubic = Field(law.cubic, unit, lambda x: replace(e, law=replace(law, cubic=x)))
    yield "law.cubic", cubic._replace(listed=law.cubic != 0.0)


def _positive(value: float) -> float:
    if not value > 0.0:
        raise StiffmapError(f"expected a positive number, got {value!r}")
    return value


def _spring(e: Spring) -> Iterator[tuple[str, Field]]:
    word = "compliance" if e.compliance is not None else "stiffness"
    matrix: Matrix6 = getattr(e, word)
    beam = e.beam if e.beam is not None and beams.compliance(e.beam) == matrix else None
    if beam is not None:
        for key, value in beam.numbers:

            def put(x: float, key: str = key) -> Spring:
                new = beams.changed(beam, key, x)
                return replace(e, compliance=beams.compliance(new), beam=new)

            yield f"beam.{key}", Field(value, units.of_beam(key), put)
    for i in range(6):
        for j in range(i, 6):
            there = matrix[i][j] != 0.0 or i == j
            yield (
                f"{word}.k{i + 1}{j + 1}",
                Field(
                    matrix[i][j],
                    units.of_entry(i, j, word),
                    lambda x, i=i, j=j: replace(e, **{word: with_entry(matrix, i, j, x)}),  # type: ignore[misc,arg-type]
                    listed=beam is None and there,
                ),
            )
    for i, law in e.laws:
        yield (
            f"laws.{DIRECTIONS[i]}.stiffness",
            Field(
                law.stiffness,
                units.STIFFNESS[2 * (i > 2)],
                lambda x, i=i, law=law: replace(  # type: ignore[misc]
                    e, laws=tuple((k, replace(law, stiffness=x) if k == i else o) for k, o in e.laws)
                ),
            ),
        )
    for i, value in enumerate(e.rest):
        if value:
            yield (
                f"rest.{DIRECTIONS[i]}",
                Field(
                    value,
                    units.coordinate(i > 2),
                    lambda x, i=i: replace(e, rest=(*e.rest[:i], x, *e.rest[i + 1 :])),  # type: ignore[misc]
                ),
            )


def with_entry(matrix: Matrix6, i: int, j: int, value: float) -> Matrix6:
    """A symmetric matrix with another value at (i, j) and (j, i)."""
    rows = [list(row) for row in matrix]
    rows[i][j] = rows[j][i] = value
    return tuple(tuple(row) for row in rows)


def _body(e: Body) -> Iterator[tuple[str, Field]]:
    yield "mass", Field(e.mass, units.KILOGRAM, lambda x: replace(e, mass=_positive(x) if x else x))
    yield from vector_fields(e, "com", "com", units.METRE)
    for i in range(3):
        for j in range(i, 3):
            if e.inertia[i][j] == 0.0:
                continue

            def put(x: float, i: int = i, j: int = j) -> Body:
                rows = [list(row) for row in e.inertia]
                rows[i][j] = rows[j][i] = x
                return replace(e, inertia=tuple(tuple(row) for row in rows))  # type: ignore[arg-type]

            yield f"inertia.{'xyz'[i]}{'xyz'[j]}", Field(e.inertia[i][j], "kg·m²", put)
