"""Largest box similar to a given one inside the workspace, equation (3) of the paper (theory D8, D9)."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

from stiffmap.common.broadcasting import Floats, real_array, whole_number
from stiffmap.common.errors import StiffmapError
from stiffmap.common.rotations import as_rotations
from stiffmap.common.short import short_repr
from stiffmap.model.files.load import Source
from stiffmap.solve.machine import Machine, as_machine
from stiffmap.solve.options import keywords_of
from stiffmap.workspace.maps.inputs import magnitude, read_region
from stiffmap.workspace.performance.box.box_search import BoxSearch
from stiffmap.workspace.performance.box.proof import judge_on
from stiffmap.workspace.performance.limits.limits import Bounds

WORK = 100_000  # cells and poses at most; when they are used up, the bounds stay as far apart as they are


@short_repr
@dataclass(frozen=True, eq=False)
class LargestBox:
    """Bounds on the largest similar box, and where it is."""

    edge: float
    """m, first edge of a box that is proven to lie inside the workspace: the lower bound."""
    edge_upper: float
    """m, no box of this first edge or more fits (within the region searched)."""
    edges: Floats
    """(3,) m of the proven box."""
    centre: Floats
    """(3,) m, base axes."""
    orientation: Floats
    """(3, 3) axes of the box in base axes."""
    limited_by: tuple[str, ...]
    """What would break first."""
    region: Floats
    """(2, 3) m, where boxes were looked for, in the box's own axes about the base origin."""
    guarantee: str
    """``proven``: every pose of the box, by enclosures; ``sampled: ...`` with the reason: nodes and second
    differences; ``none``: no box was found."""
    exhausted: bool
    """Whether the work allowed was used up before the bounds met."""
    poses: int
    """Poses and cells that were closed for it."""
    bounds: Bounds = field(repr=False)
    """What was asked of a pose; judges more of them."""

    @property
    def proven(self) -> bool:
        """Whether a box was found and every pose of it was proven."""
        return self.guarantee == "proven"

    @property
    def gap(self) -> float:
        """m between the bounds."""
        return self.edge_upper - self.edge

    @property
    def corners(self) -> Floats:
        """(2, 3) m, lowest and highest corner in the box's axes."""
        local = self.orientation.T @ self.centre
        return np.stack([local - self.edges / 2, local + self.edges / 2])


@keywords_of(Bounds)
def largest_box(
    machine: Machine | Source,
    proportions: ArrayLike = (1.0, 1.0, 1.0),
    *,
    transmission: tuple[float, float] | None = (0.5, 2.0),
    orientation: ArrayLike | str | None = None,
    region: ArrayLike | None = None,
    tolerance: float = 1e-4,
    max_evaluations: int = WORK,
    scheduler: object = None,
    **limits: Any,
) -> LargestBox:
    """Largest box of given proportions, anywhere in the workspace, all of it within the limits.

    Parameters
    ----------
    proportions
        (3,) edges relative to each other, (1, 1, 1) for a cube.
    transmission
        Bounds on the transmission factors; None: not asked for.
    norm
        ``sphere``: singular values of the (weighted) Jacobian; ``cube``: `cube_min` and `cube_max` of
        `velocity_transmission`, each drive within one unit of speed.
    length
        Characteristic length, as in `velocity_transmission`.
    ranges, joints
        Whether ranges of drives and limits of passive joints count.
    clearance
        m, least distance between the axes of members of different legs; None: not asked for.
    deflection
        (force in N, plane or None, most in m): deflection under a force in its worst direction. A box is
        then sampled, since nothing bounds a deflection between poses.
    rotation
        (3, 3) commanded orientation of the platform; None: as at home.
    orientation
        (3, 3) axes of the box in base axes; None: base axes; ``search``: turned so that a larger box fits
        (the bounds then hold for that orientation).
    region
        (2, 3) m, where to look (in the box's axes); None: the machine's workspace, three times as large.
    tolerance
        m: search goes on until upper and lower bound are this near ...
    max_evaluations
        ... or this many poses and cells were closed, those of the climb not counted; the bounds hold all the same.
    scheduler
        Address of a dask scheduler, or a `distributed.Client`: its workers prove the cells, with the same answer.

    Notes
    -----
    The lower bound is a box all of whose poses are proven by enclosures of closure and slopes
    (theory D8), where the machine's closure allows it (`LargestBox.guarantee`). The upper bound
    excludes every centre by a pose that breaks a limit.

    Raises
    ------
    StiffmapError
        For bad input.
    """
    machine = as_machine(machine)
    shape = real_array(proportions, "proportions")
    if shape.shape != (3,) or not (np.isfinite(shape).all() and (shape > 0).all()):
        raise StiffmapError(f"proportions: expected 3 positive numbers, got {proportions!r}")
    magnitude(tolerance, "tolerance", "m")
    whole_number(max_evaluations, "max_evaluations", 1)
    bounds = Bounds(machine, transmission=transmission, **limits)
    space, shape = _region(machine, region, shape / shape[0])
    if isinstance(orientation, str):
        if orientation != "search":
            raise StiffmapError(f"orientation: expected 'search' or (3, 3) axes, got {orientation!r}")
        axes = best_orientation(bounds, shape, space, tolerance)
    else:
        axes = np.eye(3) if orientation is None else as_rotations(real_array(orientation, "orientation"))
    space = space if region is not None and not isinstance(orientation, str) else turned(space, axes)
    with judge_on(bounds, scheduler) as judge:
        search = BoxSearch(bounds, shape, axes, space, tolerance, max_evaluations, judge)
        upper = search.run()
    why = bounds.unproven
    return LargestBox(
        edge=search.best, edge_upper=upper, edges=search.best * shape,
        centre=np.asarray((search.centre * shape) @ axes.T), orientation=axes, limited_by=search.names, region=space,
        guarantee="none" if search.best == 0 else f"sampled: {why}" if why else "proven",
        exhausted=search.exhausted, poses=bounds.counter[0], bounds=bounds,
    )  # fmt: skip


THIN = 1e-9


def _region(machine: Machine, region: ArrayLike | None, shape: Floats) -> tuple[Floats, Floats]:
    """Where to look, and the box's shape: without thickness where the workspace has none or nothing is commanded."""
    if region is not None:
        return read_region(region), shape
    low, high = machine.workspace
    centre, half = (low + high) / 2, (high - low) / 2
    flat = (half == 0) | ~np.isin(["x", "y", "z"], machine.description.task)
    thin = np.where(flat, THIN, 1.0)
    half = np.where(flat, THIN * half.max(), half)
    return np.stack([centre - 3 * half, centre + 3 * half]), shape * thin


STARTS = 6
TRIALS = 40


def best_orientation(bounds: Bounds, shape: Floats, region: Floats, gap: float) -> Floats:
    """(3, 3) axes of the box, by a simplex search over rotation vectors from several starts, corners only.

    A local answer: the bounds of `largest_box` hold for the orientation that is returned.
    """
    size = float(np.max(region[1] - region[0]))

    def minus_edge(vector: Floats) -> float:
        axes = Rotation.from_rotvec(vector).as_matrix()
        alone = replace(bounds, counter=[0])
        return -BoxSearch(alone, shape, axes, turned(region, axes), 1e-3 * size, 10**9).estimate()[1]

    rng = np.random.default_rng(0)
    starts = np.concatenate([np.zeros((1, 3)), rng.uniform(-np.pi / 4, np.pi / 4, (STARTS - 1, 3))])
    first = sorted(starts, key=minus_edge)[:2]
    found = [
        minimize(minus_edge, s, method="Nelder-Mead",
                 options={"maxfev": TRIALS, "initial_simplex": s + 0.2 * np.vstack([np.zeros(3), np.eye(3)])})
        for s in first
    ]  # fmt: skip
    best = min(found, key=lambda f: float(f.fun))
    if -best.fun <= -minus_edge(np.zeros(3)) + 2 * gap:
        return np.eye(3)
    return np.asarray(Rotation.from_rotvec(best.x).as_matrix())


def turned(region: Floats, axes: Floats) -> Floats:
    """(2, 3) box along `axes` about a box along the base axes."""
    low, high = region
    centre, half = axes.T @ ((low + high) / 2), np.abs(axes.T) @ (high - low) / 2
    return np.stack([centre - half, centre + half])
