"""Faults made by hand on the tree of a machine, from what they are physically: no code of the effect library.

The controller keeps the nominal numbers of every element; what is built has the other ones.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from stiffmap.model.description import Block, Element, Joint, MachineDescription, Offset, Pose, Spring
from stiffmap.model.description.laws import CommandError
from stiffmap.model.description.tree import all_elements

Edit = Callable[[Element], Element]


@dataclass(frozen=True)
class Fault:
    """One thing that is wrong: its kind in plain words, the element by its full name, and a direction of the change."""

    kind: str
    at: str
    typical: float
    """Size to begin with, SI."""
    build: Callable[[float], Edit]

    def of(self, d: MachineDescription, size: float) -> MachineDescription:
        """The machine as built with the fault at a size (SI)."""
        return edited(d, {self.at: self.build(size)})


def edited(d: MachineDescription, edits: dict[str, Edit]) -> MachineDescription:
    """Elements by full name put in place of others."""

    def walk(elements: tuple[Element, ...], name: str) -> tuple[Element, ...]:
        out = []
        for e in elements:
            full = f"{name}.{e.name}"
            if isinstance(e, Block):
                branches = tuple(
                    replace(b, elements=walk(b.elements, f"{name}.{b.name}")) for b in e.branches
                )
                e = replace(e, branches=branches)
            elif full in edits and isinstance(e, (Offset, Joint, Spring)):
                e = edits[full](e)
            out.append(e)
        return tuple(out)

    legs = tuple(replace(leg, elements=walk(leg.elements, leg.name)) for leg in d.legs)
    return replace(d, base=walk(d.base, "base"), legs=legs, platform=walk(d.platform, "platform"))


def softer(size: float) -> Edit:
    """A drive or an elastic joint, or all of a link, that yields (1 + size) times as much."""

    def edit(e: Element) -> Element:
        if isinstance(e, Joint) and e.law is not None:
            return replace(e, law=replace(e.law, stiffness=e.law.stiffness / (1.0 + size)))
        if isinstance(e, Spring):
            compliance, stiffness = (
                None if m is None else tuple(tuple(v * f for v in row) for row in m)
                for m, f in ((e.compliance, 1.0 + size), (e.stiffness, 1.0 / (1.0 + size)))
            )
            return replace(e, compliance=compliance, stiffness=stiffness)
        return e

    return edit


def driven(**error: float) -> Callable[[float], Edit]:
    """A drive that stands beside its command: by an offset, or by a slope about where it was homed."""

    def build(size: float) -> Edit:
        def edit(e: Element) -> Element:
            if not isinstance(e, Joint):
                return e
            numbers = {k: size if v == 0.0 else v for k, v in error.items()}
            if "slope" in numbers:
                numbers["offset"] = numbers.get("offset", 0.0) - numbers["slope"] * e.home[0]
            return replace(e, command_errors=(*e.command_errors, CommandError(**numbers)))

        return edit

    return build


def elsewhere(way: np.ndarray, turn: np.ndarray) -> Callable[[float], Edit]:
    """A frame that is placed beside where it is drawn: along `way`, turned about `turn` (3,), in its own axes."""

    def build(size: float) -> Edit:
        def edit(e: Element) -> Element:
            if not isinstance(e, Offset):
                return e
            at = e.actual or e.nominal
            r = np.array(at.r)
            turned = r @ Rotation.from_rotvec(size * turn).as_matrix()
            return replace(e, actual=Pose.of(np.array(at.p) + size * r @ way, turned))

        return edit

    return build


def plain(d: MachineDescription) -> MachineDescription:
    """Springs that do not vary with a stroke: the oracle has no others."""
    edits: dict[str, Edit] = {
        n: (lambda e: replace(e, stroke=None) if isinstance(e, Spring) else e)
        for n, e in all_elements(d)
        if isinstance(e, Spring) and e.stroke is not None
    }
    return edited(d, edits) if edits else d


def elastic(d: MachineDescription) -> list[Fault]:
    """Drives and links that may yield more."""
    out = []
    for name, e in all_elements(d):
        soft = isinstance(e, Spring) and not e.laws
        if soft or (isinstance(e, Joint) and e.actuated and e.law is not None and not e.law.knots):
            out.append(Fault("soft", name, 0.5, softer))
    return out


def geometric(d: MachineDescription) -> list[Fault]:
    """Drives that stand elsewhere."""
    out = []
    for name, e in all_elements(d):
        if isinstance(e, Joint) and e.actuated:
            out.append(Fault("zero", name, 1e-4, driven(offset=0.0)))
            out.append(Fault("gain", name, 1e-4, driven(slope=0.0)))
    return out


def jitter(d: MachineDescription, rng: np.random.Generator, share: float) -> MachineDescription:
    """Every number a little off: zeros and gains of drives, places and turns of frames, compliances; `share` of 0.2 mm, 1 mrad,
    2e-4 and 20 %."""
    edits: dict[str, Edit] = {}
    for name, e in all_elements(d):
        if isinstance(e, Joint) and e.actuated:
            zero = (1e-3 if e.kind == "revolute" else 2e-4) * share * rng.standard_normal()
            slope = 2e-4 * share * rng.standard_normal()
            soft = softer(float(np.expm1(0.2 * share * rng.standard_normal())))
            late = driven(offset=0.0, slope=slope)(zero)
            edits[name] = lambda e, soft=soft, late=late: late(soft(e))  # type: ignore[misc]
        elif (
            isinstance(e, Offset) and np.any(e.nominal.p) and name.count(".") == 1
        ):  # rods of a block must still close
            edits[name] = elsewhere(2e-4 * share * rng.standard_normal(3), 0.0 * rng.standard_normal(3))(1.0)
        elif isinstance(e, Spring):
            edits[name] = softer(float(np.expm1(0.2 * share * rng.standard_normal())))
    return edited(d, edits)
