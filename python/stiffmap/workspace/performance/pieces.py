"""Links in pieces: the mass of a uniform bar along its length, and its spring with it (docs/measures.md)."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np

from stiffmap.common.broadcasting import Floats, whole_number
from stiffmap.common.errors import StiffmapError
from stiffmap.model.beams import cantilever_compliance
from stiffmap.model.description import Body, Offset, Pose, Spring
from stiffmap.model.description.elements import Element
from stiffmap.model.description.tree import Elements, edit_all, edit_sequences
from stiffmap.solve.machine import Machine, takes_machine

LIKE = 1e-6  # relative difference up to which a spring is that of a uniform beam, and a mass is in its middle


@takes_machine
def in_pieces(machine: Machine, pieces: int) -> Machine:
    """The machine with the mass of every uniform bar on `pieces` places along it, with as much of its spring each.

    A uniform bar is an offset along one axis, the spring of an Euler-Bernoulli beam of that length behind it,
    and a body in the middle between. Statics stay as they are (up to the order of rotations of a spring),
    frequencies tend to those of the continuous bar with the square of the number. The last piece keeps the
    names. Other links stay one mass and one spring. Raises StiffmapError where there is no such bar.
    """
    count = whole_number(pieces, "pieces", 1, what="a number from 1 on")
    found: list[str] = []
    divide = partial(_divided, count=count, found=found)
    divided = edit_all(machine.description, lambda elements, name: edit_sequences(elements, divide))
    if not found:
        raise StiffmapError(
            f"{machine.name}: no uniform bar (offset, body in its middle, spring of a beam of that length)"
        )
    return Machine(divided)


def _divided(elements: Elements, count: int, found: list[str]) -> Elements:
    out, i = list[Element](), 0
    while i < len(elements):
        bar = _bar(elements, i)
        if bar is None:
            out.append(elements[i])
            i += 1
            continue
        found.append(bar[2].name)
        out.extend(_pieces(*bar, count))
        i += 3
    return tuple(out)


def _bar(elements: Elements, i: int) -> tuple[Offset, Body, Spring] | None:
    """Offset, body (centre as seen from the root) and spring of a bar, the three elements from `i` on."""
    row = elements[i : i + 3]
    if len(row) < 3 or not isinstance(row[2], Spring):
        return None
    offset, body, share = row[0], row[1], -0.5
    if isinstance(row[0], Body):
        offset, body, share = row[1], row[0], 0.5
    if not isinstance(offset, Offset) or not isinstance(body, Body) or offset.actual is not None:
        return None
    way = np.asarray(offset.nominal.p, dtype=float)
    length = float(np.linalg.norm(way))
    straight = np.count_nonzero(way) == 1 and np.array_equal(offset.nominal.r, np.eye(3))
    middle = np.linalg.norm(np.array(body.com) - share * way) <= LIKE * length
    if not (straight and middle and _is_beam(row[2], way)):
        return None
    return offset, body, row[2]


def _is_beam(spring: Spring, way: Floats) -> bool:
    if spring.compliance is None or spring.laws or any(spring.rest) or spring.stroke is not None:
        return False
    c = np.asarray(spring.compliance, dtype=float)
    pattern = _piece(way, c, 1)
    size = np.sqrt(np.outer(np.diag(c), np.diag(c)))
    return bool((np.abs(c - pattern) <= LIKE * size).all())


def _piece(way: Floats, compliance: Floats, count: int) -> Floats:
    """(6, 6) of one of so many equal pieces of a cantilever along `way` that has this diagonal."""
    length, a = float(np.linalg.norm(way)), int(np.argmax(np.abs(way)))
    along = "-" * bool(way[a] < 0) + "xyz"[a]
    of = [a, *(3 + (a + k) % 3 for k in range(3))]  # along it, about it, about the axes that follow
    with np.errstate(divide="ignore"):
        products = length / np.diag(compliance)[of]
    return cantilever_compliance(length / count, along, *products)


def _pieces(offset: Offset, body: Body, spring: Spring, count: int) -> list[Element]:
    way = np.asarray(offset.nominal.p, dtype=float)
    small = _piece(way, np.asarray(spring.compliance, dtype=float), count)
    step, length, a = way / count, float(np.linalg.norm(way)), int(np.argmax(np.abs(way)))
    move = replace(offset.nominal, translation=tuple(step.tolist()))
    inertia = np.array(body.inertia, dtype=float)
    spread = body.mass * length**2 / 12 * (1 - 1 / count**2)  # what the places along the bar make up for
    for axis in ((a + 1) % 3, (a + 2) % 3):
        inertia[axis, axis] = max(inertia[axis, axis] - spread, 0.0)
    rows = Pose.of(rotation=inertia / count).rotation
    springs = tuple(map(tuple, small.tolist()))
    middle = tuple((-step / 2).tolist())
    out: list[Element] = []
    for k in range(1, count + 1):
        end = "" if k == count else f"_{k}"
        out += [
            replace(offset, name=offset.name + end, nominal=move),
            replace(body, name=body.name + end, mass=body.mass / count, com=middle, inertia=rows),
            replace(spring, name=spring.name + end, compliance=springs),
        ]
    return out
