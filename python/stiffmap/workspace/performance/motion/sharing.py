"""More drives than freedoms, and more than the tool's motions: what each does (docs/theory.md D10, C11)."""

from __future__ import annotations

from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from stiffmap.common.broadcasting import Floats, one_of, thread_count
from stiffmap.common.errors import StiffmapError
from stiffmap.model.description import Cable, Joint
from stiffmap.model.description.tree import joints
from stiffmap.solve.kinematics import inverse_kinematics
from stiffmap.solve.machine import Machine

KINDS = ("least_norm", "stiffness")
STRIDE = 5e-3
"""Of the machine's length: how far the tool is from one closure to the next where rates are differences."""
FLAT = 1e-9  # singular values, relative to the largest, below which the tool has no motion


def drive_weights(machine: Machine, sharing: str) -> Floats:
    """(drives,) weights of the drives where these outnumber the freedoms; (0,): each as long as its arm.

    ``least_norm``: efforts of the least sum of squares, torques divided by the machine's length. ``stiffness``: as
    springs share, each drive in proportion to its stiffness; a commanded mismatch moves the tool as it would move
    the elastic drives. StiffmapError for another word, or for a drive that is rigid.
    """
    one_of(sharing, KINDS, "sharing")
    if sharing == "least_norm":
        return np.zeros(0)
    found = joints(machine.description)
    named = {name: _stiffness(machine, found[name]) for name in machine.actuators}
    rigid = [name for name, stiffness in named.items() if stiffness is None]
    if rigid:
        raise StiffmapError(f"sharing: by stiffness needs elastic drives; rigid: {', '.join(rigid)}")
    return np.array([stiffness for stiffness in named.values() if stiffness is not None])


def _stiffness(machine: Machine, joint: Joint) -> float | None:
    """Of a drive at rest, of a cable at home; None: rigid."""
    if not isinstance(joint, Cable):
        return joint.law.stiffness if joint.law is not None else None
    home = machine.description.home
    names = list(machine.actuators)
    free = inverse_kinematics(machine, home.p, home.r).actuators[names.index(joint.name)]
    soft = (free + joint.lead) / joint.elasticity if joint.elasticity else 0.0
    return 1.0 / (soft + (1.0 / joint.stiffness if joint.stiffness else 0.0))


def motions(together: NDArray[np.int32], values: Floats, redundancy: int) -> NDArray[np.int64]:
    """(...) how many motions of the tool the drives command: of singular values (..., n), largest first.

    As many as rates that go together. Of a redundant machine some of these leave the tool where it is: there it is the
    largest rank among the poses.
    """
    most = np.minimum(together, values.shape[-1]).astype(np.int64)
    if redundancy == 0:
        return most
    ok = np.isfinite(values).all(axis=-1)
    rank = (values > FLAT * values[..., :1]).sum(axis=-1)
    whole = int(rank[ok].max(initial=0))
    return np.minimum(most, whole) if whole else most


def facets(j: Floats, rank: int) -> tuple[Floats, Floats]:
    """Unit normals (..., f, rows) and distances (..., f) of the facets of the image of the unit cube under (..., rows,
    drives) of this rank, pairs of opposite ones once: the cube's image is all t in the range of j with
    |normal . t| <= distance. NaN stays NaN.
    """
    rows, n = j.shape[-2:]
    chosen = list(combinations(range(n), rank - 1))
    normals = np.full((*j.shape[:-2], len(chosen), rows), np.nan)
    distance = np.full((*j.shape[:-2], len(chosen)), np.nan)
    ok = np.isfinite(j).all(axis=(-2, -1))
    if not ok.any():
        return normals, distance
    u = np.linalg.svd(j[ok])[0][..., :rank]
    inside = np.swapaxes(u, -1, -2) @ j[ok]
    scale = np.linalg.norm(inside, axis=(-2, -1))
    for f, columns in enumerate(chosen):
        part = inside[..., list(columns)]
        left, size, _ = np.linalg.svd(part)
        normal = left[..., -1]
        reach = np.abs(np.einsum("...r,...rn->...n", normal, inside)).sum(axis=-1)
        # columns that span less than a facet have others near them
        flat = size[..., -1] < 1e-12 * scale if rank > 1 else np.zeros(len(scale), dtype=bool)
        normals[ok, f] = np.einsum("...rk,...k->...r", u, normal)
        distance[ok, f] = np.where(flat, np.inf, reach)
    return normals, distance


def sides(j: Floats, rank: int) -> tuple[Floats, Floats]:
    """`facets` as rows (..., f, rows) and limits (..., f) of |rows t| <= limits; 0 and 1 where there is no facet."""
    normals, distance = facets(j, rank)
    bounded = ~np.isinf(distance)
    return np.where(bounded[..., None], normals, 0.0), np.where(bounded, distance, 1.0)


def followed(
    machine: Machine, coordinates: Floats, twist: Floats, twist_rate: Floats, threads: int | None
) -> tuple[Floats, Floats]:
    """Rates and accelerations (n, drives) of a redundant machine at closed coordinates (n, coordinates) as its tool moves.

    Its joints are at every pose those nearest to home (theory C11), q = F(pose): rates are F' times the twist,
    accelerations F'' twice times it and F' times its rate, by differences of fourth order of the closed joints about
    each pose. NaN where a pose near by does not close.
    """
    compiled, drives, cores = machine.compiled, list(machine.compiled.drives), thread_count(threads)
    unit = np.array([1.0] * 3 + [compiled.length] * 3)
    h = STRIDE * compiled.length
    closed = np.asarray(np.isfinite(coordinates).all(axis=1))[:, None]
    _, p, r, _, _ = compiled.close_actuators(np.ascontiguousarray(coordinates[:, drives]), cores, coordinates)

    def joints_at(moved: Floats) -> Floats:
        turned = Rotation.from_rotvec(moved[:, 3:]).as_matrix() @ r
        out = compiled.rates(
            p + moved[:, :3],
            turned,
            coordinates,
            weights=np.zeros(0),
            patient=False,
            only=True,
            threads=cores,
        )
        return np.asarray(out["coordinates"][:, drives])

    def along(twist: Floats) -> tuple[Floats, Floats]:
        """First and second derivatives of the nearest joints along a straight way."""
        size = np.linalg.norm(unit * twist, axis=1)[:, None]
        moving = (size > 0) & closed
        step = np.where(moving, h * twist / np.where(moving, size, 1.0), 0.0)
        a, b, c, d, e = (joints_at(k * step) for k in (-2.0, -1.0, 0.0, 1.0, 2.0))
        first = (8 * (d - b) - (e - a)) / (12 * h)
        second = (16 * (b + d) - (a + e) - 30 * c) / (12 * h**2)
        return np.where(moving, first * size, 0.0), np.where(moving, second * size**2, 0.0)

    rate, bend = along(twist)
    return rate, bend + along(twist_rate)[0]
