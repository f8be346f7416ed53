"""From a part to its spring: mesh, field, identification, and the uncertainty by source (docs/link.md §6), that of the mesh by Richardson's
estimate."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from scipy.optimize import brentq

from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import StiffmapError
from stiffmap.model.link.checks import spread
from stiffmap.model.link.identify import identify_link
from stiffmap.model.link.linkfile import LinkFile
from stiffmap.model.link.mesh import SolidMesh
from stiffmap.model.link.result import Link
from stiffmap.model.link.solve import Material, Setup, has_ccx, mean_motion, solve_ccx, solve_skfem
from stiffmap.model.link.transport import Ints, standard_errors

PLAUSIBLE = (0.5, 5.0)  # an order outside is not believed; order one is then assumed


class Refinement(NamedTuple):
    """Extrapolation of a (6, 6) compliance over three or more meshes."""

    sizes: Floats  # (meshes,) m, coarse to fine
    order: float  # observed order of the trace of the scaled compliance; NaN when there is none
    estimate: Floats  # (6, 6) extrapolated to size zero
    error: Floats  # (6, 6) standard uncertainty of the finest mesh's compliance against size zero
    why: str = ""  # why the order is not believed; empty when it is

    @property
    def words(self) -> str:
        """The observed order, or why there is none."""
        return self.why or f"{self.order:.2f}"


def observed_order(sizes: Floats, values: Floats) -> float:
    """Order p in ``v = v0 + c h^p`` through the three finest meshes, link (14); NaN when not monotone.

    Args:
        sizes: (m >= 3,) m, coarse to fine; values: (m,).
    """
    h, v = sizes[-3:], values[-3:]
    first, second = v[1] - v[0], v[2] - v[1]
    if first * second <= 0:
        return float("nan")

    def gap(p: float) -> float:
        return float((h[0] ** p - h[1] ** p) / (h[1] ** p - h[2] ** p) - first / second)

    low, high = 1e-3, 20.0
    return float(brentq(gap, low, high)) if gap(low) * gap(high) < 0 else float("nan")


def richardson(sizes: Floats, compliances: Floats) -> Refinement:
    """Extrapolate compliances (m, 6, 6) over meshes of these sizes (m,) m, coarse to fine.

    One order is taken from the trace scaled by the finest diagonal, since single small entries are
    not monotone. The error is the extrapolated step; with two meshes only, or where the order is not
    plausible, the step that order one would give, and no extrapolation.

    Raises:
        StiffmapError: fewer than two meshes, or sizes that do not fall.
    """
    if len(sizes) < 2 or np.any(np.diff(sizes) >= 0):
        raise StiffmapError(f"refinement: expected at least two falling mesh sizes, got {np.asarray(sizes)}")
    scale = np.diag(compliances[-1])
    trace = np.array([np.sum(np.diag(C) / scale) for C in compliances])
    p = observed_order(sizes, trace) if len(sizes) > 2 else float("nan")
    change = compliances[-1] - compliances[-2]
    if not PLAUSIBLE[0] <= p <= PLAUSIBLE[1]:
        error = np.abs(change) / (sizes[-2] / sizes[-1] - 1)
        return Refinement(sizes, p, compliances[-1], error, _why(sizes, trace, p))
    step = change / ((sizes[-2] / sizes[-1]) ** p - 1)
    return Refinement(sizes, p, compliances[-1] + step, np.abs(step))


def _why(sizes: Floats, trace: Floats, order: float) -> str:
    """Why the order is not believed, and what is done instead."""
    if len(sizes) < 3:
        reason = "only two meshes differ in size"
    elif np.isnan(order):
        steps = ", ".join(f"{step:+.1e}" for step in np.diff(trace[-3:]) / trace[-1])
        reason = f"the meshes' trace changes by {steps} of itself, which no order explains"
    else:
        reason = f"{order:.2f} is outside {PLAUSIBLE[0]:g} to {PLAUSIBLE[1]:g}"
    return f"none ({reason}); order one is assumed"


def shift_covariance(shifts: list[Floats]) -> Floats:
    """(36, 36) mean square of alternative estimates' deviations (6, 6) from the one that is kept.

    A deviation is a systematic error of unknown size and sign, common to all entries: rank one each.
    """
    return np.asarray(np.mean([np.outer(s.ravel(), s.ravel()) for s in shifts], axis=0))


Solver = Literal["auto", "ccx", "skfem"]
Support = Literal["bed", "soft"]
Solve = Callable[[SolidMesh, Material, Setup, Floats], Floats]
COARSER = (2.0, 1.41)  # sizes of the refinement study over the finest
COARSE_ENOUGH = 1.05
FEWEST_PATCHES = 16  # a bootstrap over fewer says little


@dataclass(frozen=True)
class PartLink:
    """An identified part: the spring of the finest mesh, its uncertainty by source, and the fields."""

    link: Link
    covariances: dict[str, Floats]
    """(36, 36) by source; each systematic source is one common scale on its matrix of shifts."""
    refinement: Refinement | None
    mesh: SolidMesh
    nodes: Ints  # (n,) nodes of the loaded face in the mesh
    displacements: Floats  # (cases, all nodes, 3) m
    wrenches: Floats  # (cases, 6) N, N·m
    solver: str
    material: Material
    setup: Setup

    @property
    def covariance(self) -> Floats:
        """(36, 36) of all sources together."""
        return np.asarray(sum(self.covariances.values()))

    def table(self) -> str:
        """Relative standard uncertainty of the diagonal entries, a line per source."""
        lines = ["source    " + "".join(f"{f'k{i}{i}':>10}" for i in range(1, 7))]
        for source, V in {**self.covariances, "total": self.covariance}.items():
            relative = np.diag(standard_errors(V)) / np.diag(self.link.compliance)
            lines.append(f"{source:<10}" + "".join(f"{r:>10.1e}" for r in relative))
        return "\n".join(lines)

    def file(self, name: str) -> LinkFile:
        """The link file: compliance, total covariance, and where both come from."""
        source = {
            "mesh": {
                "nodes": len(self.mesh.nodes),
                "elements": len(self.mesh.tets),
                "type": "ten-node tetrahedron",
                "size_m": self.mesh.size(),
            },
            "material": self.material._asdict(),
            "solver": self.solver,
            "boundary": {"fixed": self.setup.fixed, "loaded": self.setup.loaded, "head": self.setup.head,
                         "support": self.setup.support},
            "noise_m": self.link.sigma.tolist(),
            "degrees_of_freedom": self.link.dof.tolist(),
            "standard_error": {k: standard_errors(V).tolist() for k, V in self.covariances.items()},
        }  # fmt: skip
        C = self.link.compliance
        return LinkFile((C + C.T) / 2, self.covariance, self.link.reference, source, name)


def link_from_part(
    mesher: Callable[[float | None], SolidMesh],
    material: Material,
    setup: Setup,
    wrenches: Floats,
    *,
    size: float | None = None,
    solver: Solver = "auto",
    study: bool = True,
    other_support: Support = "bed",
    refine: bool = True,
) -> PartLink:
    """Identify a part's spring from its own finite-element field.

    Args:
        mesher: makes the mesh for an edge length in m; None is its default.
        material, setup: SI; wrenches: (cases, 6) N, N·m at ``setup.reference``.
        size: edge length of the finest mesh in m.
        solver: "auto" takes CalculiX where it is installed.
        study: solve again with a rigid head and on another support, for the boundary's share of the error.
        other_support: "bed" for a base on something as stiff as the part, "soft" where only the mean motion of
            the fixed face is held, as by a pin in its hole.
        refine: solve two coarser meshes, for the mesh's share.

    Raises:
        StiffmapError: see the solvers, the meshers and :func:`identify_link`.
    """
    if solver not in ("auto", "ccx", "skfem"):
        raise StiffmapError(f"solver: expected auto, ccx or skfem, got {solver!r}")
    if other_support not in ("bed", "soft"):
        raise StiffmapError(f"support: expected bed or soft, got {other_support!r}")
    mesh = mesher(size)
    by_ccx = solver == "ccx" or (solver == "auto" and has_ccx())
    chosen, solve = ("CalculiX", solve_ccx) if by_ccx else ("scikit-fem", solve_skfem)
    field = solve(mesh, material, setup, wrenches)
    nodes = mesh.face_nodes(setup.loaded)
    link = _identify(mesh, nodes, field, setup, wrenches)
    parts = {
        "fit": _fit_covariance(link, wrenches),
        "region": _region_covariance(mesh, nodes, field, setup, wrenches, link),
    }

    def another(m: SolidMesh, s: Setup, by: Solve) -> Floats:
        """Compliance (6, 6) on another mesh, or of a part that is held or loaded otherwise."""
        return _identify(m, m.face_nodes(s.loaded), by(m, material, s, wrenches), s, wrenches).compliance

    refinement = None
    if refine:
        refinement = _refined(mesher, mesh, lambda m: another(m, setup, solve), link.compliance)
    if refinement is not None:
        shift = np.where(
            refinement.estimate == link.compliance, refinement.error, refinement.estimate - link.compliance
        )
        parts["mesh"] = shift_covariance([shift])
    if study:
        others = (setup._replace(head="rigid"), setup._replace(support=other_support))
        shifts = [another(mesh, s, solve_skfem) - link.compliance for s in others]
        # Head and support are two questions: their shares add.
        parts["boundary"] = np.sum([shift_covariance([s]) for s in shifts], axis=0)
    return PartLink(link, parts, refinement, mesh, nodes, field, wrenches, chosen, material, setup)


def _identify(mesh: SolidMesh, nodes: Ints, field: Floats, setup: Setup, wrenches: Floats) -> Link:
    return identify_link(mesh.nodes[nodes], field[:, nodes], wrenches, reference=setup.reference)


def _fit_covariance(link: Link, wrenches: Floats) -> Floats:
    """Error of the nodes' choice: block bootstrap over patches, and not below that of independent noise.

    The correlation model of `identify_link` takes the residual for one draw of a random field. On a face that
    deforms smoothly as a whole its length reaches the region, and then it overstates (docs/link.md §5).
    """
    e = link.evidence
    if e.correlation is None or not e.correlation.correlated or e.kept.shape[1] < 3 * FEWEST_PATCHES:
        return link.covariance
    f = e.field
    independent = identify_link(
        f.points, f.displacements, wrenches, reference=f.reference, noise="independent"
    )
    V = link.bootstrap()
    least = np.sqrt(np.diag(independent.covariance) / np.maximum(np.diag(V), 1e-300))
    up = np.maximum(least, 1.0)
    return np.asarray(V * np.outer(up, up))


def _region_covariance(
    mesh: SolidMesh, nodes: Ints, field: Floats, setup: Setup, wrenches: Floats, link: Link
) -> Floats:
    """Other sensible choices on the same field: corner nodes, the half near the reference, area weights."""
    corners = np.unique(mesh.face(setup.loaded)[:, :3])
    far = np.linalg.norm(mesh.nodes[nodes] - setup.reference, axis=1)
    choices: Sequence[Ints] = (corners, nodes[far <= np.median(far)])
    found = []
    for c in choices:
        s = spread(mesh.nodes[c])
        if len(c) > 8 and s[1] > 0.05 * s[0]:  # enough nodes, not along one line
            found.append(_identify(mesh, c, field, setup, wrenches).compliance)
    motion = mean_motion(mesh, setup.loaded, setup.reference, field)
    weighted = np.linalg.lstsq(wrenches, motion, rcond=None)[0].T
    return shift_covariance([C - link.compliance for C in [*found, (weighted + weighted.T) / 2]])


def _refined(
    mesher: Callable[[float | None], SolidMesh],
    finest: SolidMesh,
    compliance_on: Callable[[SolidMesh], Floats],
    compliance: Floats,
) -> Refinement:
    meshes = [mesher(factor * finest.size()) for factor in COARSER]
    # A thin part keeps its elements small whatever is asked: only meshes that came out coarser count.
    distinct = [m for m in meshes if m.size() > COARSE_ENOUGH * finest.size()]
    if len(distinct) == 2 and distinct[0].size() < COARSE_ENOUGH * distinct[1].size():
        distinct = distinct[1:]
    if not distinct:
        raise StiffmapError(
            f"refinement: elements of {1e3 * finest.size():.3g} mm are as large as the part allows; choose a "
            "smaller --size, or --quick without the mesh's share of the uncertainty"
        )
    sizes = np.array([m.size() for m in [*distinct, finest]])
    return richardson(sizes, np.array([*map(compliance_on, distinct), compliance]))
