"""Inputs of maps, polar diagrams and sweeps, refused at the door; the grid of a map where none is given; boxes of poses."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike

from stiffmap.common.broadcasting import Floats, real_array, real_number, trailing, whole_number, wrench_array
from stiffmap.common.errors import StiffmapError
from stiffmap.solve.machine import Machine

PLANES = {"xy": (0, 1), "xz": (0, 2), "yz": (1, 2)}


def axis(values: ArrayLike, name: str) -> Floats:
    """One axis of a grid (m): finite numbers, none twice, at least one."""
    out = number_list(values, name)
    if len(np.unique(out)) != out.size:
        raise StiffmapError(f"{name}: expected different numbers, got one of them twice")
    return out


def number_list(values: ArrayLike, name: str) -> Floats:
    """(n,) finite numbers, at least one."""
    out = np.atleast_1d(real_array(values, name))
    if out.ndim != 1:
        raise StiffmapError(f"{name}: expected one axis of numbers, got shape {out.shape}")
    if out.size == 0:
        raise StiffmapError(f"{name}: expected at least one number, got an empty grid")
    if not np.isfinite(out).all():
        raise StiffmapError(f"{name}: expected finite numbers, got {out[~np.isfinite(out)][0]} "
                            f"at index {int(np.argmin(np.isfinite(out)))}")  # fmt: skip
    return out


def rising(values: ArrayLike, name: str, what: str, above: float = -np.inf) -> Floats:
    """(n,) finite numbers above this one that rise, at least one; StiffmapError says `what` is expected."""
    out = number_list(values, name)
    fall = np.flatnonzero(~(np.diff(out, prepend=above) > 0))
    if fall.size:
        k = int(fall[0])
        after = f" after {out[k - 1]:g}" if k else ""
        raise StiffmapError(f"{name}: expected {what}; entry {k + 1} is {out[k]:g}{after}")
    return out


def place(position: ArrayLike, name: str = "position") -> Floats:
    """One finite TCP position (3,), m."""
    out = trailing(position, (3,), name, "a position (m)")
    if out.shape != (3,):
        raise StiffmapError(f"{name}: expected one position of shape (3,), got shape {out.shape}")
    if not np.isfinite(out).all():
        raise StiffmapError(f"{name}: expected finite numbers, got {out.tolist()}")
    return out


def unit(direction: ArrayLike, name: str = "direction") -> Floats:
    """Direction (3,) as a unit vector."""
    out = trailing(direction, (3,), name, "a direction")
    length = float(np.linalg.norm(out))
    if out.shape != (3,) or not np.isfinite(length) or length == 0:
        raise StiffmapError(f"{name}: expected one vector of 3 finite numbers, not all 0, got {out.tolist()}")
    return np.asarray(out / length)


def plane_axes(plane: str) -> tuple[int, int]:
    """Indices of the two base axes of a plane."""
    if not isinstance(plane, str) or plane not in PLANES:
        raise StiffmapError(f"plane: expected one of {', '.join(PLANES)}, got {plane!r}")
    return PLANES[plane]


def magnitude(value: float, name: str, unit_name: str) -> float:
    """A positive finite number."""
    out = real_number(value, name, f"a positive number ({unit_name})")
    if not np.isfinite(out) or out <= 0:
        raise StiffmapError(f"{name}: expected a positive number ({unit_name}), got {value!r}")
    return out


def wrench_cases(
    wrench: ArrayLike | Mapping[str, ArrayLike] | None, cases: tuple[str, ...] | None
) -> tuple[Floats, tuple[str, ...] | None]:
    """Wrenches (cases, 6) and their names; the names are None for a single, unnamed wrench."""
    if isinstance(wrench, Mapping):
        if not wrench or cases is not None:
            found = f"cases {list(cases)}" if cases is not None else "an empty mapping"
            raise StiffmapError(
                f"wrench: expected at least one case, and no cases= with a mapping, got {found}"
            )
        out = np.stack([wrench_array(w, f"wrench[{n!r}]") for n, w in wrench.items()])
        return out, tuple(map(str, wrench))
    out = wrench_array(wrench)
    if out.ndim == 1:
        if cases is not None and len(cases) != 1:
            raise StiffmapError(f"cases: expected one name of one wrench, got {list(cases)}")
        return out[None], cases
    if out.ndim != 2 or len(out) == 0:
        raise StiffmapError(f"wrench: expected shape (6,) or (cases, 6), got {out.shape}")
    names = cases or tuple(str(i) for i in range(len(out)))
    if len(names) != len(out) or len(set(names)) != len(names):
        raise StiffmapError(f"cases: expected {len(out)} different names, got {list(names)}")
    return out, names


def plane_force(wrenches: Floats, force: float | None) -> float:
    """Magnitude (N) of the forces that turn in the plane: as given, else the largest of the cases."""
    if force is not None:
        return magnitude(force, "force", "N")
    largest = float(np.linalg.norm(wrenches[:, :3], axis=1).max())
    if largest == 0:
        raise StiffmapError("force: the wrench holds no force whose direction could turn; "
                            "give force= (N), or plane=None to leave the directions out")  # fmt: skip
    return largest


POINTS = 51  # along each edge of a plane


def grid_of(
    machine: Machine, given: Mapping[str, ArrayLike | None], points: int = POINTS
) -> dict[str, ArrayLike]:
    """Axes (m) x, y, z: those given, the others over the workspace.

    A coordinate that is not commanded has one value, its home; planes lie at three heights where none is named. StiffmapError where an
    axis is wanted of a machine without a workspace.
    """
    whole_number(points, "points", 1)
    out: dict[str, ArrayLike] = {a: v for a, v in given.items() if v is not None}
    if len(out) == 3:
        return out
    low, high = machine.workspace
    named = bool(out)
    task = machine.description.task
    for i, a in enumerate("xyz"):
        if a in out:
            continue
        if task and a not in task:
            out[a] = [float(machine.description.home.p[i])]
        elif a == "z" and not named:
            middle = 0.0 if low[2] < 0 < high[2] else (low[2] + high[2]) / 2
            out[a] = [low[2], middle, high[2]]
        else:
            out[a] = np.linspace(low[i], high[i], points)
    if task and np.size(out["x"]) == np.size(out["y"]) == 1 and not named:
        out["z"] = np.linspace(low[2], high[2], points)  # only the height is commanded
    return {a: out[a] for a in "xyz"}


def read_box(machine: Machine, box: ArrayLike | None) -> tuple[Floats, Floats]:
    """Lowest and highest corner, (3,) m each; the machine's workspace where none is given."""
    given = machine.workspace if box is None else real_array(box, "box")
    if given.shape != (2, 3) or not np.isfinite(given).all() or (given[1] < given[0]).any():
        raise StiffmapError(
            f"box: expected lowest and highest corner (2, 3) in m, base axes, got {np.asarray(box).tolist()}"
        )
    return given[0], given[1]


def read_region(region: ArrayLike, axes: Sequence[int] = (0, 1, 2)) -> Floats:
    """(2, 3) m, where to look: lowest and highest corner, apart along these axes."""
    out = real_array(region, "region")
    if out.shape != (2, 3) or not (np.isfinite(out).all() and (out[1] > out[0])[list(axes)].all()):
        raise StiffmapError(f"region: expected lowest and highest corner (2, 3) in m, got {region!r}")
    return out


def box_nodes(low: Floats, high: Floats, nodes: int) -> Floats:
    """(nodes³, 3), the last axis fastest; an edge without length has one node."""
    whole_number(nodes, "nodes", 2)
    axes = [np.linspace(a, b, nodes if b > a else 1) for a, b in zip(low, high, strict=True)]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
