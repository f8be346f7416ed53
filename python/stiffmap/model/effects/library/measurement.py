"""Effects of the measurement: loads that act otherwise than noted, instruments that show something else.

Load side: the wrench that acts is ``R G w``. Reading, ``deflection``: it is ``G Rᵀ u``, the sensor's axes being turned
by R; ``position``: instruments give coordinates, so gain and axes act on commanded position plus displacement and the
commanded position is subtracted again. R is Rx(angle_x)·Ry(angle_y)·Rz(angle_z) everywhere. They act on the six axes
of a pose; joints and distances are read by other instruments.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import StiffmapError
from stiffmap.model.description import AppliedEffect
from stiffmap.model.effects.evidence import Onsets, Plan, Probe, Reading, Signature, Tried
from stiffmap.model.effects.library.geometry import AXES, components, rotation_of, rotations, translation_of
from stiffmap.model.effects.sites import at, at_sites, elastic_drives
from stiffmap.model.effects.types import EffectType, Option, Parameter

ANGLES: tuple[Parameter, ...] = rotations("rotation")["parameters"]


def gains(doc: str) -> tuple[Parameter, ...]:
    """``gain`` of all axes and ``gain_x`` … of single ones (they multiply)."""
    each = tuple(Parameter(f"gain_{a}", "1", 0.1, 10.0, 1.0, 0.01, f"{doc}, {a} axis alone") for a in AXES)
    return (Parameter("gain", "1", 0.1, 10.0, 1.0, 0.01, f"{doc}, all axes"), *each)


def turned(values: Floats, r: Floats) -> Floats:
    """(n, 6) with linear and angular part turned by r (3, 3)."""
    return np.hstack([values[:, :3] @ r.T, values[:, 3:] @ r.T])


def scaled(values: Floats, parameters: Mapping[str, float]) -> Floats:
    """(n, 6) times ``gain`` and ``gain_x`` … (linear and angular part alike)."""
    common = parameters.get("gain", 1.0)
    own = np.array([parameters.get(f"gain_{a}", 1.0) for a in AXES])
    return np.asarray(values * common * np.tile(own, 2))


def of_coordinates(change: Callable[[Floats, Mapping[str, float]], Floats]) -> Reading:
    """A change (n, 6) of what an instrument shows, as a reading: of coordinates where positions are read."""

    def reading(read: Floats, motion: Floats, plan: Plan, term: AppliedEffect) -> Floats:
        where = np.zeros((len(read), 6))
        if plan.quantity == "position":
            where[:, :3] = plan.position
        axes = change(read[:, :6] + where, dict(term.parameters)) - where
        return np.hstack([axes, read[:, 6:]])

    return reading


def added(part: Callable[[Plan, AppliedEffect], Floats]) -> Reading:
    """What is added (n, 6) to the six axes, as a reading."""

    def reading(read: Floats, motion: Floats, plan: Plan, term: AppliedEffect) -> Floats:
        return np.hstack([read[:, :6] + part(plan, term), read[:, 6:]])

    return reading


def measured(kind: str, element: str, parameters: tuple[Parameter, ...]) -> dict[str, Any]:
    """What kinds share that live in the measurement."""
    return {
        "kind": kind,
        "places": at(element),
        "apply": None,
        "moves": "nothing of the machine",
        "excludes": (kind,),
        **components(parameters),
    }


LOAD_DIRECTION = EffectType(
    **measured("load_direction", "load", ANGLES),
    title="direction of the applied force",
    doc="The force that acts is the declared one turned: f = Rx·Ry·Rz f_declared.",
    frame="base axes; about x, then the turned y, then the twice turned z",
    pivot="the point where the force acts",
    load=lambda wrench, plan, term: turned(wrench, rotation_of(dict(term.parameters))),
)


LEVER = tuple(
    Parameter(
        f"offset_{a}",
        "m",
        -5.0,
        5.0,
        0.0,
        0.01,
        f"of the point where the force acts, {a}",
        plausible=(-0.5, 0.5),
    )
    for a in AXES
)


def with_lever(wrench: Floats, plan: Plan, term: AppliedEffect) -> Floats:
    """(n, 6) with the moment, about the noted point, of a force that acts at another one."""
    arm = translation_of(dict(term.parameters), "offset_")
    turned_arm = arm if plan.rotation is None else plan.rotation @ arm
    return np.hstack([wrench[:, :3], wrench[:, 3:] + np.cross(turned_arm, wrench[:, :3])])


LOAD_OFFSET = EffectType(
    **measured("load_offset", "load", LEVER),
    title="point where the force acts",
    doc="The force acts at the noted point plus offset: there it has the moment offset × force, too.",
    frame="base axes; the tool's where poses turn it",
    load=with_lever,
)


LOAD_GAIN = EffectType(
    **measured("load_gain", "load", gains("acting force over declared force")),
    title="gain of the force measurement",
    doc="The force that acts is the declared one times gain, per axis times gain·gain_axis.",
    frame="base axes",
    load=lambda wrench, plan, term: scaled(wrench, dict(term.parameters)),
)


SENSOR_AXES = EffectType(
    **measured("sensor_axes", "sensor", ANGLES),
    title="orientation of the displacement sensor",
    doc="The sensor's axes are turned against the declared ones: reading = (Rx·Ry·Rz)^T displacement.",
    frame="declared axes of the reading; about x, then the turned y, then the twice turned z",
    reading=of_coordinates(lambda values, parameters: turned(values, rotation_of(parameters).T)),
    hidden=lambda plan: plan.frame == "unknown",
)


SENSOR_GAIN = EffectType(
    **measured("sensor_gain", "sensor", gains("reading over displacement")),
    title="gain of the displacement sensor",
    doc="The reading is the displacement times gain, per axis times gain·gain_axis.",
    frame="axes of the reading",
    reading=of_coordinates(scaled),
    instrument_scale="gain",
)


FRAME = (
    *(Parameter(a, "m", -1.0, 1.0, 0.0, 1e-4, f"shift of every reading along {a}") for a in AXES),
    *(
        Parameter(
            f"angle_{a}", "rad", -math.pi, math.pi, 0.0, 1e-4, f"turn of the instrument's frame about {a}"
        )
        for a in AXES
    ),
)


def offset(plan: Plan, term: AppliedEffect) -> Floats:
    """(n, 6) of a position: the instrument's frame is offset, and turned about the base origin."""
    if plan.quantity != "position":
        return np.zeros((len(plan.position), 6))
    parameters = dict(term.parameters)
    r, shift = rotation_of(parameters), translation_of(parameters, "")
    turn = np.broadcast_to(Rotation.from_matrix(r).as_rotvec(), plan.position.shape)
    return np.hstack([shift + plan.position @ (r - np.eye(3)).T, turn])


FRAME_OFFSET = EffectType(
    **measured("frame_offset", "sensor", FRAME),
    title="position and orientation of the instrument's frame",
    doc=(
        "The instrument's frame is not where it is believed: a measured position p reads as shift + "
        "Rx·Ry·Rz p, so that an error of position gains shift + (Rx·Ry·Rz - 1) p."
    ),
    frame="base axes",
    pivot="origin of the base",
    reading=added(offset),
    hidden=lambda plan: plan.frame != "known",
)


def recorded(plan: Plan, column: str, what: str) -> Floats:
    """(n,) order or hours. StiffmapError where the experiment, which `what` needs it of, has no such column."""
    found: Floats | None = getattr(plan, column)
    if found is None:
        raise StiffmapError(f"{plan.name}: {what} needs a column '{column}'")
    return found


def drift(plan: Plan, term: AppliedEffect) -> Floats:
    """(n, 6) proportional to the order of measurement or to the hours, zero at the first reading.

    StiffmapError where the experiment has no such column.
    """
    per = str(dict(term.options).get("per", "order"))
    clock = recorded(plan, "hours" if per == "hour" else "order", f"drift per {per}")
    rate = np.concatenate([translation_of(dict(term.parameters), ""), np.zeros(3)])
    return np.asarray((clock - clock.min())[:, None] * rate)


RATES = tuple(Parameter(a, "m", -1e-3, 1e-3, 0.0, 1e-8, f"per reading or per hour, {a}") for a in AXES)

DRIFT = EffectType(
    **measured("drift", "sensor", RATES),
    title="drift of the instrument",
    doc="The reading gains the drift times (order - first order), or times the hours since the first reading.",
    frame="axes of the reading",
    options=(Option("per", ("order", "hour"), "what the drift goes with"),),
    needs=("order",),
    reading=added(drift),
)


MOST_JUMPS = 1000
"""Effort only: of more readings than are compared."""
SINCE = Parameter(
    "since",
    "1",
    -1e12,
    1e12,
    None,
    1.0,
    "order of the first reading that has it, all of it but for the fraction",
)


def jump(plan: Plan, term: AppliedEffect) -> Floats:
    """(n, 6) the shift of the instrument's frame in all readings of an order and later. StiffmapError where there is no order."""
    values = dict(term.parameters)
    has = np.clip(_order(plan) - values["since"] + 1.0, 0.0, 1.0)
    return np.outer(has, [*translation_of(values, ""), 0.0, 0.0, 0.0])


def jumps(probe: Probe, tried: Tried) -> Iterator[Signature]:
    """Since every reading but the first, or since `MOST_JUMPS` of them."""
    order = _order(probe.plan)
    first, *others = np.unique(order)
    linear = [((p.name, p.scale), ("since", float(first))) for p in tried.parameters if p.null is not None]
    changes = [probe.change(AppliedEffect("frame_jump", "sensor", (), given)) for given in linear]
    tried_ones = np.linspace(0, len(others) - 1, min(len(others), MOST_JUMPS)).round().astype(np.intp)
    onsets = Onsets(changes, order, np.array(others)[tried_ones])
    for k, since in enumerate(onsets.first):
        yield Signature({"since": float(since)}, one_of=(onsets, k))


def _order(plan: Plan) -> Floats:
    return recorded(plan, "order", "a jump since a reading")


FRAME_JUMP = EffectType(
    **measured("frame_jump", "sensor", FRAME[:3]) | {"parameters": (*FRAME[:3], SINCE)},
    title="jump of the instrument's frame",
    doc=(
        "The instrument, its target or the machine's base was moved between two readings: positions of the order `since` and "
        "later read as shifted by x, y, z. Named as set-ups of their own (column `setup`) they have frames of their own."
    ),
    frame="base axes",
    needs=("order",),
    reading=added(jump),
    signature=jumps,
    hidden=lambda plan: plan.quantity != "position",
)


def share_of_motor(read: Floats, motion: Floats, plan: Plan, term: AppliedEffect) -> Floats:
    """A motor shows the share of its drive's deflection that lies before it."""
    mine = {f"{leg}.{term.element}" for leg in term.legs}
    out = read.copy()
    for i, channel in enumerate(plan.extra, start=6):
        if channel.side == "motor" and channel.joint in mine:
            out[:, i] = motion[:, i] * dict(term.parameters)["share"]
    return out


SERVO_SHARE = EffectType(
    kind="servo_share",
    title="yield of a drive before its motor's encoder",
    doc=(
        "The motor side of a drive reads `share` of the drive's deflection: what its position control "
        "yields. At 0 the motor stands and all yields behind it, at 1 behind the encoder nothing does. The "
        "machine at the tool is the same."
    ),
    parameters=(Parameter("share", "1", 0.0, 1.0, 0.0, 0.1, "share of the drive's deflection"),),
    places=at_sites(elastic_drives),
    apply=None,
    reading=share_of_motor,
    frame="the drive's coordinate",
    moves="nothing of the machine",
    excludes=("servo_share",),
    needs=("motor",),
)
