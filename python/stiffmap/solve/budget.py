"""Where the deflection of the tool comes from: the share of each spring and drive."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from stiffmap.common.broadcasting import Floats, real_array
from stiffmap.common.errors import StiffmapError
from stiffmap.common.json_text import plain
from stiffmap.common.number_text import percents
from stiffmap.common.short import short_repr, table, titled
from stiffmap.model.description import Cable
from stiffmap.model.description.machine import in_words, source_of
from stiffmap.model.description.tree import joint_of, joints
from stiffmap.solve.compiled import Role, Status
from stiffmap.solve.machine import Machine, metres_expected, takes_machine
from stiffmap.solve.options import SolveKeywords, options_of
from stiffmap.solve.solution import Solution
from stiffmap.solve.solving import Call, solve_call

if TYPE_CHECKING:
    import pandas as pd

STEP = 1e-3
"""Of the load, of the central differences of internal wrenches."""
PIECES = 16
"""Of the load, over which the stretch of cables is summed."""
NAMED = 3
"""Elements that a sentence names."""


def in_shares(shares: Mapping[str, float]) -> str:
    """``57 % from z.foot, 21 % from z.bar``: of shares by element, the largest first."""
    named = zip(shares, percents(list(shares.values())), strict=True)
    return ", ".join(f"{share} % from {name}" for name, share in list(named)[:NAMED])


@short_repr
@dataclass(frozen=True, eq=False)
class DeflectionBudget:
    """Contributions to the displacement of the TCP at one pose under one wrench, SI, base axes."""

    elements: tuple[str, ...]
    """Full names of springs, elastic joints and drives."""
    contributions: Floats
    """(elements, 6) m, rad: displacement of the point that the deflection of each element causes."""
    displacement: Floats
    """(6,) under the load, against the machine without it."""
    position: Floats
    wrench: Floats
    point: str
    sources: tuple[str, ...] = ()
    """(elements,) where the stiffness of each comes from: assumed, measured, computed, catalogue or not marked."""

    @property
    def by_source(self) -> dict[str, float]:
        """Sum of the sizes of the shares by source, over that of all shares."""
        out: dict[str, float] = {}
        whole = float(np.abs(self.shares).sum()) or 1.0
        for source, share in zip(self.sources, np.abs(self.shares), strict=True):
            out[source] = out.get(source, 0.0) + float(share) / whole
        return dict(sorted(out.items(), key=lambda pair: -pair[1]))

    @property
    def shares(self) -> Floats:
        """(elements,) part of each in the translation, along the translation; they sum to 1 - `rest_share`.

        A negative share reduces the deflection.
        """
        d = self.displacement[:3]
        size = float(d @ d)
        return np.asarray(self.contributions[:, :3] @ d / (size or 1.0))

    @property
    def rest_share(self) -> float:
        """What is of second order in the deflections, lies in external springs, or is how cables under tension turn."""
        return float(self.displacement[:3].any()) - float(self.shares.sum())

    def ranked(self) -> list[tuple[str, Floats, float]]:
        """Element, contribution (6,), share; the largest share first."""
        order = np.argsort(-np.abs(self.shares), kind="stable")
        return [(self.elements[i], self.contributions[i], float(self.shares[i])) for i in order]

    def as_plain(self) -> dict[str, Any]:
        """Data of JSON, SI."""
        shares = {n: {"share": s, "displacement": c} for n, c, s in self.ranked()}
        whole = {"displacement": self.displacement, "elements": shares, "second_order": self.rest_share}
        return dict(plain(whole))

    def to_dataframe(self) -> pd.DataFrame:
        """Rows by element, µm and %, the largest share first."""
        import pandas as pd

        names = ("dx, µm", "dy, µm", "dz, µm")
        parts = {n: dict(zip(names, 1e6 * c[:3], strict=True)) for n, c, _ in self.ranked()}
        rows = {n: parts[n] | {"share, %": 100 * s} for n, _, s in self.ranked()}
        return pd.DataFrame.from_dict(rows, orient="index").rename_axis("element")

    def __str__(self) -> str:
        size = 1e6 * float(np.linalg.norm(self.displacement[:3]))
        lines = [f"{size:.1f} µm at {self.point}, of which"]
        lines += [
            f"  {100 * s:z6.1f} %  {n:<24} ({', '.join(f'{v:z.1f}' for v in 1e6 * c[:3])}) µm"
            for n, c, s in self.ranked()
        ]
        lines.append(f"  {100 * self.rest_share:z6.1f} %  of second order")
        return "\n".join([*lines, *filter(None, [in_words(self.by_source)])])

    def _repr_html_(self) -> str:
        """Shares, folded where there are many."""
        size = 1e6 * float(np.linalg.norm(self.displacement[:3]))
        rows = [
            (n, f"{100 * s:z.1f} %", ", ".join(f"{v:z.1f}" for v in 1e6 * c[:3])) for n, c, s in self.ranked()
        ]
        return titled(f"{size:.1f} µm at {self.point}", table(("element", "share", "dx, dy, dz, µm"), rows))


@takes_machine
def deflection_budget(
    machine: Machine,
    position: ArrayLike | None = None,
    wrench: ArrayLike | None = None,
    *,
    rotation: ArrayLike | None = None,
    point: str = "tcp",
    gravity: ArrayLike | None = None,
) -> DeflectionBudget:
    """How much of the tool's deflection each spring, elastic joint and drive causes.

    position (3,) m, None: home; wrench (6,) N, N·m at `point`, None: none; gravity (3,) m/s², None: the machine
    file's. By the unit-load theorem an element that deflects by t moves the point by Nᵀ t, where N is the
    wrench in the element under a unit wrench at the point. With N at half of the load the contributions sum
    to the displacement to first order; what is left is of second order in the load (`rest_share`).
    In a statically determinate machine each is the motion of the point if that element alone yielded.
    Raises StiffmapError where the pose has no stable equilibrium.
    """
    p = machine.description.home.p if position is None else real_array(position, "position")
    load = np.zeros(6) if wrench is None else real_array(wrench, "wrench")
    g = machine.compiled.gravity(gravity)
    options: SolveKeywords = {"rotation": rotation, "point": point, "method": "reference"}
    cases = ((load, g), (np.zeros(6), np.zeros(3)))
    calls = [Call(p, w, options_of({**options, "gravity": a})) for w, a in cases]
    loaded, free = (solve_call(machine.compiled, call)[0] for call in calls)
    for s in (loaded, free):
        if s.status.shape != ():
            raise StiffmapError("position: expected one pose and one wrench")
        if int(s.status) != Status.CONVERGED:
            hint = metres_expected(machine.compiled, p) if int(s.status) == Status.UNREACHABLE else ""
            raise StiffmapError(
                f"the pose is {Status(int(s.status)).name.lower()}: {hint or 'it has no deflection to share'}"
            )
    unit = _unit_reactions(machine, p, load / 2, g / 2, rotation, point)
    moved = loaded.coordinates - free.coordinates
    names, parts = _elements(machine)
    contributions = np.array([unit[:, i] @ np.nan_to_num(moved[i]) for i in parts]).reshape(-1, 6)
    if machine.compiled.names.cables:
        pulled = _of_cables(machine, p, load, g, rotation, point)
        contributions[[names.index(n) for n in machine.compiled.names.cables]] = pulled
    sources = tuple(source_of(machine.description, n) for n in names)
    return DeflectionBudget(
        names, contributions, loaded.displacement - free.displacement, p, load, point, sources
    )


def budget_where_stable(
    machine: Machine, position: ArrayLike, wrench: ArrayLike, **options: Any
) -> DeflectionBudget | None:
    """`deflection_budget`; None where no stable pose without load is there to compare with, as of a machine that has play."""
    try:
        return deflection_budget(machine, position, wrench, **options)
    except StiffmapError:
        return None


def _of_cables(
    machine: Machine, p: Floats, load: Floats, gravity: Floats, rotation: ArrayLike | None, point: str
) -> Floats:
    """(cables, 6) along the growing load, so that a cable counts while it is taut: its stretch times dT/dw."""
    compiled = machine.compiled
    size = max(float(np.abs(load).max()), 1.0)
    steps = STEP * size * np.array([1.0, 1.0, 1.0, *[compiled.length] * 3])
    ends, middles = np.linspace(0, 1, PIECES + 1), (np.arange(PIECES) + 0.5) / PIECES

    def pulled(share: float, extra: Floats) -> Solution:
        options: SolveKeywords = {"rotation": rotation, "point": point, "gravity": share * gravity}
        return solve_call(compiled, Call(p, share * load + extra, options_of(options)))[0]

    sides = np.concatenate([np.diag(steps), -np.diag(steps)])
    at = [pulled(s, np.zeros(6)) for s in ends]
    tension = np.array([s.tension for s in at])
    per_force = np.array([pulled(s, sides).tension for s in middles])
    unit = (per_force[:, :6] - per_force[:, 6:]) / (2 * steps[:, None])
    named = joints(machine.description)
    soft = []
    for name in compiled.names.cables:
        cable = named[name]
        assert isinstance(cable, Cable)
        free = float(at[0].coordinates[list(compiled.names.coordinates).index(name)])
        c = (free + cable.lead) / cable.elasticity if cable.elasticity else 0.0
        soft.append(cable.stretch * (c + (1.0 / cable.stiffness if cable.stiffness else 0.0)))
    return np.asarray(np.einsum("kwc,kc->cw", unit, np.diff(tension, axis=0) * soft))


def _unit_reactions(
    machine: Machine, p: Floats, load: Floats, gravity: Floats, rotation: ArrayLike | None, point: str
) -> Floats:
    """(6, coordinates): wrench in each coordinate per unit wrench at the point."""
    size = max(float(np.abs(load).max()), 1.0)
    steps = STEP * size * np.array([1.0, 1.0, 1.0, *[machine.compiled.length] * 3])
    wrenches = np.concatenate([load + np.diag(steps), load - np.diag(steps)])
    turned = machine.compiled.home_rotation if rotation is None else real_array(rotation, "rotation")
    force = machine.compiled.core.reactions(
        np.tile(p, (12, 1)), np.tile(turned, (12, 1, 1)), wrenches, point=point, gravity=gravity, threads=1
    )["force"]
    return np.asarray((force[:6] - force[6:]) / (2 * steps[:, None]))


def _elements(machine: Machine) -> tuple[tuple[str, ...], list[list[int]]]:
    """Full names and the coordinates of what can deflect; free joints are none."""
    names = machine.compiled.names
    named = joints(machine.description)
    parts: dict[str, list[int]] = {}
    for i, (name, role) in enumerate(zip(names.coordinates, names.roles, strict=True)):
        element = name.rpartition(".")[0] if role == Role.SPRING else name
        joint = joint_of(named, name)
        if role == Role.PASSIVE and (joint is None or not any(joint.laws)):
            continue
        parts.setdefault(element, []).append(i)
    return tuple(parts), list(parts.values())
