"""Whether one step from the equilibrium of a machine leads to that of another: docs/fast_path.md F10."""

from __future__ import annotations

from dataclasses import replace

from stiffmap.model.description.elements import Block, Body, Cable, Element, Joint, Offset, Point, Spring
from stiffmap.model.description.laws import Law
from stiffmap.model.description.machine import MachineDescription

Elements = tuple[Element, ...]


def alike(one: MachineDescription, other: MachineDescription, *, heavy: bool) -> bool:
    """Whether two machines differ in numbers of smooth laws, in errors of geometry and in masses only.

    Where branches share a load behind something that yields, the geometry between must be the same: the step takes
    their ends to be together already. Where they are `heavy` all must be: it leaves out how their weight turns
    with what gives way between.
    """
    if _whole(one) != _whole(other) or len(one.legs) != len(other.legs):
        return False
    shared = len(one.legs) > 1 and any(isinstance(e, (Spring, Joint, Block)) for e in one.base)
    pairs = [(a.elements, b.elements) for a, b in zip(one.legs, other.legs, strict=True)]
    return (
        _sequence(one.base, other.base, heavy)
        and _sequence(one.platform, other.platform, heavy)
        and all((_still if shared else _sequence)(a, b, heavy) for a, b in pairs)
    )


def _whole(d: MachineDescription) -> tuple[object, ...]:
    return d.home, d.search_home, d.task, d.freedoms, d.gravity, d.external_springs


def _sequence(one: Elements, other: Elements, heavy: bool) -> bool:
    if one is other:
        return True
    a, b = _solid(one), _solid(other)
    return len(a) == len(b) and all(_element(x, y, heavy) for x, y in zip(a, b, strict=True))


def _still(one: Elements, other: Elements, heavy: bool) -> bool:
    """The same geometry, errors included."""
    if one is other or one == other:
        return True
    if heavy or len(one) != len(other):
        return False
    return all(
        _element(x, y, heavy)
        and not (isinstance(x, Joint) and isinstance(y, Joint) and _frame(x) != _frame(y))
        for x, y in zip(one, other, strict=True)
    )


def _solid(elements: Elements) -> Elements:
    return tuple(e for e in elements if not isinstance(e, (Offset, Point)))


def _element(one: Element, other: Element, heavy: bool) -> bool:
    if one is other:
        return True
    match one, other:
        case Joint(), Joint():
            return _joint(one, other)
        case Spring(), Spring():
            same = (one.laws, one.stroke) == (other.laws, other.stroke)
            return same and _rigid(one) == _rigid(other)
        case Body(), Body():
            return (one.mass > 0.0) == (other.mass > 0.0)
        case Block(), Block():
            pairs = zip(one.branches, other.branches, strict=False)
            same = len(one.branches) == len(other.branches)
            return same and all(_still(a.elements, b.elements, heavy) for a, b in pairs)
    return one == other


def _joint(one: Joint, other: Joint) -> bool:
    if isinstance(one, Cable) or isinstance(other, Cable):
        return one == other
    if (one.kind, one.axes, one.home, one.actuated, one.friction, len(one.guide_errors)) != (
        other.kind,
        other.axes,
        other.home,
        other.actuated,
        other.friction,
        len(other.guide_errors),
    ):
        return False
    return all(_law(a, b) for a, b in zip(one.laws, other.laws, strict=True))


def _law(one: Law | None, other: Law | None) -> bool:
    if one is None or other is None:
        return one is other
    return one == other if _bends(one) or _bends(other) else True


def _bends(law: Law) -> bool:
    return bool(law.cubic or law.knots or law.friction)


def _frame(e: Joint) -> Joint:
    return replace(e, law=None, axis_laws=(), compliance_slope=0.0, drive=None, rest=None)


def _rigid(e: Spring) -> tuple[bool, ...]:
    """Entries of the matrix that are zero."""
    matrix = e.compliance if e.compliance is not None else e.stiffness
    assert matrix is not None
    return (e.compliance is None, *(v == 0.0 for row in matrix for v in row))
