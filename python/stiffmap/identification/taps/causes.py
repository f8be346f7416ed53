"""What may explain a tap test: effects that change stiffness, masses, dampers, and how the hammer was held."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from stiffmap.identification.candidates.candidates import Candidate, of_kind
from stiffmap.identification.taps.predict import predict_taps
from stiffmap.identification.taps.problem import TapsProblem, Term
from stiffmap.identification.taps.table import TapTest
from stiffmap.model import effects
from stiffmap.model.description import Body, Cable, Joint, MachineDescription
from stiffmap.model.description.tree import all_elements, edit
from stiffmap.model.effects import Parameter, apply_records
from stiffmap.solve.machine import Machine

KINDS = ("compliance", "joint_compliance", "base_compliance", "tool_compliance")
"""Effects that frequencies show."""
PAYLOAD = Parameter("mass", "kg", 0.0, 1e4, 0.0, 1.0, "of a body at the TCP that the machine file leaves out")
FIELDS = {"link_mass": "mass", "damper": "damping"}
"""Causes that add to a number of an element."""
TYPICAL = 0.02
"""Damping ratio that a damper of typical size adds to one of the modes."""
HAMMER = {
    "hammer_direction": Parameter("angle", "rad", -3.2, 3.2, 0.0, 0.1, "by which the hammer is turned about a base axis",
        plausible=(-3.2, 3.2)),
    "hammer_point": Parameter("offset", "m", -5.0, 5.0, 0.0, 0.05, "of the point that is hit, from the TCP, base axes",
        plausible=(-5.0, 5.0)),
}  # fmt: skip
Causes = Sequence[tuple[Candidate, float]]
"""Causes with their values, SI."""


def causes(problem: TapsProblem) -> list[Candidate]:
    """All that the readings can speak of, with one number each: frequencies are few."""
    d, kinds = problem.machine.description, set(problem.kind[problem.used])
    found = [c for kind in KINDS for c in of_kind(effects.get(kind), d)]
    found = [replace(c, parameters=(p,)) for c in found for p in c.parameters if p.null is not None]
    found.append(Candidate("payload", "platform", (), (PAYLOAD,)))
    for full, e in all_elements(d):
        if isinstance(e, Body) and e.mass > 0 and not full.startswith("base."):
            mass = Parameter(
                "mass", "kg", -0.95 * e.mass, 1e4, 0.0, 0.1 * e.mass, "beyond that of the machine file"
            )
            found.append(_at("link_mass", full, mass))
        elif isinstance(e, Joint) and not isinstance(e, Cable) and any(e.laws) and "damping" in kinds:
            found += _damper(problem, full, e)
    if "flexibility" in kinds:
        found += [Candidate(kind, axis, (), (p,)) for kind, p in HAMMER.items() for axis in "xyz"]
    return found


def _at(kind: str, full: str, number: Parameter) -> Candidate:
    sequence, _, path = full.partition(".")
    return Candidate(kind, path, () if sequence == "platform" else (sequence,), (number,))


def _damper(problem: TapsProblem, full: str, e: Joint) -> list[Candidate]:
    """With the size that adds a typical damping ratio to one of the modes; none where it adds nothing."""
    unit = "N·s/m" if e.kind == "prismatic" else "N·m·s/rad"
    own = e.damping or 0.0
    one = _at(
        "damper", full, Parameter("damping", unit, -own, np.inf, 0.0, 1.0, "viscous, beyond that of the file")
    )
    here = predict_taps(problem.machine, problem.taps).ratio
    more = np.nanmax(np.abs(predict_taps(problem.real(term(one, 1.0))[0], problem.taps).ratio - here))
    if not more > 0:
        return []
    size = TYPICAL / float(more)
    return [replace(one, parameters=(replace(one.parameters[0], scale=size, upper=1e3 * size),))]


def term(c: Candidate, value: float) -> Term:
    """The cause with this value (SI)."""

    def applied(d: MachineDescription, taps: TapTest) -> tuple[MachineDescription, TapTest]:
        if c.kind == "payload":
            return replace(d, platform=(*d.platform, Body("tapped_load", value))), taps
        if c.kind == "hammer_direction":
            turn = Rotation.from_rotvec(value * np.eye(3)["xyz".index(c.element)])
            return d, replace(taps, hammer=taps.hammer @ turn.as_matrix().T)
        if c.kind == "hammer_point":
            return d, replace(taps, lever=taps.lever + value * np.eye(3)["xyz".index(c.element)])
        if c.kind not in FIELDS:
            return apply_records(d, [c.term([value])]), taps

        def change(e: Any) -> Any:
            if not hasattr(e, FIELDS[c.kind]):  # an offset may have the name of its body
                return None
            return replace(e, **{FIELDS[c.kind]: (getattr(e, FIELDS[c.kind]) or 0.0) + value})

        return edit(d, ".".join((*(c.legs or ("platform",)), c.element)), change) or d, taps

    return applied


def together(causes: Causes) -> Term:
    """Several causes with their values (SI)."""

    def applied(d: MachineDescription, taps: TapTest) -> tuple[MachineDescription, TapTest]:
        for c, value in causes:
            d, taps = term(c, value)(d, taps)
        return d, taps

    return applied


def corrected(machine: Machine, causes: Causes) -> Machine:
    """The machine with the causes, an effect as an effect."""
    nowhere = np.zeros((0, 3))
    none = TapTest(nowhere, np.zeros(0), np.zeros(0), np.zeros(0), nowhere)
    for c, value in causes:
        if c.kind in KINDS:
            p = c.parameters[0].name
            machine = machine.with_effect(c.kind, element=c.element, legs=list(c.legs) or None, **{p: value})
        else:
            machine = Machine(term(c, value)(machine.description, none)[0], like=machine)
    return machine


def scaled(p: Parameter) -> tuple[Callable[[float], float], float, float]:
    """From a free number to the parameter (factors by their logarithm), and its bounds."""
    if p.null == 1.0:
        return (
            (lambda t: float(np.clip(np.exp(t), p.lower, p.upper))),
            float(np.log(p.lower)),
            float(np.log(p.upper)),
        )
    return (lambda t: float(np.clip(t * p.scale, p.lower, p.upper))), p.lower / p.scale, p.upper / p.scale


def unscaled(p: Parameter, value: float) -> float:
    """The free number behind a value of a parameter: the other way of `scaled`."""
    return float(np.log(value)) if p.null == 1.0 else value / p.scale
