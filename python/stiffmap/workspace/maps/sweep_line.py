"""`stiffmap.sweep`: single forces, and paths with their critical points."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any, Unpack

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from stiffmap.common.broadcasting import Floats, one_of, real_number, refused, whole_number
from stiffmap.common.errors import StiffmapError
from stiffmap.solve.compiled import Role
from stiffmap.solve.compiled.machine import PATH_CONTROLS as CONTROLS
from stiffmap.solve.labels import meaning
from stiffmap.solve.machine import Machine, hint_metres, takes_machine
from stiffmap.solve.options import LoadingKeywords, spelled_out
from stiffmap.solve.status import Status
from stiffmap.workspace.maps.inputs import number_list, place, unit
from stiffmap.workspace.maps.loading import Loading, at_place, describe, displaced, dot, without_failed


@takes_machine
@spelled_out(LoadingKeywords)
def sweep(
    machine: Machine,
    position: ArrayLike,
    direction: ArrayLike,
    forces: ArrayLike | None = None,
    *,
    control: str = "force",
    limit: float | None = None,
    steps: int = 40,
    cross: int = 0,
    **given: Unpack[LoadingKeywords],
) -> xr.Dataset:
    """Deflection against the size of a force of one direction, at one position.

    With `forces` (control ``force``), each force is reached from the unloaded machine. With a `limit`,
    one path of equilibria is followed from the unloaded machine, and what happens on the way is
    reported: control ``force`` to a force `limit` (N), ``displacement`` to a displacement `limit` (m)
    along the direction, which passes limit points (snap-through), ``arc`` by arc length to that
    displacement, which passes turning points of either. `cross` k also follows, by arc length, the branch
    that crosses the path at its k-th bifurcation, towards the side to which its mode points; -k: to the
    other side. That branch ends at the `limit`, or where the force falls to zero.

    position (3,) m; direction (3,), any length; forces (n,) N, negative ones act against it;
    limit of either sign; steps to the limit. Other keywords as in `Machine.solve`.

    Returns a Dataset with dimension ``step`` and the coordinate force: displacement, deflection, deflection_xy,
    deflection_along (component along the force), compliance_along (of a little more force, m/N; NaN on a path),
    unstable_modes (number of directions in which the energy falls; NaN for single forces), status, flags,
    branch (1: the crossing one). Unstable equilibria keep their values (status 3); unreachable and not converged
    ones hold NaN. A path may have entries of the dimension ``critical``: critical_force, critical_kind
    (``limit`` or ``bifurcation``: there the path goes on along the branch it came on, and another one crosses),
    critical_branch, mode over ``coordinate``, mode_leg and mode_joint (what moves most in it); the attributes
    ``end`` and ``crossing_end`` say why its branches ended (empty for single forces).
    Raises StiffmapError for bad input.
    """
    loading = Loading(machine, **given)
    p, u = place(position), unit(direction)
    if forces is None or control != "force":
        if forces is not None:
            raise StiffmapError(f"forces: not with control {control!r}, which finds them; give a limit (m)")
        reach = check_control(control, limit, steps, loading.options.load_type, cross)
        return load_path(loading, p, u, control, reach, steps, cross)
    if limit is not None or cross:
        raise StiffmapError(f"{'cross' if limit is None else 'limit'}: not together with forces")
    f = number_list(forces, "forces")
    wrench = np.concatenate([f[:, None] * u, np.zeros((f.size, 3))], axis=1)
    s = loading.solve(p, wrench)
    d = without_failed(s.displacement, s.status, keep_unstable=True)
    c = without_failed(s.compliance, s.status, keep_unstable=True)
    variables = displaced("step", d, s.status, s.flags, "xy")
    own = {
        "deflection_along": dot(d[:, :3], u),
        "compliance_along": dot(dot(c[:, :3, :3], u), u),
        "unstable_modes": np.full(f.size, np.nan),
        "branch": np.zeros(f.size, dtype=np.intp),
    }
    return _dataset(loading, "force sweep", p, u, {"forces": f}, f, variables, own)


Critical = dict[str, float | Floats]
"""A critical point of a path: its numbers, its mode and its coordinates, by name."""
UNITS = {"force": "N", "displacement": "m", "arc": "m"}
ENDS = (
    "the limit was reached", "the commanded pose is out of reach", "singular without load", "no further equilibrium was found",
    "the largest number of points was listed", "the force fell to zero", "not followed",
)  # fmt: skip
"""In the order of the core's reasons why a branch ends."""


def load_path(
    loading: Loading, position: Floats, direction: Floats, control: str, limit: float, steps: int, cross: int
) -> xr.Dataset:
    """See `sweep`: what it does with a `limit`."""
    machine, options = loading.machine, loading.options
    one_of(options.point, machine.points, "point")
    turned = machine.compiled.home_rotation if options.rotation is None else options.rotation
    how: dict[str, Any] = {"control": control, "limit": limit, "steps": steps, "cross": cross}
    flags, *branches = machine.compiled.path(
        position, np.ascontiguousarray(turned, dtype=float), direction, point=options.point,
        gravity=np.array(loading.acting_gravity()), **how,
    )  # fmt: skip
    (end, points, critical), (crossing_end, crossing, crossing_critical) = branches
    hint_metres(machine, position, not points)
    forks = sum(not c["limit"] for c in critical)
    if abs(cross) > forks:
        raise StiffmapError(
            f"cross: the path has {forks} bifurcations, got {cross} (end of the path: {ENDS[end]})"
        )
    both = points + crossing
    d = np.array([p["displacement"] for p in both], dtype=float).reshape(-1, 6)
    unstable = np.array([p["unstable"] for p in both], dtype=float)
    status = np.where(unstable > 0, Status.UNSTABLE, Status.CONVERGED).astype(np.uint8)
    of_path = np.full(len(both), flags, dtype=np.uint32)
    variables = displaced("step", d, status, of_path, "xy")
    own = {
        "deflection_along": np.array([p["along"] for p in both], dtype=float),
        "compliance_along": np.full(len(both), np.nan),
        "unstable_modes": unstable,
        "branch": np.repeat([0, 1], [len(points), len(crossing)]),
    }
    force = np.array([p["load"] for p in both], dtype=float)
    ends = ENDS[end], _crossing_end(cross, critical, crossing, ENDS[crossing_end])
    title, points_of = f"load path by {control}", (critical, crossing_critical)
    return _dataset(loading, title, position, direction, how, force, variables, own, ends, points_of)


def _crossing_end(cross: int, critical: list[Critical], points: Sequence[object], end: str) -> str:
    """Why it ended; at its first point, where several modes leave no single branch to follow."""
    if cross and len(points) == 1:
        fork = [c for c in critical if not c["limit"]][abs(cross) - 1]
        at_once = int(np.abs(np.subtract(fork["after"], fork["before"])))
        if at_once > 1:
            return f"not followed: {at_once} modes at once, no single branch"
    return end


def check_control(control: str, limit: float | None, steps: int, load_type: object, cross: int) -> float:
    """The limit as a number; StiffmapError where the options do not fit together."""
    one_of(control, CONTROLS, "control")
    if limit is None or not np.isfinite(real_number(limit, "limit")) or limit == 0:
        raise refused(
            "limit", f"a number other than 0 ({UNITS[control]} for control {control!r})", repr(limit)
        )
    whole_number(steps, "steps", 1, what="a positive number")
    if load_type != "dead":
        raise StiffmapError(f"load_type: a path needs a conservative force, 'dead'; got {load_type!r}")
    return float(limit)


BRANCH = meaning("1", "0: from the unloaded machine; 1: the branch that crosses it")


MEANINGS = {
    "deflection_along": meaning("m", "translation along the force"),
    "compliance_along": meaning("m/N", "loaded compliance along the force; NaN on a path"),
    "unstable_modes": meaning("1", "directions in which the energy falls; NaN for single forces"),
    "branch": BRANCH,
}


def _dataset(
    loading: Loading, title: str, position: Floats, direction: Floats, how: dict[str, object], force: Floats,
    variables: dict[str, object], own: dict[str, np.ndarray], ends: tuple[str, str] = ("", ""),
    critical: tuple[Sequence[Critical], Sequence[Critical]] = ((), ()),
) -> xr.Dataset:  # fmt: skip
    """What `sweep` describes, `own` the variables that only sweeps have. A path and the branch that crosses it have ends and
    critical points."""
    modes, coordinate = critical_variables(loading.machine, [*critical[0], *critical[1]])
    modes["critical_branch"] = ("critical", np.repeat([0, 1], [len(c) for c in critical]), BRANCH)
    coords = {
        **coordinate,
        **at_place(position),
        "force": ("step", force, meaning("N", "force along the direction")),
        "direction": ("axis", direction, meaning("1", "direction of the force, base axes")),
    }
    call = {"function": "sweep", "position": position, "direction": direction, **how}
    points = [{"kind": _kind(c), "force": c["load"], "deflection_along": c["along"]} for c in critical[0]]
    attrs = describe(loading, title, call) | {
        "failed_poses": "NaN, with their status; unstable ones kept",
        "end": ends[0],
        "crossing_end": ends[1],
        "critical_points": json.dumps(points),
    }
    variables |= {name: ("step", values, MEANINGS[name]) for name, values in own.items()}
    return xr.Dataset(variables | modes, coords, attrs)


def _kind(c: Critical) -> str:
    return "limit" if c["limit"] else "bifurcation"


def critical_variables(
    machine: Machine, critical: list[Critical]
) -> tuple[dict[str, object], dict[str, object]]:
    """Variables and coordinates over the dimensions ``critical`` and ``coordinate``."""
    known = machine.compiled.names
    names = list(known.coordinates)

    def column(key: str) -> Floats:
        return np.array([c[key] for c in critical], dtype=float)

    modes, places = (column(key).reshape(len(critical), len(names)) for key in ("mode", "coordinates"))
    sizes = np.abs(modes) * np.where(known.prismatic, 1.0, machine.compiled.length)
    moving = [_joint(names, np.array(known.roles), s) for s in sizes]
    legs = [joint.split(".")[0] for joint in moving]
    what = "limit: the force has an extremum; bifurcation: branches cross"
    wide = ("critical", "coordinate")
    over: dict[str, object] = {
        "critical_force": ("critical", column("load"), meaning("N", "force at the critical point")),
        "critical_deflection": (
            "critical",
            column("along"),
            meaning("m", "translation along the force there"),
        ),
        "critical_kind": ("critical", np.array([_kind(c) for c in critical]).astype(str), meaning("", what)),
        "unstable_before": ("critical", column("before").astype(int)),
        "unstable_after": ("critical", column("after").astype(int)),
        "mode_leg": ("critical", np.array([leg if leg in machine.legs else "" for leg in legs]).astype(str)),
        "mode_joint": ("critical", np.array(moving).astype(str)),
        "mode": (wide, modes, meaning("m or rad", "buckling mode; the largest motion, angles as arcs, is 1")),
        "critical_coordinates": (wide, places, meaning("m or rad", "coordinates at the critical point")),
    }
    return over, {"coordinate": ("coordinate", np.array(names))}


def _joint(names: list[str], roles: object, sizes: Floats) -> str:
    """Joint, drive or spring coordinate that moves most; joints go before springs."""
    joints = np.where(roles != Role.SPRING, sizes, 0.0)
    pick = joints if joints.max(initial=0.0) > 0.1 * sizes.max() else sizes
    return names[int(np.argmax(pick))]
