"""Displacement fields of a part that is held and loaded: by scikit-fem, with one factorisation for all load cases, and by
CalculiX where ``ccx`` is installed, an independent element and solver."""

from __future__ import annotations

import os
import shutil
import subprocess
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np
from scipy.sparse import csc_matrix, csr_matrix, eye as sparse_eye, kron
from scipy.sparse.linalg import splu

from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import StiffmapError, needed
from stiffmap.model.link.mesh import SolidMesh, face_area_centre, face_loads, face_mass
from stiffmap.model.link.readers import read_listing
from stiffmap.model.link.rigidfit import design_matrix
from stiffmap.model.link.transport import Ints

RESIDUAL = 1e-7  # work of the residual over the work of the load: the relative error of the compliance


class Material(NamedTuple):
    """Linear isotropic material, SI."""

    young: float  # Pa
    poisson: float
    name: str = "given"


class Setup(NamedTuple):
    """How the part is held and loaded. The wrench acts at ``reference`` on the face ``loaded``."""

    fixed: str
    loaded: str
    reference: Floats  # (3,) m
    head: Literal["distributed", "rigid"] = "distributed"  # traction linear over the face, or a rigid face
    # All nodes held; on a bed as stiff as the part; or a reaction that is linear over the face. Of the last two
    # the face's mean motion is taken out.
    support: Literal["clamped", "bed", "soft"] = "clamped"


def nodal_loads(mesh: SolidMesh, face: str, reference: Floats, wrenches: Floats) -> Floats:
    """(n, 3, cases) N: consistent nodal forces of tractions that are linear over the face, link (13)."""
    loads, gram = face_loads(mesh.nodes, mesh.face(face), reference)
    return np.asarray(loads @ np.linalg.solve(gram, wrenches.T))


def mean_motion(mesh: SolidMesh, face: str, reference: Floats, displacements: Floats) -> Floats:
    """(cases, 6) m, rad: area-weighted rigid motion of a face, work-conjugate to :func:`nodal_loads`."""
    loads, gram = face_loads(mesh.nodes, mesh.face(face), reference)
    return np.asarray(np.linalg.solve(gram, np.einsum("nia,kni->ak", loads, displacements)).T)


def solve_skfem(mesh: SolidMesh, material: Material, setup: Setup, wrenches: Floats) -> Floats:
    """(cases, n, 3) m: displacement of every node under each wrench (cases, 6).

    Raises:
        StiffmapError: unknown face, the part is not held, or the residual is too large.
    """
    K = stiffness_matrix(mesh, material)
    f = nodal_loads(mesh, setup.loaded, setup.reference, wrenches).reshape(-1, len(wrenches))
    if setup.support == "soft":
        return _solve_soft(mesh, K, setup, f)
    if setup.support == "bed":
        return _solve_bed(mesh, K, material, setup, f)
    held = _dofs(mesh.face_nodes(setup.fixed))
    if setup.head == "rigid":
        T = _rigid_head(mesh, setup, np.setdiff1d(np.arange(K.shape[0]), held))
        q = _factorised(T.T @ K @ T)(np.vstack([np.zeros((T.shape[1] - 6, len(wrenches))), wrenches.T]))
        return _field(T @ q, mesh)
    return _field(_held(K, held, f), mesh)


def _held(K: csc_matrix, held: Ints, f: Floats) -> Floats:
    """(3 n, cases) m under the forces f, with these degrees of freedom at zero."""
    free = np.setdiff1d(np.arange(len(f)), held)
    u = np.zeros_like(f)
    u[free] = _factorised(K[free][:, free])(f[free])
    return u


def stiffness_matrix(mesh: SolidMesh, material: Material) -> csc_matrix:
    """Sparse (3 n, 3 n) stiffness in N/m, node-major; four-point rule, as CalculiX's C3D10."""
    with needed("a finite-element field", "fea"):
        import skfem
        from skfem.models import elasticity
    solid = skfem.MeshTet2(mesh.nodes.T, mesh.tets.T)
    basis = skfem.Basis(solid, skfem.ElementVector(skfem.ElementTetP2()), intorder=2)
    lame = elasticity.lame_parameters(material.young, material.poisson)
    theirs = elasticity.linear_elasticity(*lame).assemble(basis)
    place = np.empty((len(mesh.nodes), 3), dtype=np.int64)
    place[mesh.tets] = basis.element_dofs.T.reshape(-1, 10, 3)
    order = place.ravel()
    return theirs.tocsr()[order][:, order].tocsc()


def _solve_soft(mesh: SolidMesh, K: csc_matrix, setup: Setup, f: Floats) -> Floats:
    """Reaction linear over the fixed face; its mean motion is then taken out of the field."""
    centre = mesh.nodes[mesh.face_nodes(setup.fixed)].mean(axis=0)
    modes = design_matrix(mesh.nodes, centre).reshape(-1, 6)
    reaction = -(modes.T @ f).T
    f = f + nodal_loads(mesh, setup.fixed, centre, reaction).reshape(f.shape)
    u = _held(K, _three_two_one(mesh), f)
    return _less_mean_motion(mesh, setup.fixed, centre, _field(u, mesh))


def _solve_bed(mesh: SolidMesh, K: csc_matrix, material: Material, setup: Setup, f: Floats) -> Floats:
    """Springs of E/sqrt(area) under the fixed face, about those of a neighbour of the same material."""
    face = mesh.face(setup.fixed)
    area, centre = face_area_centre(mesh.nodes, face)
    bed = kron(face_mass(mesh.nodes, face), sparse_eye(3)) * (material.young / np.sqrt(area))
    return _less_mean_motion(mesh, setup.fixed, centre, _field(_factorised(K + bed)(f), mesh))


def _less_mean_motion(mesh: SolidMesh, face: str, centre: Floats, field: Floats) -> Floats:
    motion = mean_motion(mesh, face, centre, field)
    return np.asarray(field - np.einsum("nia,ka->kni", design_matrix(mesh.nodes, centre), motion))


def _three_two_one(mesh: SolidMesh) -> Ints:
    """Six degrees of freedom that stop all rigid motion, at three far corners."""
    p = mesh.nodes
    a = int(np.argmin(p @ [1.0, 0.3, 0.1]))
    b = int(np.argmax(np.linalg.norm(p - p[a], axis=1)))
    along = (p[b] - p[a]) / np.linalg.norm(p[b] - p[a])
    c = int(np.argmax(np.linalg.norm(np.cross(p - p[a], along), axis=1)))
    x = int(np.argmax(np.abs(along)))
    first = [3 * b + i for i in range(3) if i != x]
    last = int(np.argmax(np.abs(np.cross(along, p[c] - p[a]))))
    return np.array([3 * a, 3 * a + 1, 3 * a + 2, *first, 3 * c + last])


def _rigid_head(mesh: SolidMesh, setup: Setup, free: Ints) -> csr_matrix:
    """Sparse map from the free degrees of freedom and the twist of the reference point to all."""
    head = mesh.face_nodes(setup.loaded)
    inner = np.setdiff1d(free, _dofs(head))
    A = design_matrix(mesh.nodes[head], setup.reference).reshape(-1, 6)
    rows = np.concatenate([inner, np.repeat(_dofs(head), 6)])
    columns = np.concatenate([np.arange(len(inner)), np.tile(len(inner) + np.arange(6), len(A))])
    values = np.concatenate([np.ones(len(inner)), A.ravel()])
    return csr_matrix((values, (rows, columns)), shape=(3 * len(mesh.nodes), len(inner) + 6))


def _factorised(K: csc_matrix) -> Callable[[Floats], Floats]:
    K = csc_matrix(K)
    try:
        lu = splu(K, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    except RuntimeError:
        raise StiffmapError(
            "solver: the stiffness matrix is singular; is the part held at its fixed face?"
        ) from None

    def solve(f: Floats) -> Floats:
        u = lu.solve(np.ascontiguousarray(f))
        u = u + lu.solve(np.ascontiguousarray(f - K @ u))  # one refinement: a slender part is ill-conditioned
        work = np.abs(np.sum(u * f, axis=0))
        left = float(np.max(np.abs(np.sum(u * (K @ u - f), axis=0)) / np.maximum(work, 1e-300)))
        if not np.isfinite(left) or left > RESIDUAL:
            raise StiffmapError(
                f"solver: not converged, residual work {left:.1e} of the load's (expected below {RESIDUAL:g})"
            )
        return np.asarray(u)

    return solve


def _dofs(nodes: Ints) -> Ints:
    return (3 * nodes[:, None] + np.arange(3)).ravel()


def _field(u: Floats, mesh: SolidMesh) -> Floats:
    return np.ascontiguousarray(u.reshape(len(mesh.nodes), 3, -1).transpose(2, 0, 1))


def has_ccx() -> bool:
    """True where the program ``ccx`` is on the path."""
    return shutil.which("ccx") is not None


def solve_ccx(mesh: SolidMesh, material: Material, setup: Setup, wrenches: Floats) -> Floats:
    """(cases, n, 3) m: as :func:`stiffmap.model.link.solve.solve_skfem`, for a clamped support.

    CalculiX prints seven digits, so fields agree with scikit-fem's to about 1e-6 of their size.

    Raises:
        StiffmapError: ccx is not installed, stops with an error or leaves a load case unsolved.
    """
    if not has_ccx():
        raise StiffmapError(
            "CalculiX (ccx) is not installed: apt install calculix-ccx, or use --solver skfem"
        )
    if setup.support != "clamped":
        raise StiffmapError(f"CalculiX is driven with a clamped support only, got {setup.support!r}")
    with tempfile.TemporaryDirectory() as folder:
        job = Path(folder) / "part"
        job.with_suffix(".inp").write_text(ccx_input(mesh, material, setup, wrenches))
        env = {"OMP_NUM_THREADS": "2", **os.environ}
        done = subprocess.run(
            ["ccx", job.name], cwd=folder, env=env, capture_output=True, text=True, check=False
        )
        errors = [line.strip() for line in done.stdout.splitlines() if "*ERROR" in line]
        if done.returncode or errors or not job.with_suffix(".dat").is_file():
            more = f" (and {len(errors) - 1} more)" if len(errors) > 1 else ""
            first = errors[0] if errors else "no message"
            raise StiffmapError(f"ccx stopped (code {done.returncode}): {first}{more}")
        numbers, fields = read_listing(job.with_suffix(".dat"))
    if len(fields) != len(wrenches) or len(numbers) < len(mesh.nodes):
        raise StiffmapError(f"ccx: not converged, {len(fields)} of {len(wrenches)} load cases solved")
    keep = numbers <= len(mesh.nodes)
    out = np.empty((len(wrenches), len(mesh.nodes), 3))
    out[:, numbers[keep] - 1] = fields[:, keep]
    return out


def ccx_input(mesh: SolidMesh, material: Material, setup: Setup, wrenches: Floats) -> str:
    """Text of the input deck: one static step per load case.

    Numbers have 12 digits: CalculiX reads the first 20 characters of a field and drops an exponent behind.
    """
    n = len(mesh.nodes)
    lines = [
        "*NODE, NSET=ALL",
        *(f"{i}, {x:.12e}, {y:.12e}, {z:.12e}" for i, (x, y, z) in enumerate(mesh.nodes, 1)),
    ]
    # CalculiX and this mesh number the ten nodes alike.
    lines += ["*ELEMENT, TYPE=C3D10, ELSET=SOLID"]
    lines += [", ".join(map(str, (i, *(t + 1)))) for i, t in enumerate(mesh.tets, 1)]
    lines += ["*NSET, NSET=FIXED", *(f"{i + 1}," for i in mesh.face_nodes(setup.fixed))]
    lines += ["*MATERIAL, NAME=M", "*ELASTIC", f"{material.young:.12e}, {material.poisson:.12e}"]
    lines += ["*SOLID SECTION, ELSET=SOLID, MATERIAL=M"]
    rigid = setup.head == "rigid"
    if rigid:
        x, y, z = setup.reference
        lines += ["*NODE", f"{n + 1}, {x:.12e}, {y:.12e}, {z:.12e}", f"{n + 2}, {x:.12e}, {y:.12e}, {z:.12e}"]
        lines += ["*NSET, NSET=HEAD", *(f"{i + 1}," for i in mesh.face_nodes(setup.loaded))]
        lines += [f"*RIGID BODY, NSET=HEAD, REF NODE={n + 1}, ROT NODE={n + 2}"]
    lines += ["*BOUNDARY", "FIXED, 1, 3"]
    forces = None if rigid else nodal_loads(mesh, setup.loaded, setup.reference, wrenches)
    for k, wrench in enumerate(wrenches):
        lines += ["*STEP", "*STATIC", "*CLOAD, OP=NEW"]
        if forces is None:
            loads = [(n + 1 + i // 3, i % 3, w) for i, w in enumerate(wrench)]
        else:
            loads = [(i + 1, j, forces[i, j, k]) for i, j in np.argwhere(forces[:, :, k])]
        lines += [f"{i}, {j + 1}, {value:.12e}" for i, j, value in loads]
        lines += ["*NODE PRINT, NSET=ALL", "U", "*END STEP"]
    return "\n".join(lines) + "\n"
