"""What several drives do together. Images of a box of drive values under a Jacobian: a zonotope, its vertices, its facets, its inscribed
sphere; its section in a plane: the hexagon of Figure 1c, for any number of drives. More drives than freedoms, and more than the tool's
motions: what each does (docs/theory.md D10, C11)."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations, product

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from stiffmap.common.broadcasting import Floats, one_of, thread_count
from stiffmap.common.errors import StiffmapError
from stiffmap.common.short import short_repr
from stiffmap.model.description import Cable, Joint
from stiffmap.model.description.tree import joints
from stiffmap.solve.kinematics import inverse_kinematics
from stiffmap.solve.machine import Machine

SOUND = 1e-8  # least determinant of a scaled normal matrix that is inverted as it is


def corners(n: int) -> Floats:
    """(2^(n-1), n) signs, one of each pair of opposite corners of the cube."""
    return np.array([(1.0, *s) for s in product((1.0, -1.0), repeat=n - 1)])


def farthest_vertex(j: Floats) -> Floats:
    """(...) largest norm of J s over all corners s of the cube: exact, the norm being convex."""
    images = j @ corners(j.shape[-1]).T
    return np.asarray(np.sqrt((images**2).sum(axis=-2).max(axis=-1)))


def worst_corner(j: Floats) -> Floats:
    """(..., drives) the corner whose image is farthest; NaN where there is none."""
    signs = corners(j.shape[-1])
    images = j @ signs.T
    size = (images**2).sum(axis=-2)
    return np.where(np.isnan(size).any(axis=-1, keepdims=True), np.nan, signs[np.argmax(size, axis=-1)])


def inverse_rows(j: Floats) -> Floats:
    """(..., drives, rows) pseudo-inverse: drive rates of a twist that the machine can do; NaN stays NaN."""
    out = np.full((*j.shape[:-2], j.shape[-1], j.shape[-2]), np.nan)
    ok = np.isfinite(j).all(axis=(-2, -1))
    a = j[ok]
    t = np.swapaxes(a, -1, -2)
    gram = t @ a
    scale = np.sqrt(np.einsum("...ii->...i", gram))
    with np.errstate(divide="ignore", invalid="ignore"):
        scaled = gram / (scale[..., :, None] * scale[..., None, :])
    sound = np.isfinite(scaled).all(axis=(-2, -1))
    sound[sound] = np.linalg.det(scaled[sound]) > SOUND
    inverse = np.empty_like(t)
    small = np.linalg.inv(gram[sound])
    first = small @ t[sound]
    # one correction makes up for the squared condition of the normal matrix
    inverse[sound] = first + small @ (t[sound] - gram[sound] @ first)
    inverse[~sound] = np.linalg.pinv(a[~sound], rcond=1e-12)
    out[ok] = inverse
    return out


def rows_limit(inverse: Floats, limits: Floats) -> Floats:
    """(...) speed reached in every direction of the machine's own motions, drives within `limits`."""
    with np.errstate(divide="ignore"):
        return np.asarray((limits / np.linalg.norm(inverse, axis=-1)).min(axis=-1))


NOTHING = 1e-12
"""Entries of the rows, relative to their largest, that count as zero: directions a drive does not feel."""


@short_repr
@dataclass(frozen=True, eq=False)
class Polygon:
    """What the drives can do in a plane, at poses (...)."""

    vertices: Floats
    """(..., m, 2) counter-clockwise, m the largest number of vertices; the last one repeats to fill up."""
    inner: Floats
    """(...) radius reached in every direction of the plane; 0 where the drives cannot hold the pose."""
    outer: Floats
    """(...) radius reached in the best direction."""
    status: NDArray[np.uint8]


def section_polygon(
    rows: Floats, limits: Floats, status: NDArray[np.uint8], bias: Floats | float = 0.0
) -> Polygon:
    """Polygon of |rows v + bias| <= limits; rows (..., drives, 2), limits (drives,), bias (..., drives)."""
    n = rows.shape[-2]
    half, room, inner = _nearest_border(rows, limits, bias)
    vertices, outer = _ordered(_crossings(half, room, 2 * n))
    outer = np.where(np.isnan(vertices).all(axis=(-2, -1)) & (inner > 0.0), np.inf, outer)  # a strip
    bad = np.asarray(~np.isfinite(rows).all(axis=(-2, -1)))
    vertices = np.where(bad[..., None, None], np.nan, vertices)
    inner, outer = (np.where(bad, np.nan, v) for v in (inner, outer))
    return Polygon(vertices, inner, outer, status)


def inner_radius(rows: Floats, limits: Floats, bias: Floats | float = 0.0) -> Floats:
    """(...) the polygon's inner radius alone, which is far quicker than its vertices."""
    inner = _nearest_border(rows, limits, bias)[2]
    return np.where(np.isfinite(rows).all(axis=(-2, -1)), inner, np.nan)


def _nearest_border(rows: Floats, limits: Floats, bias: Floats | float) -> tuple[Floats, Floats, Floats]:
    """Half-spaces half . v <= room, and the distance of the nearest border."""
    bias = np.broadcast_to(bias, rows.shape[:-1])
    half = np.concatenate([rows, -rows], axis=-2)
    room = np.concatenate([limits - bias, limits + bias], axis=-1)
    half = np.where(np.abs(half) < NOTHING * np.nanmax(np.abs(rows), initial=1e-300), 0.0, half)
    norms = np.linalg.norm(half, axis=-1)
    with np.errstate(invalid="ignore", divide="ignore"):
        distance = np.where(norms > 1e-300, room / norms, np.where(room >= 0, np.inf, -np.inf))
    nearest = np.where(np.isnan(distance), np.inf, distance).min(axis=-1)
    return half, room, np.maximum(nearest, 0.0)


def _crossings(half: Floats, room: Floats, count: int) -> Floats:
    """(..., pairs, 2) crossings of two borders that satisfy all others; NaN for the rest."""
    out = []
    slack = 1e-9 * np.abs(room).max(axis=-1, initial=0.0)
    for a, b in combinations(range(count), 2):
        (p, q), (r, s) = (half[..., a, 0], half[..., a, 1]), (half[..., b, 0], half[..., b, 1])
        det = p * s - q * r
        with np.errstate(invalid="ignore", divide="ignore"):
            v = np.stack(
                [(room[..., a] * s - q * room[..., b]) / det, (p * room[..., b] - r * room[..., a]) / det],
                axis=-1,
            )
            held = (half @ v[..., None])[..., 0]
            ok = np.isfinite(v).all(axis=-1) & (held <= room + slack[..., None]).all(axis=-1)
        out.append(np.where(ok[..., None], v, np.nan))
    return np.stack(out, axis=-2)


def _ordered(points: Floats) -> tuple[Floats, Floats]:
    """Vertices by angle about their mean, and the largest norm."""
    some = np.asarray(np.isfinite(points).all(axis=-1))
    count = np.maximum(some.sum(axis=-1), 1)[..., None]
    centre = np.where(some[..., None], points, 0.0).sum(axis=-2) / count
    offset = points - centre[..., None, :]
    angle = np.where(some, np.arctan2(offset[..., 1], offset[..., 0]), np.inf)
    order = np.argsort(angle, axis=-1)
    ordered = np.take_along_axis(points, order[..., None], -2)
    most = max(int(some.sum(axis=-1).max(initial=0)), 1)
    last = np.take_along_axis(ordered, (count - 1)[..., None], -2)
    ordered = np.where(np.isfinite(ordered), ordered, last)[..., :most, :]
    return ordered, np.where(some, np.linalg.norm(points, axis=-1), 0.0).max(axis=-1)


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


def of_motions(together: NDArray[np.int32], values: Floats, redundancy: int) -> tuple[Floats, Floats]:
    """Singular values (..., n), those beyond the tool's `motions` NaN, and the last one that counts.

    Drives that go together, or that leave the tool where it is, have none of their own.
    """
    count = motions(together, values, redundancy)
    last = np.take_along_axis(values, np.maximum(count - 1, 0)[..., None], axis=-1)[..., 0]
    return np.where(np.arange(values.shape[-1]) < count[..., None], values, np.nan), last


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
        out = compiled.core.kinematics(
            p + moved[:, :3], turned, coordinates, weights=np.zeros(0), patient=False, only=True, threads=cores
        )  # fmt: skip
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
