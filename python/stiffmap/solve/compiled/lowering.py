"""From the description of a machine to the compiled mechanism."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from stiffmap import _core
from stiffmap.common.errors import HomeError, StiffmapError
from stiffmap.model.description import (
    TASK,
    BeamStroke,
    Block,
    Body,
    Cable,
    CommandError,
    Element,
    Joint,
    JointFriction,
    Law,
    MachineDescription,
    Offset,
    Point,
    Pose,
    Spring,
)
from stiffmap.model.description.numbers import numbers_of
from stiffmap.model.description.pose import IDENTITY
from stiffmap.model.description.strokes import present_rows
from stiffmap.model.description.tree import ENDS, all_elements, core_name
from stiffmap.model.home import Gap, misfit_text
from stiffmap.solve.compiled.ball import any_axes_do, charted

UNLIMITED = 1e300
ROUND_OFF = 1e-12
"""Of a range's larger end: a pose that is commanded to an end is not flagged for its last digits."""
FAR = 10.0  # rad or m: end of the flat pieces of a stick law
KEPT_CHAINS = 128
START = 1e-3  # rad or m: slope of a stick law in the linear start of Newton's iteration


def build_mechanism(machine: MachineDescription, like: _core.Mechanism | None = None) -> _core.Mechanism:
    """Compiled mechanism; raises StiffmapError where the core refuses the description.

    like
        A mechanism that may have the same nominal geometry: what was found out about its home is then taken over.
    """
    try:
        root = root_chain(machine)
        springs = [
            _core.ExternalSpring(s.name, s.point, np.array(s.anchor), s.stiffness, s.length, s.tension_only)
            for s in machine.external_springs
        ] + [cable(full, e) for full, e in all_elements(machine) if isinstance(e, Cable)]
        known = () if like is None else (like,)
        return _core.Mechanism(root, pose(machine.home), springs, task(machine), machine.search_home, *known)
    except _core.HomeMisfit as problem:
        raise HomeError(f"{machine.name}: {misfit_text(machine, *problem.args[1:])}") from None
    except ValueError as problem:
        raise StiffmapError(f"{machine.name}: {problem}") from None


def home_gaps(machine: MachineDescription) -> list[Gap]:
    """Gap of every leg and branch at the declared home coordinates of a machine that closes."""
    declared, _ = _core.home_gaps(root_chain(machine), pose(machine.home), task(machine), machine.search_home)
    return [Gap(*gap) for gap in declared]


def root_chain(machine: MachineDescription) -> _core.Chain:
    """Compiled chain from the base through the legs to the TCP."""
    root = _core.Chain()
    add_elements(root, machine.base)
    if not machine.legs:
        add_free_platform(root, machine)
    root.block("legs", [(leg.name, chain(leg.elements)) for leg in machine.legs])
    add_elements(root, machine.platform)
    return root


def add_free_platform(out: _core.Chain, machine: MachineDescription) -> None:
    """Free joints of a platform that no leg carries: along and about the base axes, at zero turned as at home."""
    tip = Pose()
    for e in machine.platform:
        if isinstance(e, Offset):
            tip = tip @ e.nominal
    body = machine.home @ tip.inverse()
    x, y, z = (0.0 if n in machine.freedoms else v for n, v in zip("xyz", body.translation, strict=True))
    guide = pose(Pose((x, y, z)))
    out.offset("platform.guide", guide, guide)
    for i, name in enumerate(TASK):
        if name in machine.freedoms:
            kind, home = ("prismatic", body.translation[i]) if i < 3 else ("revolute", 0.0)
            add_joint(out, Joint(f"platform.{name}", kind, (IDENTITY[i % 3],), (home,)))
    turn = pose(Pose((0.0, 0.0, 0.0), body.rotation))
    out.offset("platform.home", turn, turn)


def cable(full: str, e: Cable) -> _core.ExternalSpring:
    """A cable as the core's straight spring with a winch, at a point of the same name."""
    lower, upper = limits_with_slack(e)
    winch = _core.Winch(
        e.elasticity or 0.0,
        e.lead,
        e.pretension,
        1.0 / e.stretch,
        e.lead_tension,
        e.radius,
        np.array(e.guide),
        np.array(e.anchor_error),
        np.zeros(3),  # of its fixing point
        lower,
        upper,
        drive_numbers(e),
        [command_error(c) for c in e.command_errors],
    )
    return _core.ExternalSpring(
        core_name(full), full, np.array(e.anchor), e.stiffness or 0.0, 0.0, True, winch
    )


def task(machine: MachineDescription) -> list[bool]:
    """Which of the six pose components are commanded."""
    return [c in machine.task for c in TASK]


def pose(p: Pose) -> _core.Pose:
    """Compiled pose."""
    return _core.Pose(p.p, p.r)


def law(of: Law) -> _core.Law:
    """Compiled force law."""
    friction = (of.friction,) if of.friction else ()
    return _core.Law(of.stiffness, of.cubic, list(of.knots), *friction)


@lru_cache(maxsize=KEPT_CHAINS)
def chain(elements: tuple[Element, ...]) -> _core.Chain:
    """Compiled chain of a sequence, which nobody changes: variants of a machine share most of their legs."""
    out = _core.Chain()
    add_elements(out, elements)
    return out


def add_elements(out: _core.Chain, elements: Sequence[Element]) -> None:
    """Append each element to a compiled chain."""
    for e in elements:
        match e:
            case Offset():
                out.offset(e.name, pose(e.nominal), pose(e.actual or e.nominal))
            case Cable():
                out.point(e.name, np.array(e.at))
            case Joint():
                add_joint(out, e)
            case Spring():
                add_spring(out, e)
            case Body():
                out.body(e.name, e.mass, np.array(e.com))
            case Point():
                out.point(e.name, np.array(e.offset))
            case Block():
                out.block(e.name, [(b.name, chain(b.elements)) for b in e.branches])


def add_joint(out: _core.Chain, e: Joint) -> None:
    """A joint as elementary joints; several axes get the names ``name.1``, ``name.2`` …"""
    for what, given in (("home", e.home), ("rest", e.rest), ("axis_laws", e.axis_laws or None)):
        if given is not None and len(given) != len(e.axes):
            raise StiffmapError(
                f"joint {e.name}: expected one entry of {what} per axis ({len(e.axes)}), got {len(given)}"
            )
    e, turn = charted(e)
    if turn is not None:
        out.offset(f"{e.name}.home", turn, turn)
    lower, upper = limits_with_slack(e)
    stuck = e.friction if e.friction and e.friction.branch == "loading_stuck" else None
    own = [stick_law(stuck.level) if stuck else law(one) if one else None for one in e.laws]
    for i, (axis, home) in enumerate(zip(e.axes, e.home, strict=True)):
        out.joint(
            name=e.name if len(e.axes) == 1 else f"{e.name}.{i + 1}",
            prismatic=e.kind == "prismatic",
            axis=np.array(axis),
            actuated=e.actuated,
            home=home,
            law=own[i],
            numbers=drive_numbers(e),
            errors=[command_error(c) for c in e.command_errors],
            lower=lower,
            upper=upper,
            guide_errors=[(np.array(g.axis), command_error(g.error)) for g in e.guide_errors],
            friction=sliding_friction(e.friction),
            about_command=stuck is not None,
            rest=None if e.rest is None else e.rest[i],
            ball="" if e.kind != "spherical" or i else "free" if any_axes_do(e) else "meant",
        )


def limits_with_slack(e: Joint) -> tuple[float, float]:
    """Ends of a drive's range or a joint's limits, wider by what round-off makes of a pose at an end."""
    if e.ends is None:
        return -UNLIMITED, UNLIMITED
    slack = ROUND_OFF * max(map(abs, e.ends))
    return e.ends[0] - slack, e.ends[1] + slack


def drive_numbers(e: Joint) -> dict[str, float]:
    """Values of the core's ``DriveNumbers`` that the joint and its drive have."""
    return {
        n.core: float(value)
        for holder in (e, e.drive)
        for n in (() if holder is None else numbers_of(holder))
        if n.core and (value := getattr(holder, n.name))  # zero: none
    }


def command_error(c: CommandError) -> _core.CommandError:
    """Compiled error of a commanded coordinate."""
    reference = np.nan if c.reference is None else c.reference  # NaN: where home closes
    return _core.CommandError(
        c.of, c.offset, c.slope, c.amplitude, c.period, c.phase, reference, list(c.knots)
    )


def sliding_friction(friction: JointFriction | None) -> float:
    """Constant force against (positive) or with the joint's motion, theory L3."""
    if friction is None or friction.branch == "loading_stuck":
        return 0.0
    return friction.level if friction.branch == "loading" else -friction.level


def stick_law(level: float) -> _core.Law:
    """Rigid up to the level, then at it: a step and two flat pieces that no joint leaves."""
    knots = [(-FAR, -level), (0.0, -level), (0.0, level), (FAR, level)]
    return _core.Law(level / START, 0.0, knots)


def add_spring(out: _core.Chain, e: Spring) -> None:
    """A link spring given by exactly one matrix."""
    if (e.compliance is None) == (e.stiffness is None):
        raise StiffmapError(f"spring {e.name}: expected either a compliance or a stiffness matrix")
    matrix = e.compliance if e.compliance is not None else e.stiffness
    laws = [(i, law(entry)) for i, entry in e.laws]
    out.spring(e.name, np.array(matrix), e.compliance is not None, np.array(e.rest), laws, stroke(e))


def stroke(e: Spring) -> _core.Stroke | None:
    """How the spring varies; rows of a table as what has been changed of its first row leaves them."""
    if e.stroke is None:
        return None
    if e.compliance is None:
        raise StiffmapError(f"spring {e.name}: only a compliance varies with a joint")
    s, joint = e.stroke, e.stroke.joint
    sequence, _, inside = joint.partition(".")
    if sequence in ENDS:
        joint = f".{inside}"
    if isinstance(s, BeamStroke):
        return _core.Stroke(joint, s.along, s.at, s.length, s.rate, [])
    rows = zip(s.at, present_rows(s, e.compliance), strict=True)
    return _core.Stroke(joint, 0, 0.0, 0.0, 0.0, [(u, np.array(row)) for u, row in rows])
