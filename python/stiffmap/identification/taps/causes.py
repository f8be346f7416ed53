"""What may explain a tap test: effects that change stiffness, masses, dampers, and how the hammer was held."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from stiffmap.identification.candidates.candidates import Candidate, of_kind
from stiffmap.identification.taps.predict import predict_taps
from stiffmap.identification.taps.problem import Causes, TapsProblem, with_cause
from stiffmap.model import effects
from stiffmap.model.description import Body, Cable, Joint
from stiffmap.model.description.tree import all_elements
from stiffmap.model.effects import Parameter
from stiffmap.solve.machine import Machine

KINDS = ("compliance", "joint_compliance", "base_compliance", "tool_compliance")
"""Effects that frequencies show."""
PAYLOAD = Parameter("mass", "kg", 0.0, 1e4, 0.0, 1.0, "of a body at the TCP that the machine file leaves out")
TYPICAL = 0.02
"""Damping ratio that a damper of typical size adds to one of the modes."""
HAMMER = {
    "hammer_direction": Parameter("angle", "rad", -3.2, 3.2, 0.0, 0.1, "by which the hammer is turned about a base axis",
        plausible=(-3.2, 3.2)),
    "hammer_point": Parameter("offset", "m", -5.0, 5.0, 0.0, 0.05, "of the point that is hit, from the TCP, base axes",
        plausible=(-5.0, 5.0)),
}  # fmt: skip


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
    more = np.nanmax(np.abs(predict_taps(problem.real([(one, 1.0)])[0], problem.taps).ratio - here))
    if not more > 0:
        return []
    size = TYPICAL / float(more)
    return [replace(one, parameters=(replace(one.parameters[0], scale=size, upper=1e3 * size),))]


def corrected(machine: Machine, causes: Causes) -> Machine:
    """The machine with the causes, an effect as an effect."""
    for c, value in causes:
        if c.kind in KINDS:
            p = c.parameters[0].name
            machine = machine.with_effect(c.kind, element=c.element, legs=list(c.legs) or None, **{p: value})
        else:
            machine = Machine(with_cause(machine.description, c, value), like=machine)
    return machine
