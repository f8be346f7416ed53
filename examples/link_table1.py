"""Table 1 of the paper: which forked tube comes nearest to its "original" and "revised" bar?

Least squares over finite-element solutions, started from a beam model. No isotropic closed section has the
table's EA, EI and GJ together, so the search runs with and without the torsion entry k44: the trade-off.

    python examples/link_table1.py
    python examples/link_table1.py --bars revised --design 12.77 32.44 5.35 41.28 5.87 10.77   (no search)
"""

from __future__ import annotations

import argparse
from typing import NamedTuple

import numpy as np
from link_bars import fork_bar
from scipy.optimize import least_squares

from stiffmap.model.link.inputs import MATERIALS, UNIT_WRENCHES
from stiffmap.model.link.pipeline import PartLink, link_from_part
from stiffmap.model.link.shapes import ForkBar
from stiffmap.model.link.solve import Material, Setup

# mm/N and rad/(N·mm), as printed; SI below.
TABLE = {
    "original": (0.310, [4.55e-5, 2.33e-1, 5.08e-2, 2.88e-5, 1.50e-6, 7.19e-6]),
    "revised": (0.775, [3.10e-5, 3.54e-1, 6.91e-2, 0.39e-5, 0.33e-6, 1.74e-6]),
}
TO_SI = np.array([1e-3] * 3 + [1e3] * 3)
NAMES = [f"k{i}{i}" for i in range(1, 7)]


class Design(NamedTuple):
    """A forked tube, SI."""

    width: float
    height: float
    wall: float
    arm: float
    prong: float
    gap: float

    def shape(self, length: float) -> ForkBar:
        """The part for finite elements; the pin hole is 0.4 of the height."""
        return ForkBar(length=length, width=self.width, height=self.height, wall=self.wall, fork=self.arm,
                       prong=self.prong, gap=self.gap, hole=0.4 * self.height)  # fmt: skip


def beam_start(length: float, target: np.ndarray, material: Material) -> Design:
    """Tube and fork whose beam model is nearest in all entries but k44; the search starts there."""
    shear = material.young / (2 * (1 + material.poisson))

    def misfit(x: np.ndarray) -> np.ndarray:
        C = fork_bar(length, *design_of(x, length), material.young, shear)
        return np.array([1, 1, 1, 0.05, 1, 1]) * np.log(np.diag(C) / target)

    x0 = [np.log(length / 40), np.log(length / 18), 0.2, np.log(0.06), 0.4, 1.0]
    return design_of(least_squares(misfit, x0, bounds=bounds_of(length)).x, length)


def bounds_of(length: float) -> tuple[list[float], list[float]]:
    """Of the search variables: log width, log height, wall/width, log arm/length, prong/width, gap/width."""
    low = [np.log(length / 120), np.log(length / 60), 0.08, np.log(0.03), 0.2, 0.3]
    return low, [np.log(length / 12), np.log(length / 6), 0.42, np.log(0.2), 0.9, 2.5]


def design_of(x: np.ndarray, length: float) -> Design:
    """Design from the search variables; the arm leaves room for the pin hole."""
    width, height = np.exp(x[0]), np.exp(x[1])
    arm = max(np.exp(x[3]) * length, 0.75 * height)
    return Design(*(float(v) for v in (width, height, x[2] * width, arm, x[4] * width, x[5] * width)))


def variables_of(design: Design, length: float) -> list[float]:
    """Inverse of :func:`design_of`."""
    w = design.width
    return [
        np.log(w),
        np.log(design.height),
        design.wall / w,
        np.log(design.arm / length),
        design.prong / w,
        design.gap / w,
    ]


def solve(
    design: Design, length: float, material: Material, study: bool, size: float | None = None
) -> PartLink:
    """Identified link of a design."""
    shape = design.shape(length)
    setup = Setup("fixed", "loaded", shape.reference())
    return link_from_part(  # a pin holds the mean motion of its holes
        shape.mesh,
        material,
        setup,
        UNIT_WRENCHES,
        size=size,
        solver="skfem",
        study=study,
        other_support="soft",
        refine=study,
    )


def nearest(name: str, material: Material, weight: float, evaluations: int) -> tuple[Design, PartLink]:
    """Least squares of log(k / table) over finite-element solutions, k44 with its weight."""
    length, printed = TABLE[name]
    target = np.array(printed) * TO_SI
    weights = np.array([1, 1, 1, weight, 1, 1])

    def misfit(x: np.ndarray) -> np.ndarray:
        k = np.diag(solve(design_of(x, length), length, material, study=False).link.compliance)
        return np.asarray(weights * np.log(k / target))

    low, high = bounds_of(length)
    start = np.clip(
        variables_of(beam_start(length, target, material), length), np.add(low, 1e-3), np.subtract(high, 1e-3)
    )
    # A mesh changes in steps with the shape: differences over 8 % look across its noise.
    step = 0.08 / np.maximum(np.abs(start), 0.3)
    found = least_squares(misfit, start, bounds=(low, high), diff_step=step, max_nfev=evaluations, xtol=1e-3)
    design = design_of(found.x, length)
    return design, solve(design, length, material, study=False)


def table(name: str, part: PartLink) -> str:
    """Side by side with the printed row, in its units."""
    printed = np.array(TABLE[name][1])
    ours, error = np.diag(part.link.compliance) / TO_SI, np.diag(part.budget.standard_error()) / TO_SI
    lines = [f"{'entry':<6}{'Table 1':>12}{'ours':>12}{'std. unc.':>11}{'ours/table':>12}"]
    for i in range(6):
        lines.append(
            f"{NAMES[i]:<6}{printed[i]:>12.2e}{ours[i]:>12.3e}{error[i]:>11.1e}{ours[i] / printed[i]:>12.3f}"
        )
    return "\n".join(lines)


def main() -> None:
    """Search, then print the table side by side with error bars."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--material", default="aluminium", choices=sorted(MATERIALS))
    parser.add_argument("--evaluations", type=int, default=5, help="steps of the search (each 7 solutions)")
    parser.add_argument("--weights", type=float, nargs="+", default=[0.0, 1.0], help="of k44 in the search")
    parser.add_argument("--bars", nargs="+", default=list(TABLE), choices=list(TABLE))
    parser.add_argument("--design", type=float, nargs=6, metavar="MM", help="evaluate it, without a search")
    arguments = parser.parse_args()
    material = Material(*MATERIALS[arguments.material], arguments.material)
    for name in arguments.bars:
        length = TABLE[name][0]
        for weight in arguments.weights[: 1 if arguments.design else None]:
            if arguments.design:
                design = Design(*(1e-3 * v for v in arguments.design))
            else:
                design, _ = nearest(name, material, weight, arguments.evaluations)
            print(f"\n{name}, weight {weight:g}: {design}", flush=True)
            # Finer than in the search, so that two coarser meshes exist for the mesh's share.
            part = solve(design, length, material, study=True, size=0.6 * design.shape(length).default_size())
            words = ", ".join(f"{k} {1e3 * v:.2f}" for k, v in design._asdict().items())
            count = len(part.mesh.nodes)
            print(f"\n{name} bar, {material.name}, weight of k44 {weight:g}, {count} nodes: {words} mm")
            print(table(name, part))
            print(part.budget.table(part.link.compliance))
            zero = part.link.insignificant
            names = [f"k{i + 1}{j + 1}" for i in range(6) for j in range(i, 6) if zero[i, j]]
            print(f"zero within the test (level {part.link.level:g}): {', '.join(names)}", flush=True)


if __name__ == "__main__":
    main()
