"""Core against oracle on one machine: numbers, and the status against eigenvalues."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

import stiffmap as sm
from stiffmap.model.description import MachineDescription, Pose

from .energy import Loads, whole
from .generate import Generator
from .minimise import Answer, Judgement, Oracle
from .placed import Coordinates, as_drawn, placed

CLOSED = 1e-10  # m and rad
METRE = 1.0  # turns that are smaller than the motion of a point so far away count as that


@dataclass(frozen=True)
class Comparison:
    """Largest differences relative to the largest entry of each kind."""

    method: str
    status: sm.Status
    translation: float
    rotation: float
    compliance: float
    truth: str
    """Of the minimiser: found, ends, given up, singular."""
    stable: bool
    """Of the minimiser: no eigenvalue of the reduced Hessian is negative."""
    crossed: bool
    """Of the minimiser: the path went through a bifurcation."""
    flags: sm.Flag
    moved: float
    """Motion of the tip by the minimiser, m."""
    softness: float
    """Of the minimiser: smallest over largest singular value of the compliance, lengths in metres."""
    own: Judgement | None
    """What the energy says of the core's own coordinates; None where it gives none."""

    @property
    def gap(self) -> float:
        """The largest of the differences."""
        return max(self.translation, self.rotation, self.compliance)

    @property
    def told(self) -> bool:
        """The core says that it has no answer, or that it may be on another branch."""
        return self.status == sm.Status.NOT_CONVERGED or bool(self.flags & sm.Flag.BRANCH_UNVERIFIED)


def compare(seed: int, methods: tuple[str, ...] = ("reference", "fast")) -> list[Comparison]:
    """Machine, pose and loads of `seed`: solved by each method and by energy minimisation."""
    generator = Generator(seed)
    description = generator.machine()
    loads, pose = generator.loads(description), generator.pose(description)
    return compare_machine(generator.declared(description), loads, methods, pose)


def compare_machine(
    description: MachineDescription,
    loads: Loads,
    methods: tuple[str, ...] = ("reference", "fast"),
    pose: Pose | None = None,
) -> list[Comparison]:
    """A machine under loads at a pose (None, or out of reach: home), solved by each method and by energy
    minimisation."""
    machine = sm.Machine(description)
    if pose is None or not reached(machine, pose):
        pose = description.home
    there = coordinates_at(description, machine, pose)
    oracle = Oracle(there, loads)
    truth = oracle.solve()
    return [against(machine, there, pose, loads, method, oracle, truth) for method in methods]


def reached(machine: sm.Machine, pose: Pose) -> bool:
    k = sm.inverse_kinematics(machine, pose.p, pose.r)
    return bool(k.status == 0 and not k.flags & sm.Flag.BRANCH_UNVERIFIED)


def coordinates_at(d: MachineDescription, machine: sm.Machine, pose: Pose) -> MachineDescription:
    """The description with its joints at the pose; plain transforms confirm that it is closed there."""
    names = machine.compiled.names.coordinates
    home, at = (
        dict(zip(names, (float(v) for v in x), strict=True))
        for x in (
            machine.compiled.home_coordinates(),
            sm.inverse_kinematics(machine, pose.p, pose.r).coordinates,
        )
    )
    there = placed(d, home, at, pose, machine.compiled.spun_balls)
    n = len(Oracle(there, no_loads()).names)
    tip, walk = whole(as_drawn(there), np.zeros(n), no_loads())
    gaps = [np.abs(a.t - b.t).max() for a, b in walk.loops]
    off = max(
        [float(np.abs(tip.t[:3, 3] - pose.p).max()), float(np.abs(tip.t[:3, :3] - pose.r).max()), *gaps]
    )
    assert off < CLOSED, f"closed to {off:.1e} only"
    return there


def no_loads() -> Loads:
    return Loads(np.zeros(3), np.zeros(3), np.zeros(3), {})


def against(
    machine: sm.Machine,
    there: MachineDescription,
    pose: Pose,
    loads: Loads,
    method: str,
    oracle: Oracle,
    truth: Answer,
) -> Comparison:
    s = machine.solve(
        pose.p,
        [*loads.force, *loads.moment],
        rotation=pose.r,
        load_type="semitangential" if loads.moment.any() else "dead",
        wrenches={n: [*f, 0, 0, 0] for n, f in loads.at_points.items()},
        gravity=loads.gravity,
        method=method,
        threads=1,
    )
    moved = truth.position - pose.p
    turned = Rotation.from_matrix(truth.rotation @ np.array(pose.r).T).as_rotvec()
    scale = np.sqrt(np.abs(np.diag(s.compliance)))
    gap = np.abs(s.compliance - truth.compliance) / np.outer(scale, scale)
    size = np.linalg.norm(moved)
    return Comparison(
        method=method,
        status=sm.Status(int(s.status)),
        translation=float(np.abs(s.displacement[:3] - moved).max() / np.abs(moved).max()),
        rotation=float(np.abs(s.displacement[3:] - turned).max() / max(np.abs(turned).max(), size / METRE)),
        compliance=float(gap.max()),
        truth=truth.kind,
        stable=truth.stable,
        crossed=truth.crossed,
        flags=sm.Flag(int(s.flags)),
        moved=float(size),
        softness=softness(truth),
        own=own(s, there, oracle),
    )


def softness(truth: Answer) -> float:
    """How far from a rigid direction."""
    if not np.isfinite(truth.compliance).all():
        return float("nan")
    sizes = np.linalg.svd(truth.compliance)[1]
    return float(sizes[-1] / sizes[0])


def own(s: sm.Solution, there: MachineDescription, oracle: Oracle) -> Judgement | None:
    """The energy's judgement of the core's coordinates."""
    if not np.isfinite(s.coordinates).all():
        return None
    origin = origins(there)
    found: Coordinates = dict(zip(s.coordinate_names, (float(v) for v in s.coordinates), strict=True))
    return oracle.judge({n: found[n] - origin.get(n, 0.0) for n in oracle.names})


def origins(there: MachineDescription) -> Coordinates:
    """Joint coordinates from which the oracle counts."""
    from stiffmap.model.description import Block, Joint

    out: Coordinates = {}

    def walk(elements: object, prefix: str) -> None:
        for e in elements:  # type: ignore[attr-defined]
            if isinstance(e, Block):
                for b in e.branches:
                    walk(b.elements, f"{prefix}{b.name}.")
            elif isinstance(e, Joint):
                names = [e.name] if len(e.axes) == 1 else [f"{e.name}.{i + 1}" for i in range(len(e.axes))]
                out.update({prefix + n: v for n, v in zip(names, e.home, strict=True)})

    walk(there.base, "")
    for leg in there.legs:
        walk(leg.elements, f"{leg.name}.")
    walk(there.platform, "")
    return out
