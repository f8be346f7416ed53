"""The shipped hexapod as a multibody model in Exudyn: rigid bodies, joints, springs, static solution.

    pip install exudyn && python bench/peer_hexapod.py

Only numbers of the machine's file are shared (geometry and compliances, written down again below); Exudyn
assembles and solves its own equations. Prints the displacement of the tool by both, and their difference.
"""

from __future__ import annotations

import numpy as np

BASE, PLATE = 0.5, 0.25
ON, AT = np.radians([-15, 15, 105, 135, 225, 255]), np.radians([-45, 45, 75, 165, 195, 285])
BRACKET = 1 / np.array([5e-9, 5e-9, 3e-9, 1e-7, 1e-7, 1e-7])  # N/m, N m/rad, base axes
DRIVE = 1 / 1e-8
LENGTH, DIAMETER, E, NU = 0.5, 0.04, 2.1e11, 0.3
CASES = (
    ((0.0, 0.0, 0.7), (300.0, 0.0, 0.0)),
    ((0.1, -0.05, 0.72), (900.0, -500.0, 700.0)),
    ((-0.12, 0.1, 0.65), (0.0, 2000.0, -3000.0)),
    ((0.15, 0.15, 0.78), (20000.0, 0.0, -20000.0)),
)


def rod() -> np.ndarray:
    """(6, 6): free end of an Euler-Bernoulli cantilever along z."""
    area, i = np.pi * DIAMETER**2 / 4, np.pi * DIAMETER**4 / 64
    n, ei, gj = LENGTH, E * i, E / (2 * (1 + NU)) * 2 * i
    k = np.diag([12 * ei / n**3, 12 * ei / n**3, E * area / n, 4 * ei / n, 4 * ei / n, gj / n])
    k[0, 4] = k[4, 0] = -6 * ei / n**2
    k[1, 3] = k[3, 1] = 6 * ei / n**2
    return k


def along(axis: np.ndarray) -> np.ndarray:
    """Rotation whose z is the strut, by turns about x, then y: the cardan joint of the file."""
    a = -np.arctan2(axis[1], axis[2])
    b = np.arcsin(axis[0])
    rx = np.array([[1, 0, 0], [0, np.cos(a), -np.sin(a)], [0, np.sin(a), np.cos(a)]])
    return rx @ np.array([[np.cos(b), 0, np.sin(b)], [0, 1, 0], [-np.sin(b), 0, np.cos(b)]])


def exudyn_displacement(p: np.ndarray, force: np.ndarray) -> np.ndarray:
    """(3,) m: tool of the model at the static equilibrium."""
    import exudyn as exu
    from exudyn.utilities import InertiaCuboid

    container = exu.SystemContainer()
    mbs = container.AddSystem()
    ground = mbs.CreateGround()
    body = {"inertia": InertiaCuboid(density=1000, sideLengths=[0.1] * 3), "gravity": [0, 0, 0]}
    plate = mbs.CreateRigidBody(referencePosition=p, **body)
    spring = {"localPosition0": [0, 0, 0], "localPosition1": [0, 0, 0], "rotationMatrixJoint": np.eye(3),
              "useGlobalFrame": False}  # fmt: skip
    for on, at in zip(ON, AT, strict=True):
        foot = BASE * np.array([np.cos(on), np.sin(on), 0])
        ball = p + PLATE * np.array([np.cos(at), np.sin(at), 0])
        r = along((ball - foot) / np.linalg.norm(ball - foot))
        bracket = mbs.CreateRigidBody(referencePosition=foot, **body)
        cylinder = mbs.CreateRigidBody(referencePosition=foot, referenceRotationMatrix=r, **body)
        slide = mbs.CreateRigidBody(referencePosition=ball, referenceRotationMatrix=r, **body)
        end = mbs.CreateRigidBody(referencePosition=ball, referenceRotationMatrix=r, **body)
        mbs.CreateRigidBodySpringDamper(
            itemNumbers=[ground, bracket], **(spring | {"localPosition0": foot}), stiffness=np.diag(BRACKET)
        )
        # cardan: point held, no turn about the strut (the spin is left out: the ball joint has it too)
        mbs.CreateGenericJoint(itemNumbers=[bracket, cylinder], position=foot, rotationMatrixAxes=r,
                               constrainedAxes=[1, 1, 1, 0, 0, 1], useGlobalFrame=True)  # fmt: skip
        mbs.CreateGenericJoint(itemNumbers=[cylinder, slide], position=ball, rotationMatrixAxes=r,
                               constrainedAxes=[1, 1, 0, 1, 1, 1], useGlobalFrame=True)  # fmt: skip
        drive = np.zeros((6, 6))
        drive[2, 2] = DRIVE
        reach = float(np.linalg.norm(ball - foot))
        mbs.CreateRigidBodySpringDamper(
            itemNumbers=[cylinder, slide], **(spring | {"localPosition0": [0, 0, reach]}), stiffness=drive
        )
        mbs.CreateRigidBodySpringDamper(itemNumbers=[slide, end], **spring, stiffness=rod())
        mbs.CreateGenericJoint(itemNumbers=[end, plate], position=ball, rotationMatrixAxes=np.eye(3),
                               constrainedAxes=[1, 1, 1, 0, 0, 0], useGlobalFrame=True)  # fmt: skip
    mbs.CreateForce(itemNumber=plate, loadVector=list(force))
    mbs.Assemble()
    settings = exu.SimulationSettings()
    solver = settings.staticSolver
    solver.numberOfLoadSteps, solver.verboseMode, settings.solution.file.write = 4, 0, False
    solver.newton.relativeTolerance, solver.newton.absoluteTolerance = 1e-7, 1e-6
    if not mbs.SolveStatic(settings):
        return np.full(3, np.nan)
    return np.array(mbs.GetObjectOutputBody(plate, exu.OutputVariableType.Displacement))


def main() -> None:
    """A line per pose."""
    import stiffmap as sm

    machine = sm.load_machine("hexapod")
    print("pose (mm), force (N): displacement by stiffmap (um); by Exudyn (um); largest difference, relative")
    for p, force in CASES:
        ours = machine.solve(p, [*force, 0, 0, 0]).displacement[:3]
        theirs = exudyn_displacement(np.array(p), np.array(force))
        gap = np.abs(ours - theirs).max() / np.abs(ours).max()
        where, push = (np.array(v) * s for v, s in ((p, 1e3), (force, 1.0)))
        print(f"{where} {push}: {1e6 * ours} {1e6 * theirs} {gap:.1e}")


if __name__ == "__main__":
    main()
