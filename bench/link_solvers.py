"""scikit-fem against CalculiX on one bar: agreement of the fields, time of both, distance to Euler-Bernoulli.

python bench/link_solvers.py [--size 6]
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

import numpy as np

from stiffmap.model.link.identify import identify_link
from stiffmap.model.link.inputs import UNIT_WRENCHES
from stiffmap.model.link.pipeline import richardson
from stiffmap.model.link.shapes import Bar
from stiffmap.model.link.solve import Material, Setup, has_ccx, solve_ccx, solve_skfem

sys.path.insert(0, str(Path(__file__).parents[1] / "examples"))
from link_bars import cantilever, rectangle


def main() -> None:
    """Print one line per solver and head, then the refinement of the bar."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--size", type=float, default=6.0, help="edge length in mm")
    size = 1e-3 * parser.parse_args().size
    bar, aluminium = Bar(length=0.31, width=0.02, height=0.03), Material(70e9, 0.33)
    beam = cantilever(rectangle(0.02, 0.03), 0.31, 70e9, 70e9 / 2.66)
    mesh = bar.mesh(size)
    print(
        f"bar 310 x 20 x 30 mm, {len(mesh.nodes)} nodes, {len(mesh.tets)} ten-node tetrahedra, 6 load cases"
    )
    for head in ("distributed", "rigid"):
        setup = Setup("fixed", "loaded", bar.reference(), head)  # type: ignore[arg-type]
        fields = {}
        for name, solver in (("scikit-fem", solve_skfem), ("CalculiX", solve_ccx)):
            if name == "CalculiX" and not has_ccx():
                print("CalculiX is not installed")
                continue
            start = time.perf_counter()
            fields[name] = solver(mesh, aluminium, setup, UNIT_WRENCHES)
            seconds = time.perf_counter() - start
            ratio = np.diag(_link(mesh, fields[name], setup)) / np.diag(beam)
            print(
                f"{head:<12}{name:<11}{seconds:6.2f} s   k/Euler-Bernoulli "
                + " ".join(f"{r:.4f}" for r in ratio)
            )
        if len(fields) == 2:
            a, b = fields.values()
            gap = np.abs(a - b).max(axis=(1, 2)) / np.abs(a).max(axis=(1, 2))
            print(f"{head:<12}largest difference of the fields over their size: {gap.max():.1e}")
    setup = Setup("fixed", "loaded", bar.reference())
    meshes = [bar.mesh(s) for s in (2 * size, 1.41 * size, size)]
    C = np.array([_link(m, solve_skfem(m, aluminium, setup, UNIT_WRENCHES), setup) for m in meshes])
    found = richardson(np.array([m.size() for m in meshes]), C)
    relative = np.diag(found.error) / np.diag(C[-1])
    print(
        f"refinement: observed order {found.order:.2f}, mesh error " + " ".join(f"{r:.1e}" for r in relative)
    )


def _link(mesh, field, setup):  # type: ignore[no-untyped-def]
    nodes = mesh.face_nodes("loaded")
    return identify_link(
        mesh.nodes[nodes], field[:, nodes], UNIT_WRENCHES, reference=setup.reference
    ).compliance


if __name__ == "__main__":
    main()
