"""One machine, one command, one load: equilibrium of the bodies, and what the core states of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from stiffmap.model.description import Joint, MachineDescription, Pose, Spring

from ..energy import Loads
from .cables import Winch, winches
from .closure import Closure, Unreachable
from .path import Path, Point, closed
from .relative import Array, State
from .structure import Builder, Structure, Unsupported
from .system import System


@dataclass(frozen=True)
class Answer:
    """SI, base axes, about the TCP; NaN where there is none."""

    kind: str
    """found, ends, locked, given up, no start, singular, unreachable."""
    pose: Pose
    """Where the closed machine stands without load."""
    displacement: Array
    compliance: Array
    effort: dict[str, float]
    leg_wrench: dict[str, Array]
    frequencies: Array
    """Hz, rising."""
    stable: bool
    crossed: bool
    lowest: float
    """Eigenvalue over the largest, of the energy over the closed motions."""
    drives: dict[str, float]
    """Commanded coordinates."""
    released: float = 0.0
    """How far (m, rad) the TCP goes from the command to the equilibrium without load."""

    @property
    def found(self) -> bool:
        return self.kind == "found"


def nothing(kind: str, pose: Pose, drives: dict[str, float]) -> Answer:
    nan = np.full((6, 6), np.nan)
    return Answer(kind, pose, nan[0], nan, {}, {}, nan[0], False, False, np.nan, drives)


class Machine:
    """A description, closed at home."""

    def __init__(self, d: MachineDescription, finer: int = 1) -> None:
        self.d = d
        self.drawn = Builder(d).build()
        self.closure = Closure(self.drawn, finer)
        self.home = self.closure.home()

    @property
    def drives(self) -> list[str]:
        return [p.name for p in self.drawn.pairs if isinstance(p.element, Joint) and p.element.actuated]

    def value(self, at: tuple[State, Array], name: str) -> float:
        return float(at[1][self.drawn.names.index(name)])

    def commanded(self, pose: Pose | None, drives: dict[str, float] | None) -> tuple[State, Array]:
        if drives is not None:
            return self.closure.at_drives(self.home, drives)
        return self.closure.at_pose(self.home, pose or self.d.home)

    def solve(
        self,
        loads: Loads,
        pose: Pose | None = None,
        drives: dict[str, float] | None = None,
        kind: str = "dead",
        modes: int = 0,
    ) -> Answer:
        """At a pose of the TCP, or at commanded drives (full names)."""
        try:
            at = self.commanded(pose, drives)
        except Unreachable:
            return nothing("unreachable", pose or self.d.home, drives or {})
        return self.solve_at(at, loads, kind, modes)

    def solve_at(self, at: tuple[State, Array], loads: Loads, kind: str = "dead", modes: int = 0) -> Answer:
        tip = self.drawn.tip
        pose = Pose.of(at[0].p[tip], at[0].r[tip])
        command = {n: self.value(at, n) for n in self.drives}
        path = self.path(at, loads, kind)
        command |= {c.name: c.free for c in path.system.winches}
        point, how = path.follow()
        if point is None:
            return nothing(how, pose, command)
        return answered(path, point, pose, command, modes)

    def path(self, at: tuple[State, Array], loads: Loads, kind: str) -> Path:
        """The machine as built, from where it is commanded."""
        state, measured = at
        beside, target, soft = self.targets(measured)
        real = Builder(self.d, beside).build()
        system = System(real, target, soft, loads, kind, state.r[self.drawn.tip])
        drawn = {c.name: c.free for c in winches(self.drawn, state)}
        system.winches = [
            Winch(e, at, leg, name, drawn[name]) for name, leg, at, e in real.cables if name in drawn
        ]
        return Path(system, state, measured, longest=1 / (8 * self.closure.finer - 7))

    def judge(
        self, displacement: Array, loads: Loads, pose: Pose | None, drives: dict[str, float] | None, kind: str
    ) -> tuple[float, int]:
        """How far from an equilibrium a displacement of the TCP is (m, rad), and how many motions fall there."""
        at = self.commanded(pose, drives)
        tip = self.drawn.tip
        turn = Rotation.from_rotvec(displacement[3:]).as_matrix()
        return self.path(at, loads, kind).judged(at[0].p[tip] + displacement[:3], turn @ at[0].r[tip])

    def targets(self, measured: Array) -> tuple[dict[str, Array], Array, Array]:
        """How far guides carry beside their lines, where laws stand at zero force, factors on compliances."""
        s, home = self.drawn, self.home[1]
        beside: dict[str, Array] = {}
        target, soft, number = np.zeros(len(s.names)), np.ones(len(s.names)), 0
        for p in s.pairs:
            e, i = p.element, number + len(p.roles) - 1
            if isinstance(e, Spring):
                target[number : number + 6] = e.rest
            elif isinstance(e, Joint) and p.roles[-1] == "joint":
                target[i] = e.rest[p.axis] if e.rest is not None else home[i]
                if e.actuated:
                    u = measured[i]
                    follows = [
                        s.names.index(f"{p.name.rpartition('.')[0]}.{c.of}".lstrip(".")) if c.of else i
                        for c in e.command_errors
                    ]
                    target[i] = u + sum(
                        error(c, measured[k], home[k]) for c, k in zip(e.command_errors, follows, strict=True)
                    )
                    soft[i] = 1.0 + e.compliance_slope * (u - home[i])
                    if e.guide_errors:
                        beside[p.name] = sum(
                            (error(g.error, u, home[i]) * np.array(g.axis) for g in e.guide_errors),
                            start=np.zeros(3),
                        )
            number += len(p.roles)
        return beside, target, soft


def error(c: object, u: float, home: float) -> float:
    v = u - (home if c.reference is None else c.reference)  # type: ignore[attr-defined]
    wave = c.amplitude * np.sin(2 * np.pi * v / c.period + c.phase)  # type: ignore[attr-defined]
    table = np.interp(u, *np.transpose(c.knots)) if c.knots else 0.0  # type: ignore[attr-defined]
    return float(c.offset + c.slope * v + wave + table)  # type: ignore[attr-defined]


def answered(path: Path, at: Point, pose: Pose, command: dict[str, float], modes: int) -> Answer:
    s, t = path.system.s, at.tangent
    i = 6 * s.tip
    p, r = at.state.p[s.tip], at.state.r[s.tip]
    turn = Rotation.from_matrix(r @ np.array(pose.r).T).as_rotvec()
    effort = {n: -float(t.force[s.names.index(n)]) for n in command if n in s.names}
    effort |= {n: -v for n, v in t.tensions.items()}
    z = closed(np.vstack([t.rows, path.holds]) if len(path.holds) else t.rows)
    h = z.T @ t.curve @ z
    compliance = z[i : i + 6] @ np.linalg.solve(h, z[i : i + 6].T)
    values = np.linalg.eigvalsh(h + h.T)
    lowest = float(values[0] / np.abs(values).max()) if len(values) else 1.0
    return Answer(
        "found", pose, np.r_[p - np.array(pose.p), turn], compliance, effort, leg_wrenches(path, at),
        frequencies(s, at.state, z, h, modes) if modes else np.zeros(0), at.falling == 0, path.crossed, lowest,
        command, path.released,
    )  # fmt: skip


def leg_wrenches(path: Path, at: Point) -> dict[str, Array]:
    """Of each leg on the platform's body, about the TCP."""
    s, t = path.system.s, at.tangent
    body = s.platform
    out = {leg.name: np.zeros(6) for leg in s.d.legs}
    for p, push in zip(s.pairs, t.pushes, strict=True):
        if p.leg:
            for frame, own in ((p.a, push[:6]), (p.b, push[6:])):
                if frame.body == body:
                    out[p.leg] -= own
    for where, force, _, leg in path.system.lifts:
        if leg and where.body == body:
            arm = at.state.r[body] @ where.p
            out[leg] += np.r_[force, np.cross(arm, force)]
    for c in path.system.winches:
        if c.leg and c.at.body == body:
            out[c.leg] -= c.pull(at.state)[1]
    shift = at.state.p[body] - at.state.p[s.tip]
    for w in out.values():
        w[3:] += np.cross(shift, w[:3])
    return out


def frequencies(s: Structure, at: State, z: Array, h: Array, modes: int) -> Array:
    """Of the undamped vibration about the state, Hz: softest motions first; massless bodies follow."""
    mass = np.zeros((6 * s.size, 6 * s.size))
    for m in s.masses:
        if m.at.body == s.size:
            continue
        r = at.r[m.at.body]
        arm = r @ (m.at.p + m.at.r @ np.array(m.body.com))
        cross = np.cross(np.eye(3), arm).T
        turn = r @ m.at.r
        own = turn @ np.array(m.body.inertia) @ turn.T
        i = 6 * m.at.body
        way = np.hstack([np.eye(3), cross])
        mass[i : i + 6, i : i + 6] += m.body.mass * way.T @ way
        mass[i + 3 : i + 6, i + 3 : i + 6] += own
    swing = np.linalg.solve(h, z.T @ mass @ z)
    values = np.linalg.eigvals(swing)
    out = np.full(modes, np.nan)
    if np.abs(values.imag).max(initial=0.0) > 1e-9 * np.abs(values).max(initial=0.0):  # flutter
        return out
    squares = np.sort(values.real)[::-1][:modes]
    good = squares > 1e-14 * max(squares.max(initial=0.0), 1e-300)
    out[: len(squares)][good] = 1 / (2 * np.pi * np.sqrt(squares[good]))
    return out


__all__ = ["Answer", "Machine", "Unsupported"]
