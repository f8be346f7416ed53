"""Virtual joint method by hand on Pinocchio and numpy: what a capable user writes in an afternoon.

Each leg is a tree of 16 joints (drive, three revolutes, two springs of six); the platform closes them.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from tripteron import DRIVE, LEGS, LENGTH, joints, link_stiffness

NAME = f"Pinocchio {pin.__version__} + numpy {np.__version__}"
FRAME = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
PASSIVE = np.array([1, 8, 15])
ELASTIC = np.array([0, *range(2, 8), *range(9, 15)])
SIX = ("PX", "PY", "PZ", "RX", "RY", "RZ")


def leg_model(leg: int):
    """Model, data and tip frame of one leg."""
    axes, origin = LEGS[leg]
    here, along = pin.SE3.Identity(), pin.SE3(np.eye(3), np.array([LENGTH, 0, 0]))
    link = [(kind, along if i == 0 else here) for i, kind in enumerate(SIX)]
    sequence = [("PZ", pin.SE3(axes, origin)), ("RZ", here), *link, ("RZ", here), *link, ("RZ", here)]
    model, last = pin.Model(), 0
    for i, (kind, placement) in enumerate(sequence):
        last = model.addJoint(last, getattr(pin, f"JointModel{kind}")(), placement, f"j{i}")
    tip = pin.Frame("tip", last, 0, pin.SE3(axes.T, np.zeros(3)), pin.FrameType.OP_FRAME)
    frame = model.addFrame(tip)
    return model, model.createData(), frame


MODELS = [leg_model(i) for i in range(3)]
SPRINGS = np.zeros((16, 16))
SPRINGS[0, 0] = DRIVE
for at in (2, 9):
    SPRINGS[at : at + 6, at : at + 6] = link_stiffness()
COMPLIANCE = np.linalg.inv(SPRINGS[np.ix_(ELASTIC, ELASTIC)])


def configuration(p: np.ndarray, leg: int) -> np.ndarray:
    """(16,) coordinates with springs at zero."""
    q = np.zeros(16)
    q[[0, *PASSIVE]] = joints(p, leg)
    return q


def unloaded_stiffness(p: np.ndarray) -> np.ndarray:
    """(6, 6): sum of the legs' stiffness by the block inverse of the paper's equation (25) without load."""
    total = np.zeros((6, 6))
    for i, (model, data, frame) in enumerate(MODELS):
        j = pin.computeFrameJacobian(model, data, configuration(p, i), frame, FRAME)
        m = np.zeros((9, 9))
        m[:6, :6] = j[:, ELASTIC] @ COMPLIANCE @ j[:, ELASTIC].T
        m[:6, 6:] = j[:, PASSIVE]
        m[6:, :6] = j[:, PASSIVE].T
        total += np.linalg.inv(m)[:6, :6]
    return total


def kinematics(leg: int, x: np.ndarray):
    """Placement, Jacobian and Hessian (6, 16, 16) of the tip.

    The binding labels the column-major Hessian as row-major; read as Fortran order it equals differences.
    """
    model, data, frame = MODELS[leg]
    pin.computeJointJacobians(model, data, x)
    pin.updateFramePlacement(model, data, frame)
    pin.computeJointKinematicHessians(model, data)
    h = pin.getFrameKinematicHessian(model, data, frame, FRAME)
    return (
        data.oMf[frame].copy(),
        pin.getFrameJacobian(model, data, frame, FRAME),
        h.ravel(order="K").reshape(h.shape, order="F"),
    )


def loaded(p: np.ndarray, wrench: np.ndarray, tolerance: float = 1e-10):
    """Displacement (3,) m and stiffness (6, 6) at the equilibrium: Newton on the saddle-point system of 60.

    Stops as stiffmap does: last step below the tolerance in metres (angles in radians).
    """
    start = [configuration(p, i) for i in range(3)]
    x = [q.copy() for q in start]
    forces = np.zeros(12)
    for _ in range(20):
        legs = [kinematics(i, x[i]) for i in range(3)]
        on_leg = [wrench - forces[:6] - forces[6:], forces[:6], forces[6:]]
        system, rhs = np.zeros((60, 60)), np.zeros(60)
        first = legs[0]
        for i, (placement, jacobian, hessian) in enumerate(legs):
            own = slice(16 * i, 16 * i + 16)
            system[own, own] = SPRINGS - np.tensordot(on_leg[i], hessian, 1)
            rhs[own] = jacobian.T @ on_leg[i] - SPRINGS @ (x[i] - start[i])
            if i:
                row = slice(42 + 6 * i, 48 + 6 * i)
                system[:16, row], system[own, row] = first[1].T, -jacobian.T
                turn = pin.log3(placement.rotation @ first[0].rotation.T)
                rhs[row] = np.r_[placement.translation - first[0].translation, turn]
        system[48:, :48] = system[:48, 48:].T
        step = np.linalg.solve(system, rhs)
        for i in range(3):
            x[i] += step[16 * i : 16 * i + 16]
        forces += step[48:]
        if np.abs(step[:48]).max() < tolerance:
            break
    unit = np.zeros((60, 6))
    unit[:16] = first[1].T
    compliance = unit.T @ np.linalg.solve(system, unit)
    return kinematics(0, x[0])[0].translation - p, np.linalg.inv(compliance)
