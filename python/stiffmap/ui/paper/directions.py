"""§5.3, force direction analysis (Figure 5)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from stiffmap.solve.machine import Machine
from stiffmap.ui.paper.results import POINTS, Results
from stiffmap.ui.paper.statement import Statement, by_point, judge, of_section_5_3, rounds_to


def direction_statements(results: Results) -> Iterator[Statement]:
    """How the deflection depends on the direction of the force."""
    at = {name: WorkPoint(results, name) for name in results.points}
    others = {name: p for name, p in at.items() if name != "isotropic"}
    ratios = {name: p.ratio for name, p in at.items()}
    yield of_section_5_3(
        "Only for the isotropic work point (x=y=z=0) it is constant for each direction",
        f"max/min = {', '.join(f'{r:.5g}' for r in ratios.values())} at the four points",
        judge(ratios["isotropic"] < 1.001 and min(p.ratio for p in others.values()) > 1.1),
        "the 0.03 % left at the isotropic point are the load's own effect on the configuration",
        by_point("ratio", ratios),
        printed="constant there",
    )
    apart = {n: abs((p.worst_angle - p.best_angle + 90) % 180 - 90) for n, p in others.items()}
    yield of_section_5_3(
        "The lowest and the highest compliant directions of the manipulator differ on π/2",
        f"{', '.join(f'{a:.2f}' for a in apart.values())} deg",
        judge(all(abs(a - 90) < 1 for a in apart.values())),
        "exactly 90 deg for the symmetric compliance at zero load; the force of 300 N turns the strongest "
        "direction a little. At the isotropic point there is no such direction",
        by_point("degrees_apart", apart),
        printed="90 deg",
    )
    yield from _on_the_diagonal(at["near corner"], at["far corner"])
    p = at["asymmetric"]
    yield of_section_5_3(
        "in the workpoint (x=-200, y=300, z=0), forces along x and y directions cause different deformations",
        f"Fx {p.fx:.4f} mm, Fy {p.fy:.4f} mm",
        judge(abs(p.fy / p.fx - 1) > 0.05),
        "",
        {"Fx_mm": p.fx, "Fy_mm": p.fy},
        printed="different",
    )
    x, y = (100 * (v - p.best) / (p.worst - p.best) for v in (p.fx, p.fy))
    yield of_section_5_3(
        "Along the x direction, the deformations are close to the minimum, while along the y direction, they "
        "are close to the maximum",
        f"Fx at {x:.0f} %, Fy at {y:.0f} % of the way from minimum to maximum",
        judge(x < 20 and y > 80),
        f"the order agrees, but the ellipse's axes lie at {p.best_angle % 180:.0f} and "
        f"{p.worst_angle % 180:.0f} deg, not near x and y; close is taken as within a fifth",
        {"Fx_percent": x, "Fy_percent": y},
        printed="Fx close to the minimum, Fy to the maximum",
    )
    ratio = results.maps.worst_deflection_xy / results.maps.best_deflection_xy
    where = ratio.where(ratio == ratio.max(), drop=True)
    place = ", ".join(f"{n} = {1e3 * where[n].values[0]:.0f}" for n in ("x", "y", "z"))
    yield of_section_5_3(
        "The rate between the maximal and minimal deformations is about 7",
        f"{p.ratio:.2f}",
        judge(rounds_to(p.ratio, "7")),
        f"the machine is nearly isotropic there, for any foot and actuators ({p.spread}). Ratios of 7 occur "
        f"elsewhere: the largest in the three planes is {float(ratio.max()):.1f} at {place} mm; the number "
        "occurs, though not at the stated point",
        {"ratio": p.ratio, "largest_ratio_in_planes": float(ratio.max())},
        printed="about 7",
    )


class WorkPoint:
    """Deflections in the plane (mm) and directions (deg) at one work point."""

    def __init__(self, results: Results, name: str) -> None:
        p = results.points[name]
        ends = ("worst", "best")
        self.worst, self.best = (1e3 * float(p[f"{w}_deflection_xy"]) for w in ends)
        self.worst_angle, self.best_angle = (float(np.rad2deg(p[f"{w}_direction_xy"])) for w in ends)
        self.fx, self.fy = (1e3 * float(p.deflection_xy.sel(case=c)) for c in ("Fx", "Fy"))
        self.ratio = self.worst / self.best
        """Weakest over strongest direction."""
        self.spread = "{:.2f}–{:.2f}".format(*ratio_range(results.revised, POINTS[name]))
        """Range of the ratio over the variants."""


def _on_the_diagonal(near: WorkPoint, far: WorkPoint) -> Iterator[Statement]:
    """x = y = z = -200 mm and 300 mm, where the planar compliance is aI + b·ones."""
    more = 100 * (near.worst / near.fx - 1)
    yield of_section_5_3(
        "For the work point x=y=z=-200, the manipulator is 7 times stronger in the direction 135/-45 deg "
        "than in the direction 45/-135 deg",
        f"{near.ratio:.2f} times; worst {_axis(near.worst_angle)}, best {_axis(near.best_angle)}",
        judge(rounds_to(near.ratio, "7")),
        "the directions agree. With foot and actuators, which the paper leaves open, scaled from rigid to "
        f"ten times softer the ratio stays within {near.spread}. And on x=y=z the planar compliance is aI + "
        "b·ones, so that 7 would force max/Fx = 1.40, against the 20 % of the next sentence",
        {"ratio": near.ratio, "worst_deg": near.worst_angle % 180, "best_deg": near.best_angle % 180},
        printed="7 times; worst 45/-135 deg, best 135/-45 deg",
    )
    yield of_section_5_3(
        "The maximum compliance is 20% higher than for the single force (Fx, Fy)",
        f"{more:.1f} % higher",
        judge(rounds_to(more, "20")),
        f"our ratio of {near.ratio:.2f} forces {100 * (over_fx(near.ratio) - 1):.0f} %, and the paper's own 7 "
        f"forces {100 * (over_fx(7.0) - 1):.0f} %; 20 % belongs to a ratio of {ratio_of(1.2):.2f}",
        {"percent": more, "Fx_mm": near.fx, "worst_mm": near.worst},
        printed="20 % higher",
    )
    less = 100 * (1 - far.fx / far.worst)
    yield of_section_5_3(
        "For x=y=z=300, a force along the principal axes causes deformations 20% less than for the worst "
        "direction",
        f"{less:.1f} % less",
        judge(rounds_to(less, "20")),
        "agreement to the printed digit",
        {"percent": less, "Fx_mm": far.fx, "worst_mm": far.worst},
        printed="20 % less",
    )
    more, theirs = 100 * (far.fx / far.best - 1), ratio_of(1 / 0.8)
    yield of_section_5_3(
        "… and 50% more than for the strongest direction",
        f"{more:.1f} % more",
        judge(rounds_to(more, "50")),
        f"20 % less than the worst forces max/min = {theirs:.2f} and {100 * (0.8 * theirs - 1):.0f} % more "
        f"than the best: the paper agrees with itself. Ours is {far.ratio:.2f}, and stays within {far.spread} "
        "with foot and actuators scaled from rigid to ten times softer",
        {"percent": more, "ratio": far.ratio, "best_mm": far.best},
        printed="50 % more",
    )


def over_fx(ratio: float) -> float:
    """Worst deflection over that of Fx where the planar compliance is aI + b·ones."""
    return float(np.sqrt(2)) * ratio / float(np.hypot(ratio, 1))


def ratio_of(worst_over_fx: float) -> float:
    """The ratio max/min that belongs to it: the inverse of `over_fx`."""
    return worst_over_fx / float(np.sqrt(2 - worst_over_fx**2))


def _axis(angle: float) -> str:
    return f"{angle % 180:.1f}/{angle % 180 - 180:.1f} deg"


RIGID = 1e-3  # times the declared compliance: to all digits shown, rigid
SCALES = ((RIGID, 1), (1, RIGID), (RIGID, RIGID), (1, 1), (10, 1), (1, 10), (RIGID, 10))
"""Factors on the compliances of foot and actuator."""


def ratio_range(machine: Machine, position: Sequence[float]) -> tuple[float, float]:
    """Least and largest max/min deflection in the xy plane (zero load) over the variants."""
    ratios = []
    for foot, actuator in SCALES:
        varied = machine.with_effect("compliance", element="foot", scale=foot)
        varied = varied.with_effect("compliance", element="actuator", scale=actuator)
        size = np.linalg.svd(varied.solve(position).compliance[:2, :2], compute_uv=False)
        ratios.append(float(size[0] / size[1]))
    return min(ratios), max(ratios)
