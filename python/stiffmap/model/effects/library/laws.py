"""Force laws of a drive, an elastic joint or a spring's direction other than declared."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from itertools import pairwise
from typing import Any

from stiffmap.common.errors import StiffmapError
from stiffmap.model.description import Joint, Law, MachineDescription
from stiffmap.model.description.tree import Elements
from stiffmap.model.effects.edit import change_sites
from stiffmap.model.effects.evidence import shares_of_load
from stiffmap.model.effects.sites import at_sites, each, elastic_directions, elastic_drives
from stiffmap.model.effects.types import EffectType, Parameter, Placed, entry_of


def change_law(
    description: MachineDescription, placed: Placed, change: Callable[[Law], Law]
) -> MachineDescription:
    """The machine with another law at each joint or spring direction of the place."""
    i = entry_of(placed.element)[1]

    def element(e: Any) -> Elements:
        if isinstance(e, Joint):
            assert e.law is not None
            return (replace(e, law=change(e.law)),)
        assert i is not None
        stiffness = e.stiffness[i][i] if e.stiffness is not None else 1.0 / e.compliance[i][i]
        laws = {**dict(e.laws), i: change(dict(e.laws).get(i) or Law(stiffness))}
        return (replace(e, laws=tuple(sorted(laws.items(), key=lambda pair: pair[0]))),)

    return change_sites(description, placed.legs, placed.element, elastic_directions, element)


def on_law(law: Callable[[Law, Placed], Law], **more: Any) -> dict[str, Any]:
    """What effects share that make another law of that at their place; `more` as in `EffectType`."""
    return {
        "places": at_sites(elastic_directions),
        "apply": lambda machine, placed: change_law(machine, placed, lambda old: law(old, placed)),
        "tried": at_sites(elastic_drives),
        "frame": "the coordinate",
        "stage": 10,
        **more,
    }


def linear(law: Law) -> Law:
    """The law, which must be linear yet; raises StiffmapError."""
    if law.cubic or law.knots:
        raise StiffmapError("the drive has a declared nonlinear law already, which this effect cannot join")
    return law


HALF_WIDTH = Parameter(
    "half_width", "m", 0.0, 0.01, 0.0, 1e-5, "deflection without force to each side of the centre",
    angular="rad", angular_upper=0.5, angular_scale=1e-4,
)  # fmt: skip


def with_gap(old: Law, placed: Placed) -> Law:
    """A polyline law with a piece of zero force; plain at zero width."""
    half = placed.values["half_width"]
    return Law(linear(old).stiffness, knots=((-half, 0.0), (half, 0.0))) if half > 0.0 else linear(old)


DEAD_ZONE = EffectType(
    kind="dead_zone",
    reverses=True,
    title="backlash of a drive, gap in a joint or a spring's direction",
    doc=(
        "A gap in series with the spring of a drive, an elastic joint or an uncoupled direction of a link spring (element `foot.k22`): no force while the deflection is within the half width "
        "about the centre, the declared stiffness beyond. Unloaded, it stands in the centre."
    ),
    parameters=(HALF_WIDTH,),
    **on_law(with_gap),
    excludes=("dead_zone", "hardening", "tabulated"),
)


KNEES = (0.1, 0.25, 0.5, 0.8)
"""Shares of the largest load at which the compliance may change."""


def two_slopes(old: Law, placed: Placed) -> Law:
    """A polyline through the knees, continued with the other slope; plain at ratio 1."""
    ratio, knee = placed.values["ratio"], placed.values["knee"]
    a = knee / linear(old).stiffness
    return old if ratio == 1.0 else Law(old.stiffness / ratio, knots=((-a, -knee), (a, knee)))


BILINEAR = EffectType(
    kind="bilinear",
    title="spring whose stiffness changes at a force",
    doc=(
        "The nominal compliance up to the force `knee` in both directions, `ratio` times it for the force "
        "beyond (a preloaded screw that opens, a stop that closes); of a drive, an elastic joint or an uncoupled "
        "direction of a link spring (element `foot.k22`)."
    ),
    parameters=(
        Parameter("ratio", "1", 1e-3, 1e3, 1.0, 0.1, "compliance beyond the knee over the declared one"),
        Parameter(
            "knee", "N", 1e-3, 1e6, None, 100.0, "force at which the compliance changes", angular="N·m"
        ),
    ),
    **on_law(two_slopes),
    signature=partial(shares_of_load, name="knee", shares=KNEES),
    excludes=("bilinear", "dead_zone", "hardening", "friction", "position_dependent_compliance", "tabulated"),
)


CUBIC = Parameter(
    "cubic", "N/m^3", 0.0, 1e20, 0.0, 1e14, "coefficient of the deflection's third power",
    angular="N·m/rad^3", angular_scale=1e9,
)  # fmt: skip


def hardened(old: Law, placed: Placed) -> Law:
    """force = a/c + cubic a^3."""
    return Law(linear(old).stiffness, cubic=placed.values["cubic"])


HARDENING = EffectType(
    kind="hardening",
    title="spring that stiffens with load",
    doc=(
        "Force = a/c + cubic·a³ at the deflection a, with the nominal compliance c, of a drive, an elastic joint or "
        "an uncoupled direction of a link spring (element `foot.k22`)."
    ),
    parameters=(CUBIC,),
    **on_law(hardened),
    excludes=("hardening", "dead_zone", "friction", "position_dependent_compliance", "tabulated"),
)


POINTS = 4
STEP = Parameter(
    "step", "m", 1e-9, 1.0, None, 1e-5, "deflection between the points", fitted=False, angular="rad"
)
FACTORS = tuple(
    Parameter(f"factor_{i}", "1", 1e-3, 1e3, 1.0, 0.1, f"force over the declared one at {i} steps")
    for i in range(1, POINTS + 1)
)


def polyline(old: Law, placed: Placed) -> Law:
    """An odd polyline through the points, its last piece going on; plain where all factors are 1."""
    step, factors = placed.values["step"], [placed.values[p.name] for p in FACTORS]
    if all(f == 1.0 for f in factors):
        return linear(old)
    points = [(i * step, f * linear(old).stiffness * i * step) for i, f in enumerate(factors, 1)]
    (a0, f0), (a1, f1) = points[-2:]
    if any(f <= before for (_, before), (_, f) in pairwise(points)):
        raise StiffmapError("the force must rise from point to point: factor_i times i")
    mirrored = [(-a, -f) for a, f in reversed(points)]
    return Law((f1 - f0) / (a1 - a0), knots=(*mirrored, *points))


TABULATED = EffectType(
    kind="tabulated",
    title="spring with a measured force-deflection curve",
    doc=(
        "Force of a drive, an elastic joint or an uncoupled direction of a link spring (element `foot.k22`) by a "
        "table: at 1, 2, 3, 4 steps of deflection it is `factor_i` times the declared one, straight between the "
        "points and through zero, the same in both directions; the last piece goes on beyond. The force must rise."
    ),
    parameters=(STEP, *FACTORS),
    **on_law(polyline, tried=lambda description: []),
    vector=tuple(p.name for p in FACTORS),
    excludes=("tabulated", "dead_zone", "hardening", "bilinear", "friction", "position_dependent_compliance"),
)


SLOPE = Parameter(
    "slope", "1/m", -100.0, 100.0, 0.0, 0.1, "relative change of the compliance per travel", angular="1/rad"
)


def sloped(e: Joint, placed: Placed) -> Elements:
    """Adds to the slope of the drive's compliance."""
    slope = e.compliance_slope + placed.values["slope"]
    for end in (e.drive.range or ()) if e.drive else ():
        if 1.0 + slope * (end - e.home[0]) <= 0.0:
            raise StiffmapError(f"slope {slope:g}: no compliance is left at {end:g}")
    return (replace(e, compliance_slope=slope),)


POSITION_DEPENDENT_COMPLIANCE = EffectType(
    kind="position_dependent_compliance",
    title="drive compliance that depends on the stroke",
    doc=(
        "Drive compliance times 1 + slope·(u - u_home) at the commanded coordinate u (a screw that yields "
        "more the longer it is)."
    ),
    parameters=(SLOPE,),
    **each(elastic_drives, sloped),
    pivot="the drive's home coordinate",
    frame="the drive's coordinate",
    excludes=("hardening", "friction"),
)
