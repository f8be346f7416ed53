"""A description that uses everything a description can hold."""

from __future__ import annotations

import numpy as np

from stiffmap.common.rotations import rotation_about
from stiffmap.model.description import (
    Block,
    Body,
    Branch,
    CommandError,
    Drive,
    ExternalSpring,
    Joint,
    Law,
    Leg,
    MachineDescription,
    Offset,
    Point,
    Pose,
    Spring,
)


def random_rotation(rng: np.random.Generator) -> np.ndarray:
    """A rotation with digits that only exact printing keeps."""
    axis = rng.standard_normal(3)
    return rotation_about(axis / np.linalg.norm(axis), float(rng.uniform(-3, 3)))


def random_spd(rng: np.random.Generator, rank: int = 6) -> tuple[tuple[float, ...], ...]:
    """Symmetric positive semidefinite, exactly symmetric."""
    factor = rng.standard_normal((6, rank))
    matrix = factor @ factor.T * 1e-7
    return tuple(tuple(float(v) for v in row) for row in (matrix + matrix.T) / 2)


def diagonal(rng: np.random.Generator) -> tuple[tuple[float, ...], ...]:
    """Uncoupled, with a rigid direction."""
    terms = [0.0, *rng.uniform(1e-9, 1e-6, 5)]
    return tuple(tuple(float(terms[i]) if i == j else 0.0 for j in range(6)) for i in range(6))


def full_machine(seed: int = 0) -> MachineDescription:
    """Every sort of element, law, limit and note; random numbers."""
    rng = np.random.default_rng(seed)

    def pose() -> Pose:
        return Pose.of(rng.standard_normal(3), random_rotation(rng))

    def unit() -> tuple[float, float, float]:
        v = rng.standard_normal(3)
        x, y, z = (float(c) for c in v / np.linalg.norm(v))
        return (x, y, z)

    def number() -> float:
        return float(rng.uniform(0.1, 2.0) * 10.0 ** rng.integers(-8, 8))

    bar = Branch(
        "low", (Offset("spread", pose()), Spring("bar", compliance=random_spd(rng), rest=(number(),) * 6))
    )
    ball = Joint(
        "ball", "spherical", (unit(), unit(), unit()), home=(0.1, number(), -0.3), limits=(-1.0, 1.0)
    )
    inner = Block("inner", (Branch("p", (ball,)), Branch("q", ())))
    high = Branch("high", (inner, Spring("bar", stiffness=random_spd(rng, 4))))
    drive = Joint(
        "drive",
        "revolute",
        (unit(),),
        home=(number(),),
        actuated=True,
        law=Law(number(), knots=((-1e-5, -number()), (0.0, 0.0), (1e-5, number()))),
        compliance_slope=-number(),
        command_errors=(
            CommandError(number(), number(), number(), number(), number(), number()),
            CommandError(),
        ),
        limits=(-number(), number()),
        drive=Drive((-1.0, 2.0), number(), number(), number(), number(), number()),
    )
    legs = (
        Leg("one", (drive, Body("b", number(), unit(), ((2.0, 0.1, 0.0), (0.1, 3.0, 0.0), (0.0, 0.0, 4.0))))),
        Leg(
            "2",
            (Offset("frame", pose()), Block("pair", (bar, high)), Offset("attach", pose(), actual=pose())),
        ),
        Leg(
            "three",
            (
                Joint("rigid", "prismatic", ((0.0, -1.0, 0.0),), actuated=True),
                Joint("pin", "revolute", (unit(),), home=(number(),), law=Law(number(), cubic=number())),
                Joint("cross", "universal", (unit(), unit()), home=(0.0, 0.5), law=Law(number())),
                Spring(
                    "s", compliance=diagonal(rng), laws=((0, Law(number(), cubic=1.0)), (4, Law(number())))
                ),
                Point("tip", unit()),
            ),
        ),
    )
    return MachineDescription(
        name="full",
        legs=legs,
        base=(Offset("stand", pose()), Spring("floor", compliance=random_spd(rng))),
        platform=(
            Body("spindle", 3.0, inertia=((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))),
            Point("probe"),
        ),
        home=pose(),
        workspace=((-0.1, -0.2, -0.3), (0.1, 0.2, 0.30000000000000004)),
        gravity=(0.0, 0.0, -9.81),
        external_springs=(ExternalSpring("hose", "three.tip", unit(), number(), number(), True),),
        title='A "title": with # signs',
        source="line one\nline two, °C",
        uncertainty=(("z", number()), ("a.b/c", number())),
        sources=(("three.tip", "measured"), ("*", "assumed")),
        notes=(("three.tip", "yes"), ("drive", "1e6"), ("x", "null"), ("empty", "")),
        extra=(("fit", (1.5, ("a", True, None), 3)), ("word", "true")),
    )
