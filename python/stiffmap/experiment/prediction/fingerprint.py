"""One word for a machine under a plan: what predictions depend on, readings excluded."""

from __future__ import annotations

from stiffmap.common.fingerprints import code, digest
from stiffmap.experiment.prediction.predict import Predictor


def fingerprint(predictor: Predictor) -> str:
    """Digest of the machine and of all of the plan that a prediction depends on."""
    e = predictor.experiment
    parts = [
        predictor.machine.description,
        e.quantity,
        e.branch,
        e.setup,
        e.point,
        e.load_point,
        e.gravity,
        e.loop,
    ]
    parts += [e.reference_temperature, e.extra, e.points, e.load_points, e.unloaded]
    parts += [e.frame, e.tool, e.instrument, e.target, e.surface, e.normal, e.joint_names]
    arrays = [e.position, e.wrench, e.rotation, e.other, e.other_rotation, e.approach, e.order, e.temperature]
    arrays += [e.joints, e.other_joints, e.gravity_of, e.hours]
    return digest(parts, arrays, code())
