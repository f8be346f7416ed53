"""Force laws of one coordinate, and errors of a commanded coordinate."""

from __future__ import annotations

from dataclasses import dataclass

from stiffmap.common.units import ANGLE
from stiffmap.model.description.numbers import number, required
from stiffmap.model.description.pose import Vector

Knot = tuple[float, float]


@dataclass(frozen=True)
class Law:
    """Force against deflection of one coordinate (SI: m and N, or rad and N·m).

    ``stiffness`` is the slope of the linear part. With ``cubic`` the force is
    ``stiffness * a + cubic * a**3``. With ``knots`` the law is the monotone polyline through the
    points (deflection, force), which may contain steps in either coordinate (a dead zone is a
    piece of zero force, a stuck friction contact a piece of zero deflection); beyond the first and
    last knot it goes on with slope ``stiffness``. The two do not combine.
    With ``friction`` a force of that size stands against the deflection that the load would give
    without it (dry friction on the loading branch; docs/effects.md says where this holds).
    A free coordinate has no law at all (``None``), a rigid one none either but is actuated.
    """

    stiffness: float = required("stiffness", coordinate=-1, effort=1)
    cubic: float = number("cubic", default=0.0, coordinate=-3, effort=1)
    knots: tuple[Knot, ...] = number("knots", default=(), effort=1, shape="knots", address=False)
    friction: float = 0.0


@dataclass(frozen=True)
class JointFriction:
    """Dry friction about (along) each axis of a free passive joint: its level (N·m, N) and the branch.

    ``loading`` stands in full against the motion that the joint makes without friction, measured from the
    commanded configuration; ``unloading`` acts with it (fully reversed); ``loading_stuck`` holds the joint
    where it is commanded until the level is reached.
    """

    level: float
    branch: str = "loading"


@dataclass(frozen=True)
class CommandError:
    """Error of a commanded actuator coordinate u (m or rad), added to the command:

    ``offset + slope * (u - reference) + amplitude * sin(2 pi (u - reference) / period + phase)``

    and what ``knots`` say at u: pairs (coordinate, error) by rising coordinate, straight between them, level
    beyond the ends. ``reference=None``: the coordinate of the closed home configuration. With ``of``, u is the coordinate
    of another joint, of its own sequence or the nearest around it, as it stands without load.
    """

    offset: float = number("offset", default=0.0, coordinate=1)
    slope: float = number("slope", default=0.0)
    amplitude: float = number("amplitude", default=0.0, coordinate=1)
    period: float = number("period", default=1.0, coordinate=1)
    phase: float = number("phase", default=0.0, fixed=ANGLE)
    reference: float | None = number("reference", default=0.0, coordinate=1)
    knots: tuple[Knot, ...] = number("knots", default=(), coordinate=1, shape="knots", address=False)
    of: str = ""


@dataclass(frozen=True)
class GuideError:
    """Deviation of a guide across its stroke: the carriage stands off along ``axis`` (unit vector, axes
    of the guide) by the value of ``error`` at the commanded coordinate (m)."""

    axis: Vector
    error: CommandError
