"""The Orthoglide's foot as an L-bracket: which bracket comes nearest to the declared foot spring?

The paper gives no foot; docs/machines.md declares a cantilever of EA, GJ, EIx, EIz along -y. Least squares over
finite-element solutions, over all six diagonal entries and over the four of bending alone: no isotropic
solid section has the declared EA, EI and GJ together, which two bounds below show without any search.

    python examples/link_foot.py
"""

from __future__ import annotations

import argparse
from typing import NamedTuple

import numpy as np
from scipy.optimize import least_squares

from stiffmap.model.link.inputs import MATERIALS, UNIT_WRENCHES
from stiffmap.model.link.pipeline import PartLink, link_from_part
from stiffmap.model.link.shapes import Foot
from stiffmap.model.link.solve import Material, Setup


class Beam(NamedTuple):
    """The declared foot: a cantilever along -y; m, N, N·m²."""

    height: float
    EA: float
    GJ: float
    EIx: float
    EIz: float


DECLARED = {
    "original": Beam(0.100, 1.0e8, 1.5e3, 2.0e2, 2.0e3),
    "revised": Beam(0.250, 2.0e8, 1.5e4, 2.0e3, 2.0e4),
}
ENTRIES = [(0, 0), (1, 1), (2, 2), (3, 3), (4, 4), (5, 5), (0, 5), (2, 3)]
BENDING = np.array([1, 0, 1, 1, 0, 1])  # k11, k33, k44, k66
FACTOR = {0: 1e3, 1: 1.0, 2: 1e-3}  # SI to mm/N, 1/N, rad/(N·mm), by the number of angular indices
UNIT = {0: "mm/N", 1: "1/N", 2: "rad/(N·mm)"}


def declared(beam: Beam) -> np.ndarray:
    """(6, 6) SI compliance at the end of the cantilever along -y."""
    h, C = beam.height, np.zeros((6, 6))
    C[0, 0], C[5, 5] = h**3 / (3 * beam.EIz), h / beam.EIz
    C[2, 2], C[3, 3] = h**3 / (3 * beam.EIx), h / beam.EIx
    C[1, 1], C[4, 4] = h / beam.EA, h / beam.GJ
    C[0, 5] = C[5, 0] = h**2 / (2 * beam.EIz)
    C[2, 3] = C[3, 2] = -(h**2) / (2 * beam.EIx)
    return C


def bounds_of_any_section(beam: Beam, material: Material) -> tuple[float, float]:
    """Smallest possible k22 and k55 over the declared ones, of prismatic uprights with the declared EIx, EIz.

    Torsion: J <= Ix + Iz (Saint-Venant). Area: of all sections with given Ix and Iz the solid ellipse has
    the largest, A^4 = 16 pi^2 Ix Iz.
    """
    shear = material.young / (2 * (1 + material.poisson))
    inertia = np.array([beam.EIx, beam.EIz]) / material.young
    area = (16 * np.pi**2 * inertia.prod()) ** 0.25
    return beam.EA / (material.young * area), beam.GJ / (shear * inertia.sum())


def bracket(beam: Beam, x: np.ndarray) -> Foot:
    """The part, from the logarithms of upright and depth; a base as thick as deep, three uprights long."""
    upright, depth = np.exp(x)
    return Foot(height=beam.height, upright=upright, depth=depth, base=3 * upright, plate=depth)


def solve(shape: Foot, material: Material, study: bool, size: float | None = None) -> PartLink:
    """Identified link of a bracket."""
    setup = Setup("fixed", "loaded", shape.reference())
    return link_from_part(
        shape.mesh, material, setup, UNIT_WRENCHES, size=size, solver="skfem", study=study, refine=study
    )


def nearest(beam: Beam, material: Material, weights: np.ndarray) -> Foot:
    """Least squares of log(k / declared) over finite-element solutions, started from the solid rectangle
    that has the declared EIx and EIz."""
    target = np.diag(declared(beam))
    ratio = np.sqrt(beam.EIz / beam.EIx)
    depth = (12 * beam.EIx / (material.young * ratio)) ** 0.25

    def misfit(x: np.ndarray) -> np.ndarray:
        k = np.diag(solve(bracket(beam, x), material, study=False).link.compliance)
        return np.asarray(weights * np.log(k / target))

    start = np.log([ratio * depth, depth])
    # A mesh changes in steps with the shape: differences over 4 % look across its noise.
    found = least_squares(misfit, start, diff_step=0.04 / np.abs(start), max_nfev=6, xtol=1e-3)
    return bracket(beam, found.x)


def table(beam: Beam, part: PartLink) -> str:
    """Side by side with the declared foot, in the paper's units."""
    target, k, u = declared(beam), part.link.compliance, part.budget.standard_error()
    lines = [f"{'entry':<16}{'declared':>12}{'ours':>12}{'std. unc.':>11}{'ours/declared':>15}"]
    for i, j in ENTRIES:
        kind = (i > 2) + (j > 2)
        a, b, e = (FACTOR[kind] * m[i, j] for m in (target, k, u))
        lines.append(f"k{i + 1}{j + 1} {UNIT[kind]:<12}{a:>12.3e}{b:>12.3e}{e:>11.1e}{b / a:>15.3f}")
    return "\n".join(lines)


def zeros(part: PartLink) -> str:
    """Names of the entries that are zero within the test."""
    zero = part.link.insignificant
    return ", ".join(f"k{i + 1}{j + 1}" for i in range(6) for j in range(i, 6) if zero[i, j])


def main() -> None:
    """Search, then print the table side by side with error bars."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--material", default="steel", choices=sorted(MATERIALS))
    parser.add_argument("--feet", nargs="+", default=list(DECLARED), choices=list(DECLARED))
    arguments = parser.parse_args()
    material = Material(*MATERIALS[arguments.material], arguments.material)
    for name in arguments.feet:
        beam = DECLARED[name]
        k22, k55 = bounds_of_any_section(beam, material)
        print(f"\n{name} foot, {material.name}: any prism with the declared EIx and EIz has "
              f"k22 >= {k22:.2f} and k55 >= {k55:.2f} of the declared")  # fmt: skip
        for words, weights in (("bending alone", BENDING), ("all six", np.ones(6))):
            shape = nearest(beam, material, weights)
            part = solve(shape, material, study=True, size=0.9 * shape.default_size())
            mm = ", ".join(
                f"{k} {1e3 * getattr(shape, k):.2f}" for k in ("upright", "depth", "plate", "base")
            )
            print(f"\n{name} foot searched for {words}, {len(part.mesh.nodes)} nodes: {mm} mm")
            print(table(beam, part))
            print(part.budget.table(part.link.compliance))
            print(
                f"observed order of the mesh error: {part.refinement.words if part.refinement else 'one mesh'}"
            )
            print(f"zero within the test (level {part.link.level:g}): {zeros(part)}", flush=True)


if __name__ == "__main__":
    main()
