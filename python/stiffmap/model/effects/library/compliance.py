"""Compliance of drives and links: more or less than declared."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from stiffmap.common.errors import StiffmapError
from stiffmap.model.description import Element, Joint, Law, MachineDescription, Spring
from stiffmap.model.description.strokes import as_rows
from stiffmap.model.description.tree import Elements
from stiffmap.model.effects.sites import each, elastic_joints, found, springs
from stiffmap.model.effects.types import EffectType, Parameter, Placed, entry_of

SCALE = Parameter("scale", "1", 1e-3, 1e3, 1.0, 0.1, "factor on the nominal compliance")
VALUE = Parameter(
    "value", "m/N", 1e-15, 1.0, None, 1e-8, "the new total, for a drive or elastic joint",
    fitted=False, angular="rad/(N·m)",
)  # fmt: skip


def sites(elements: Elements) -> dict[str, tuple[int, ...]]:
    """Elastic joints, link springs, and single entries of these by names such as ``foot.k11``."""
    named = springs(elements)
    entries = {f"{n}.k{i}{i}": at for n, at in named.items() for i in range(1, 7) if _has(elements[at[0]], i)}
    return {**whole(elements), **entries}


def whole(elements: Elements) -> dict[str, tuple[int, ...]]:
    """Elastic joints and link springs."""
    return {**elastic_joints(elements), **springs(elements)}


def _has(e: Element, i: int) -> bool:
    return isinstance(e, Spring) and e.compliance is not None and e.compliance[i - 1][i - 1] > 0.0


def softened(e: Any, placed: Placed) -> Elements:
    """Scales the law, the matrix or one entry of it."""
    if isinstance(e, Joint):
        return (_joint(e, placed),)
    if "value" in placed.values:
        raise StiffmapError("value is for elements with one direction; use scale for a 6x6 spring")
    entry, scale = entry_of(placed.element)[1], placed.values["scale"]
    return (_whole(e, scale) if entry is None else _entry(e, entry, scale),)


def _joint(e: Joint, placed: Placed) -> Joint:
    assert e.law is not None
    if e.law.cubic or e.law.knots:
        raise StiffmapError(f"{e.name} has a declared nonlinear law; its compliance cannot be scaled")
    scale = placed.values.get("scale", 1.0)
    stiffness = 1.0 / placed.values["value"] if "value" in placed.values else e.law.stiffness / scale
    return replace(e, law=Law(stiffness))


def _whole(e: Spring, scale: float) -> Spring:
    if e.laws:
        raise StiffmapError(f"{e.name} has declared nonlinear laws; its compliance cannot be scaled")
    if e.stiffness is not None:
        return replace(e, stiffness=as_rows(np.array(e.stiffness) * (1.0 / scale)))
    return replace(e, compliance=as_rows(np.array(e.compliance) * scale))


def _entry(e: Spring, i: int, scale: float) -> Spring:
    if scale < lowest_scale(e, i):
        raise StiffmapError(
            f"{e.name}.k{i + 1}{i + 1}: below scale {lowest_scale(e, i):.6g} the matrix is indefinite"
        )
    rows = np.array(e.compliance)
    rows[i, i] *= scale
    return replace(e, compliance=as_rows(rows))


def lowest_scale(e: Spring, i: int) -> float:
    """Smallest factor on entry (i, i) that leaves the matrix positive: 1 - 1/(C_ii (C^-1)_ii)."""
    c = np.array(e.compliance)
    d = np.sqrt(np.diag(c))
    d[d == 0.0] = 1.0
    unit = c / np.outer(d, d)
    coupled = [j for j in range(6) if j != i and unit[i, j] != 0.0]
    if not coupled:
        return 0.0
    # Schur complement of the entry over the directions coupled to it
    rest = unit[np.ix_(coupled, coupled)]
    return float(unit[i, coupled] @ np.linalg.pinv(rest) @ unit[coupled, i])


def at(description: MachineDescription, element: str, legs: tuple[str, ...]) -> tuple[Parameter, ...]:
    """rad/(N·m) for a revolute joint; the bound of a single entry; no value for a 6x6 spring."""
    there = found(description, legs, element, sites)
    entry = entry_of(element)[1]
    first = there[0] if there else None
    if isinstance(first, Joint):
        return (SCALE, VALUE if first.kind == "prismatic" else replace(VALUE, unit=VALUE.angular))
    if entry is None:
        return (SCALE, VALUE)
    # a hair above the limit, where the matrix would have a rigid direction
    lowest = max(lowest_scale(e, entry) for e in there if isinstance(e, Spring)) + 1e-3
    return (replace(SCALE, lower=max(SCALE.lower, lowest)), VALUE)


def derived(description: MachineDescription, placed: Placed) -> dict[str, float]:
    """The new total of a drive, m/N or rad/(N·m)."""
    if "value" in placed.values:
        return {}
    first, *_ = found(description, placed.legs, placed.element, sites)
    law = first.law if isinstance(first, Joint) else None
    return {"value": placed.values["scale"] / law.stiffness} if law else {}


EFFECT = EffectType(
    kind="compliance",
    title="compliance other than nominal",
    doc=(
        "The nominal compliance of a drive, an elastic joint or a link times `scale`; on a 6x6 spring the "
        "whole matrix, or one diagonal entry of it (element `foot.k11`), its couplings staying as they are. "
        "One bar of several in a block is named with its branch (element `low.bar`)."
    ),
    parameters=(SCALE, VALUE),
    **each(sites, softened, apart=whole),
    frame="local axes of the spring or joint",
    one_of=("scale", "value"),
    at=at,
    derived=derived,
    compared=("soft", "stiff"),
)
