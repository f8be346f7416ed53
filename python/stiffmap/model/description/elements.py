"""Elements of a chain, in the order in which they follow each other from base to platform.

Names are unique within their sequence. A full name joins the sequence names with dots:
``x.bar_low.bar`` is element ``bar`` of branch ``bar_low`` in leg ``x``.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from stiffmap.common.units import LENGTH, MASS, Dimension
from stiffmap.model.description.laws import CommandError, GuideError, JointFriction, Law
from stiffmap.model.description.numbers import interval, number, required
from stiffmap.model.description.pose import Pose, Rows, Vector
from stiffmap.model.description.strokes import BeamStroke, Matrix6, TableStroke

ORIGIN: Vector = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Offset:
    """Constant transform. ``actual`` differs from ``nominal`` where the machine has an error:
    the controller computes its commands with ``nominal``, the real machine is built with ``actual``
    (``None``: as nominal)."""

    name: str
    nominal: Pose
    actual: Pose | None = None


@dataclass(frozen=True)
class Drive:
    """What a motor adds to an actuated joint; used by limits and dynamics (SI). A further number is a line here
    (`description.numbers`), and one in the core's ``DriveNumbers`` if a calculation there uses it."""

    range: tuple[float, float] | None = interval("range", "Stroke that the drive can take.")
    speed: float | None = number("speed", "Largest speed.", coordinate=1, time=-1, lower=0.0)
    force: float | None = number("force", "Largest force or torque.", effort=1, lower=0.0, core="force_limit")
    encoder_error: float | None = number("encoder_error", "Error of the encoder.", coordinate=1, lower=0.0)
    coulomb_friction: float | None = number("friction.coulomb", "Coulomb friction.", effort=1, lower=0.0)
    viscous_friction: float | None = number(
        "friction.viscous", "Friction per speed.",
        coordinate=-1, effort=1, time=1, lower=0.0,
    )  # fmt: skip


@dataclass(frozen=True)
class Joint:
    """Joint at the current frame about or along local ``axes``.

    kind
        ``revolute``, ``prismatic`` (one axis), ``universal`` (two revolutes in sequence),
        ``spherical`` (three).
    home
        Coordinates (m, rad) in the home configuration, one per axis.
    actuated
        One axis only. ``law`` is then the compliance of the drive (``None``: rigid); a passive
        joint with ``law=None`` turns freely, otherwise ``law`` applies to each of its axes.
    axis_laws
        One law per axis of a passive joint, in place of ``law``.
    rest
        Coordinates (m, rad), one per axis, at which the laws of a passive joint are free of force;
        ``None``: those of the closed home configuration.
    compliance_slope
        Relative change of the drive's compliance per metre (or rad) of the commanded coordinate,
        measured from the closed home configuration.
    sag
        Of a drive that turns, in a machine of one leg without loops: rad per m by which the tool would rise per rad of it. So
        a drive yields under a weight at the tool, where the file has no weights and compliances. Theory G4.
    friction
        Of a passive joint without a law.
    """

    name: str
    kind: str
    axes: tuple[Vector, ...]
    home: tuple[float, ...] = number(
        "home", "Coordinates in the home configuration.",
        default=(0.0,), coordinate=1, shape="axes", saved=True,
    )  # fmt: skip
    actuated: bool = False
    law: Law | None = None
    axis_laws: tuple[Law, ...] = ()
    rest: tuple[float, ...] | None = number(
        "rest", "Coordinates at which its laws are free of force.", coordinate=1, shape="axes"
    )
    compliance_slope: float = number(
        "compliance_slope", "Relative change of the drive's compliance per travel.",
        default=0.0, coordinate=-1, core="compliance_slope",
    )  # fmt: skip
    sag: float = number(
        "sag", "How far a drive that turns gives way under the arm, per length by which the tool rises with it.",
        default=0.0, coordinate=1, fixed=Dimension(length=-1), core="sag",
    )  # fmt: skip
    damping: float | None = number(
        "damping", "Viscous damping of its motion about the equilibrium.",
        coordinate=-1, effort=1, time=1, lower=0.0, passive=True,
    )  # fmt: skip
    loss_factor: float | None = number(
        "loss_factor", "Structural loss factor of its compliance.", lower=0.0, passive=True
    )
    command_errors: tuple[CommandError, ...] = ()
    coupled: tuple[tuple[str, float], ...] = ()
    guide_errors: tuple[GuideError, ...] = ()
    friction: JointFriction | None = None
    limits: tuple[float, float] | None = interval("limits", "Range of the coordinate.", passive=True)
    drive: Drive | None = None

    def __post_init__(self) -> None:
        if self.drive == Drive():  # nothing known of the motor, as in a file that names none of its numbers
            object.__setattr__(self, "drive", None)

    @property
    def laws(self) -> tuple[Law | None, ...]:
        """Law of each axis; ``None``: free, or rigid where it is actuated."""
        return self.axis_laws or (self.law,) * len(self.axes)

    @property
    def ends(self) -> tuple[float, float] | None:
        """Range of the drive, else limits of the coordinate (m, rad); ``None``: there are none."""
        return (self.drive.range if self.drive else None) or self.limits

    @property
    def free(self) -> bool:
        """Passive, and no spring about any axis."""
        return not self.actuated and not any(self.laws)


@dataclass(frozen=True)
class Cable(Joint):
    """Cable (or belt) from a point of the body of the current frame to an anchor in the base; it only pulls.

    Its coordinate is the free (unstretched) length between the two, which a winch commands: an actuated joint
    behind which no frame moves. ``anchor`` (m, base axes) is where it enters the guide: an eye, or a pulley of
    ``radius`` that turns about ``guide`` (unit vector, base axes, the way the cable comes from the winch).
    ``at`` (m, current frame) is where it is fixed to the body. docs/cables.md.
    """

    kind: str = "prismatic"
    axes: tuple[Vector, ...] = ((0.0, 0.0, 1.0),)
    home: tuple[float, ...] = (0.0,)
    actuated: bool = True
    rest: tuple[float, ...] | None = None
    guide: Vector = (0.0, 0.0, 1.0)
    elasticity: float | None = number("elasticity", "Axial stiffness EA.", effort=1, lower=0.0)
    stiffness: float | None = number(
        "stiffness", "Stiffness that does not depend on the length, in series.",
        coordinate=-1, effort=1, lower=0.0,
    )  # fmt: skip
    lead: float = number(
        "lead", "Length between winch and anchor, which yields too.",
        default=0.0, coordinate=1, lower=0.0,
    )  # fmt: skip
    pretension: float = number(
        "pretension", "Tension that the controller commands lengths for.",
        default=0.0, effort=1, lower=0.0,
    )  # fmt: skip
    radius: float = number(
        "radius", "Of the guide's pulley; 0: an eye.", default=0.0, coordinate=1, lower=0.0
    )
    anchor: tuple[float, float, float] = number(
        "anchor",
        default=ORIGIN, fixed=LENGTH, shape="vector", saved=True, needed=True,
    )  # fmt: skip
    at: tuple[float, float, float] = number(
        "at", "Where it is fixed, in the current frame.",
        default=ORIGIN, fixed=LENGTH, shape="vector", saved=True,
    )  # fmt: skip
    stretch: float = 1.0
    """Factor of the real cable's compliance on the one that is believed in."""
    lead_tension: float = 1.0
    """Tension of the lead, of that of the free length: friction of the guide."""
    anchor_error: Vector = (0.0, 0.0, 0.0)
    """Real anchor minus the one that is believed in (m, base axes)."""


@dataclass(frozen=True)
class BeamNumbers:
    """Numbers (SI) of a beam along a local axis by their keys in a machine file: ``length``, ``tube.outer``, ``material.E``, ``EA`` …"""

    along: str
    numbers: tuple[tuple[str, float], ...]


@dataclass(frozen=True)
class Spring:
    """Virtual spring of a link: translations t then rotations phi, the frame behind it being
    ``p + R t``, ``R Rx(phi1) Ry(phi2) Rz(phi3)``.

    Exactly one of ``compliance`` and ``stiffness`` is given (6x6 in m, rad, N, N·m, local axes,
    translations first), symmetric positive semidefinite: a null direction of a compliance is
    rigid, one of a stiffness is free. ``laws`` replaces single *diagonal* directions by nonlinear
    laws, ((direction index, law), ...): allowed where that direction is not coupled.
    ``rest`` is the deflection (6,) at which the spring is free of force (preload).
    ``stroke`` says how a ``compliance`` varies with a joint's coordinate (None: not at all).
    ``beam`` is what the compliance was computed from, where it was; it does not count in comparisons.
    ``loss_factor`` is its structural damping: the stiffness of a vibration is (1 + i loss) times that.
    """

    name: str
    compliance: Matrix6 | None = None
    stiffness: Matrix6 | None = None
    laws: tuple[tuple[int, Law], ...] = ()
    rest: tuple[float, ...] = number("rest", default=(0.0,) * 6, coordinate=1, shape="directions")
    stroke: BeamStroke | TableStroke | None = None
    beam: BeamNumbers | None = field(default=None, compare=False, repr=False, metadata={"derived": True})
    loss_factor: float | None = number("loss_factor", "Structural loss factor.", lower=0.0, address=False)


@dataclass(frozen=True)
class Body:
    """A rigid body that moves with the current frame: mass (kg), centre of mass in it (m),
    inertia about that centre in its axes (kg·m²)."""

    name: str
    mass: float = required("mass", fixed=MASS, lower=0.0)
    com: tuple[float, float, float] = number("com", default=ORIGIN, fixed=LENGTH, shape="vector")
    inertia: Rows = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))


@dataclass(frozen=True)
class Point:
    """A named point that moves with the current frame, at ``offset`` in it (m)."""

    name: str
    offset: tuple[float, float, float] = number(
        "at", default=ORIGIN, fixed=LENGTH, shape="vector", saved=True
    )


@dataclass(frozen=True)
class Branch:
    """One of the sequences of a parallel block."""

    name: str
    elements: tuple[Element, ...]


@dataclass(frozen=True)
class Block:
    """Two or more branches between the same two frames."""

    name: str
    branches: tuple[Branch, ...] = ()


Element = Offset | Joint | Cable | Spring | Body | Point | Block
