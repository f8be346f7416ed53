"""Effects that live in the measurement: what they do to the wrench that acts and to what is read.

Load side: the true wrench is ``R G w``. Sensor side, ``deflection``: the reading is ``G R u``;
``position``: instruments give coordinates, so gain and axes act on commanded position plus
displacement and the commanded position is subtracted again. R turns by the rotation vector ``angle``.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np
from scipy.spatial.transform import Rotation

from stiffmap.description import AppliedEffect
from stiffmap.experiment.experiment import Experiment, Floats

LOAD_SIDE = ("load_direction", "load_gain")
SENSOR_SIDE = ("sensor_gain", "sensor_axes", "frame_offset", "drift")


def turned(values: Floats, parameters: Mapping[str, float]) -> Floats:
    """(n, 6) with linear and angular part turned by the rotation vector ``angle_x`` …"""
    r = Rotation.from_rotvec([parameters.get(f"angle_{a}", 0.0) for a in "xyz"]).as_matrix()
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
            w = turned(w, dict(term.parameters))
        elif term.kind == "load_gain":
            w = scaled(w, dict(term.parameters))
    return w


def readings(experiment: Experiment, motion: Floats, terms: Iterable[AppliedEffect]) -> Floats:
    """(n, 6) what the instrument shows for the true `motion` (n, 6)."""
    out = motion
    for term in terms:
        parameters = dict(term.parameters)
        if term.kind in ("sensor_gain", "sensor_axes"):
            change = scaled if term.kind == "sensor_gain" else turned
            at = _coordinates(experiment)
            out = change(out + at, parameters) - at
        elif term.kind == "frame_offset" and experiment.quantity == "position":
            out = out + frame_offset(experiment, parameters)
        elif term.kind == "drift":
            out = out + drift(experiment, parameters)
    return out


def _coordinates(experiment: Experiment) -> Floats:
    """(n, 6) commanded coordinates that a position reading contains; zero for deflections."""
    at = np.zeros((len(experiment), 6))
    if experiment.quantity == "position":
        at[:, :3] = experiment.position
    return at


def frame_offset(experiment: Experiment, parameters: Mapping[str, float]) -> Floats:
    """(n, 6) of a position: the instrument's frame is offset, and turned about the base origin."""
    turn = np.array([parameters.get(f"angle_{a}", 0.0) for a in "xyz"])
    shift = np.array([parameters.get(a, 0.0) for a in "xyz"])
    return np.hstack(
        [shift + np.cross(turn, experiment.position), np.broadcast_to(turn, (len(experiment), 3))]
    )


def drift(experiment: Experiment, parameters: Mapping[str, float]) -> Floats:
    """(n, 6) proportional to the order of measurement, zero at the first reading."""
    if experiment.order is None:
        return np.zeros((len(experiment), 6))
    elapsed = experiment.order - experiment.order.min()
    rate = np.array([parameters.get(a, 0.0) for a in "xyz"] + [0.0] * 3)
    return np.asarray(elapsed[:, None] * rate)
