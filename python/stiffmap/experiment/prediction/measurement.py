"""Effects that live in the measurement: what they do to the wrench that acts and to what is read.

Load side: the true wrench is ``R G w``. Sensor side, ``deflection``: the reading is ``G Rᵀ u``, the
sensor's axes being turned by R; ``position``: instruments give coordinates, so gain and axes act on
commanded position plus displacement and the commanded position is subtracted again. R is
Rx(angle_x)·Ry(angle_y)·Rz(angle_z) everywhere. Joints and distances are read by other instruments.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from stiffmap.description import AppliedEffect
from stiffmap.errors import StiffmapError
from stiffmap.experiment.experiment import Experiment, Floats

LOAD_SIDE = ("load_direction", "load_gain")
SENSOR_SIDE = ("sensor_gain", "sensor_axes", "frame_offset", "drift", "servo_share")


def rotation(parameters: Mapping[str, float]) -> Floats:
    """(3, 3) Rx·Ry·Rz of ``angle_x`` …"""
    angles = [parameters.get(f"angle_{a}", 0.0) for a in "xyz"]
    return np.asarray(Rotation.from_euler("XYZ", angles).as_matrix())


def turned(values: Floats, r: Floats) -> Floats:
    """(n, 6) with linear and angular part turned by r (3, 3)."""
    return np.hstack([values[:, :3] @ r.T, values[:, 3:] @ r.T])


def scaled(values: Floats, parameters: Mapping[str, float]) -> Floats:
    """(n, 6) times ``gain`` and ``gain_x`` … (linear and angular part alike)."""
    common = parameters.get("gain", 1.0)
    own = np.array([parameters.get(f"gain_{a}", 1.0) for a in "xyz"])
    return np.asarray(values * common * np.tile(own, 2))


def true_wrench(experiment: Experiment, terms: Iterable[AppliedEffect]) -> Floats:
    """(n, 6) the wrench that acts, from the one that was noted."""
    w = experiment.wrench
    for term in terms:
        if term.kind == "load_direction":
            w = turned(w, rotation(dict(term.parameters)))
        elif term.kind == "load_gain":
            w = scaled(w, dict(term.parameters))
    return w


def readings(experiment: Experiment, motion: Floats, terms: Sequence[AppliedEffect]) -> Floats:
    """(n, c) what the instruments show for the true `motion` (n, c)."""
    out = motion[:, :6]
    for term in terms:
        parameters = dict(term.parameters)
        at = _coordinates(experiment)
        if term.kind == "sensor_gain":
            out = scaled(out + at, parameters) - at
        elif term.kind == "sensor_axes":
            out = turned(out + at, rotation(parameters).T) - at
        elif term.kind == "frame_offset" and experiment.quantity == "position":
            out = out + frame_offset(experiment, parameters)
        elif term.kind == "drift":
            out = out + drift(experiment, term)
    shares = [t for t in terms if t.kind == "servo_share"]
    return np.hstack([out, motion[:, 6:] * motor_side(experiment, shares)])


def motor_side(experiment: Experiment, shares: Iterable[AppliedEffect]) -> Floats:
    """(c - 6,) what a channel shows of its motion: a motor the share of its drive that yields before it."""
    seen = {f"{leg}.{t.element}": dict(t.parameters)["share"] for t in shares for leg in t.legs}
    return np.array([seen.get(c.joint, 0.0) if c.side == "motor" else 1.0 for c in experiment.extra])


def _coordinates(experiment: Experiment) -> Floats:
    """(n, 6) commanded coordinates that a position reading contains; zero for deflections."""
    at = np.zeros((len(experiment), 6))
    if experiment.quantity == "position":
        at[:, :3] = experiment.position
    return at


def frame_offset(experiment: Experiment, parameters: Mapping[str, float]) -> Floats:
    """(n, 6) of a position: the instrument's frame is offset, and turned about the base origin."""
    r = rotation(parameters)
    shift = np.array([parameters.get(a, 0.0) for a in "xyz"])
    turn = np.broadcast_to(Rotation.from_matrix(r).as_rotvec(), experiment.position.shape)
    return np.hstack([shift + experiment.position @ (r - np.eye(3)).T, turn])


def drift(experiment: Experiment, term: AppliedEffect) -> Floats:
    """(n, 6) proportional to the order of measurement or to the hours, zero at the first reading.

    StiffmapError where the experiment has no such column.
    """
    per = str(dict(term.options).get("per", "order"))
    column = "hours" if per == "hour" else "order"
    clock = experiment.hours if per == "hour" else experiment.order
    if clock is None:
        raise StiffmapError(f"{experiment.name}: drift per {per} needs a column '{column}'")
    rates = dict(term.parameters)
    rate = np.array([rates.get(a, 0.0) for a in "xyz"] + [0.0] * 3)
    return np.asarray((clock - clock.min())[:, None] * rate)
