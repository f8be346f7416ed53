"""The same fields by CalculiX, where ``ccx`` is installed: an independent element and solver."""

from __future__ import annotations

import os
import shutil
import subprocess
import tempfile
from pathlib import Path

import numpy as np

from stiffmap.common.errors import StiffmapError
from stiffmap.model.link.arrays import Floats
from stiffmap.model.link.mesh import SolidMesh
from stiffmap.model.link.readers import read_dat
from stiffmap.model.link.solve import Material, Setup, nodal_loads


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
        numbers, fields = read_dat(job.with_suffix(".dat"))
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
