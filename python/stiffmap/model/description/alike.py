"""What two machines have in common: where their joints close, and whether one step from the equilibrium of one leads to
that of the other (docs/fast_path.md F10); and whether one without load stays where it is commanded."""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import replace
from functools import lru_cache

from stiffmap.model.description.elements import Block, Body, Cable, Element, Joint, Offset, Point, Spring
from stiffmap.model.description.laws import Law
from stiffmap.model.description.machine import MachineDescription
from stiffmap.model.description.tree import ENDS, Elements, all_elements, chains, edit_all, edit_elements

KEPT = 128
"""Sequences whose geometry is kept: variants of a machine share most of theirs."""


def nominal_geometry(description: MachineDescription) -> Hashable:
    """Equal for machines whose joints close at the same places: they differ in springs, laws, masses and errors only."""
    d = description
    parts = tuple((name, _nominal_elements(elements)) for name, elements in chains(d))
    return parts, d.home, d.search_home, d.task, d.workspace


def straight(description: MachineDescription) -> MachineDescription:
    """The machine with linear drives and link springs; itself where they are."""
    d = edit_all(description, lambda elements, name: edit_elements(elements, _straight))
    return description if d == description else replace(d, effects=(), declared=None)


@lru_cache(maxsize=KEPT)
def _nominal_elements(elements: Elements) -> Elements:
    return edit_elements(elements, _nominal)


def _nominal(e: Element) -> Element:
    match e:
        case Offset():
            return replace(e, actual=None)
        case Joint():
            bare = replace(
                e, compliance_slope=0.0, sag=0.0, command_errors=(), guide_errors=(), friction=None
            )
            return replace(bare, law=None, axis_laws=(), rest=None, drive=None)
        case Spring():
            return Spring(e.name)
        case Body():
            return Body(e.name, 0.0)
    return e


def _straight(e: Element) -> Element:
    match e:
        case Joint(actuated=True, law=Law(stiffness=k)):
            return replace(e, law=Law(k))
        case Spring(laws=(_, *_)):
            return replace(e, laws=())
    return e


def alike(one: MachineDescription, other: MachineDescription, *, heavy: bool) -> bool:
    """Whether two machines differ in numbers of smooth laws, in errors of geometry and in masses only.

    Where branches share a load behind something that yields, the geometry between must be the same: the step takes
    their ends to be together already. Where they are `heavy` all must be: it leaves out how their weight turns
    with what gives way between.
    """
    if _whole(one) != _whole(other) or len(one.legs) != len(other.legs):
        return False
    shared = len(one.legs) > 1 and any(isinstance(e, (Spring, Joint, Block)) for e in one.base)

    def same(a: Elements, b: Elements, name: str) -> bool:
        of = _standing if shared and name not in ENDS else _solid
        return a is b or of(a, heavy) == of(b, heavy)

    pairs = zip(chains(one), chains(other), strict=True)
    return all(same(a, b, name) for (name, a), (_, b) in pairs)


def _whole(d: MachineDescription) -> tuple[object, ...]:
    return d.home, d.search_home, d.task, d.freedoms, d.gravity, d.external_springs


def _solid(elements: Elements, heavy: bool) -> Hashable:
    return tuple(_fixed(e, heavy) for e in elements if not isinstance(e, (Offset, Point)))


def _standing(elements: Elements, heavy: bool) -> Hashable:
    """The geometry as well, errors included."""
    return elements if heavy else tuple((_fixed(e, heavy), _frame(e)) for e in elements)


def _fixed(e: Element, heavy: bool) -> Hashable:
    """What one step must find as it is."""
    match e:
        case Joint() if not isinstance(e, Cable):
            plain = [law and not (law.cubic or law.knots or law.friction) for law in e.laws]
            laws = tuple("straight" if p else law for law, p in zip(e.laws, plain, strict=True))
            return e.kind, e.axes, e.home, e.actuated, e.friction, len(e.guide_errors), laws
        case Spring():
            zeros = tuple(v == 0.0 for row in e.compliance or e.stiffness or () for v in row)
            return e.laws, e.stroke, e.compliance is None, zeros
        case Body():
            return e.mass > 0.0
        case Block():
            return tuple(_standing(branch.elements, heavy) for branch in e.branches)
    return e


def _frame(e: Element) -> Element | None:
    """A joint without what gives way."""
    if not isinstance(e, Joint):
        return None
    return replace(e, law=None, axis_laws=(), compliance_slope=0.0, drive=None, rest=None)


def rests_at_command(description: MachineDescription) -> bool:
    """True where nothing but wrenches and gravity can deflect the machine: no geometric or command
    error, no preload, no passive joint with a spring, no external spring."""
    return not description.external_springs and not any(_strains(e) for _, e in all_elements(description))


def _strains(e: Element) -> bool:
    match e:
        case Offset():
            return e.actual is not None and e.actual != e.nominal
        case Cable():
            return True  # gravity or pretension may stretch it differently from what its controller believes
        case Joint():
            sprung = not e.actuated and any(e.laws)  # away from home
            return bool(e.command_errors or e.guide_errors or e.sag or sprung)
        case Spring():
            return any(e.rest)
    return False
