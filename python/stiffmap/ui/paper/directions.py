"""§5.3, force direction analysis (Figure 5)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from stiffmap.model.description import Element, Joint, Spring
from stiffmap.solve.machine import Machine
from stiffmap.ui.paper.results import POINTS, Results
from stiffmap.ui.paper.statement import Statement, judge, of_section_5_3, rounds_to

ROOT2 = float(np.sqrt(2))


def direction_statements(results: Results) -> list[Statement]:
    """How the deflection depends on the direction of the force."""
    at = {name: Point(results, name) for name in results.points}
    near, far, odd = at["near corner"], at["far corner"], at["asymmetric"]
    return [
        _isotropic(at),
        _quarter(at),
        _seven(near),
        _twenty_more(near),
        _twenty_less(far),
        _fifty_more(far),
        _different(odd),
        _close(odd),
        _seven_again(odd, results),
    ]


class Point:
    """Deflections in the plane (mm) and directions (deg) at one work point."""

    def __init__(self, results: Results, name: str) -> None:
        p = results.points[name]
        self.range = ratio_range(results.revised, POINTS[name])
        ends = ("worst", "best")
        self.worst, self.best = (1e3 * float(p[f"{w}_deflection_xy"]) for w in ends)
        self.worst_angle, self.best_angle = (float(np.rad2deg(p[f"{w}_direction_xy"])) for w in ends)
        self.fx, self.fy = (1e3 * float(p.deflection_xy.sel(case=c)) for c in ("Fx", "Fy"))

    @property
    def spread(self) -> str:
        """Range of the ratio over the variants."""
        return f"{self.range[0]:.2f}–{self.range[1]:.2f}"

    @property
    def ratio(self) -> float:
        """Weakest over strongest direction."""
        return self.worst / self.best


def _isotropic(at: dict[str, Point]) -> Statement:
    ratios = {name: p.ratio for name, p in at.items()}
    others = min(r for name, r in ratios.items() if name != "isotropic")
    text = ", ".join(f"{r:.5g}" for r in ratios.values())
    return of_section_5_3(
        "Only for the isotropic work point (x=y=z=0) it is constant for each direction",
        f"max/min = {text} at the four points",
        judge(ratios["isotropic"] < 1.001 and others > 1.1),
        "the 0.03 % left at the isotropic point are the load's own effect on the configuration",
        {f"ratio_{n.replace(' ', '_')}": r for n, r in ratios.items()},
        printed="constant there",
    )


def _quarter(at: dict[str, Point]) -> Statement:
    apart = {
        n: abs((p.worst_angle - p.best_angle + 90) % 180 - 90) for n, p in at.items() if n != "isotropic"
    }
    text = ", ".join(f"{a:.2f}" for a in apart.values())
    return of_section_5_3(
        "The lowest and the highest compliant directions of the manipulator differ on π/2",
        f"{text} deg",
        judge(all(abs(a - 90) < 1 for a in apart.values())),
        "exactly 90 deg for the symmetric compliance at zero load; the force of 300 N turns the strongest "
        "direction a little. At the isotropic point there is no such direction",
        {f"degrees_apart_{n.replace(' ', '_')}": a for n, a in apart.items()},
        printed="90 deg",
    )


def _seven(p: Point) -> Statement:
    return of_section_5_3(
        "For the work point x=y=z=-200, the manipulator is 7 times stronger in the direction 135/-45 deg "
        "than in the direction 45/-135 deg",
        f"{p.ratio:.2f} times; worst {_axis(p.worst_angle)}, best {_axis(p.best_angle)}",
        judge(rounds_to(p.ratio, "7")),
        "the directions agree. With foot and actuators, which the paper leaves open, scaled from rigid to "
        f"ten times softer the ratio stays within {p.spread}. And on x=y=z the planar compliance is aI + "
        "b·ones, so that 7 would force max/Fx = 1.40, against the 20 % of the next sentence",
        {"ratio": p.ratio, "worst_deg": p.worst_angle % 180, "best_deg": p.best_angle % 180},
        printed="7 times; worst 45/-135 deg, best 135/-45 deg",
    )


def _twenty_more(p: Point) -> Statement:
    more = 100 * (p.worst / p.fx - 1)
    return of_section_5_3(
        "The maximum compliance is 20% higher than for the single force (Fx, Fy)",
        f"{more:.1f} % higher",
        judge(rounds_to(more, "20")),
        f"our ratio of {p.ratio:.2f} forces {100 * (over_fx(p.ratio) - 1):.0f} %, and the paper's own 7 "
        f"forces {100 * (over_fx(7.0) - 1):.0f} %; 20 % belongs to a ratio of {ratio_of(1.2):.2f}",
        {"percent": more, "Fx_mm": p.fx, "worst_mm": p.worst},
        printed="20 % higher",
    )


def over_fx(ratio: float) -> float:
    """Worst deflection over that of Fx where the planar compliance is aI + b·ones."""
    return ROOT2 * ratio / float(np.hypot(ratio, 1))


def ratio_of(worst_over_fx: float) -> float:
    """The ratio max/min that belongs to it: the inverse of `over_fx`."""
    return worst_over_fx / float(np.sqrt(2 - worst_over_fx**2))


def _twenty_less(p: Point) -> Statement:
    less = 100 * (1 - p.fx / p.worst)
    return of_section_5_3(
        "For x=y=z=300, a force along the principal axes causes deformations 20% less than for the worst "
        "direction",
        f"{less:.1f} % less",
        judge(rounds_to(less, "20")),
        "agreement to the printed digit",
        {"percent": less, "Fx_mm": p.fx, "worst_mm": p.worst},
        printed="20 % less",
    )


def _fifty_more(p: Point) -> Statement:
    more, theirs = 100 * (p.fx / p.best - 1), ratio_of(1 / 0.8)
    return of_section_5_3(
        "… and 50% more than for the strongest direction",
        f"{more:.1f} % more",
        judge(rounds_to(more, "50")),
        f"20 % less than the worst forces max/min = {theirs:.2f} and {100 * (0.8 * theirs - 1):.0f} % more "
        f"than the best: the paper agrees with itself. Ours is {p.ratio:.2f}, and stays within {p.spread} "
        "with foot and actuators scaled from rigid to ten times softer",
        {"percent": more, "ratio": p.ratio, "best_mm": p.best},
        printed="50 % more",
    )


def _different(p: Point) -> Statement:
    return of_section_5_3(
        "in the workpoint (x=-200, y=300, z=0), forces along x and y directions cause different deformations",
        f"Fx {p.fx:.4f} mm, Fy {p.fy:.4f} mm",
        judge(abs(p.fy / p.fx - 1) > 0.05),
        "",
        {"Fx_mm": p.fx, "Fy_mm": p.fy},
        printed="different",
    )


def _close(p: Point) -> Statement:
    x, y = (100 * (v - p.best) / (p.worst - p.best) for v in (p.fx, p.fy))
    return of_section_5_3(
        "Along the x direction, the deformations are close to the minimum, while along the y direction, they "
        "are close to the maximum",
        f"Fx at {x:.0f} %, Fy at {y:.0f} % of the way from minimum to maximum",
        judge(x < 20 and y > 80),
        f"the order agrees, but the ellipse's axes lie at {p.best_angle % 180:.0f} and "
        f"{p.worst_angle % 180:.0f} deg, not near x and y; close is taken as within a fifth",
        {"Fx_percent": x, "Fy_percent": y},
        printed="Fx close to the minimum, Fy to the maximum",
    )


def _seven_again(p: Point, results: Results) -> Statement:
    ratio = results.maps.worst_deflection_xy / results.maps.best_deflection_xy
    where = ratio.where(ratio == ratio.max(), drop=True)
    place = ", ".join(f"{n} = {1e3 * where[n].values[0]:.0f}" for n in ("x", "y", "z"))
    return of_section_5_3(
        "The rate between the maximal and minimal deformations is about 7",
        f"{p.ratio:.2f}",
        judge(rounds_to(p.ratio, "7")),
        f"the machine is nearly isotropic there, for any foot and actuators ({p.spread}). Ratios of 7 occur "
        f"elsewhere: the largest in the three planes is {float(ratio.max()):.1f} at {place} mm; the number "
        "occurs, though not at the stated point",
        {"ratio": p.ratio, "largest_ratio_in_planes": float(ratio.max())},
        printed="about 7",
    )


def _axis(angle: float) -> str:
    return f"{angle % 180:.1f}/{angle % 180 - 180:.1f} deg"


SCALES = ((0, 1), (1, 0), (0, 0), (1, 1), (10, 1), (1, 10), (0, 10))
"""Factors on the compliances of foot and actuator, 0 is rigid."""


def ratio_range(machine: Machine, position: Sequence[float]) -> tuple[float, float]:
    """Least and largest max/min deflection in the xy plane (zero load) over the variants."""
    ratios = []
    for foot, actuator in SCALES:
        c = varied(machine, foot, actuator).solve(position).compliance[:2, :2]
        size = np.linalg.svd(c, compute_uv=False)
        ratios.append(float(size[0] / size[1]))
    return min(ratios), max(ratios)


def varied(machine: Machine, foot: float, actuator: float) -> Machine:
    """The machine with foot and actuator compliances multiplied."""
    legs = tuple(
        replace(leg, elements=tuple(_varied(e, foot, actuator) for e in leg.elements))
        for leg in machine.description.legs
    )
    return Machine(replace(machine.description, legs=legs))


def _varied(e: Element, foot: float, actuator: float) -> Element:
    if isinstance(e, Spring) and e.name == "foot" and e.compliance is not None:
        return replace(e, compliance=tuple(tuple(foot * v for v in row) for row in e.compliance))
    if isinstance(e, Joint) and e.actuated and e.law is not None:
        law = replace(e.law, stiffness=e.law.stiffness / actuator) if actuator else None
        return replace(e, law=law)
    return e
