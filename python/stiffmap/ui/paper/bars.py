"""Table 1: the bar element."""

from __future__ import annotations

import numpy as np

from stiffmap.common.broadcasting import Floats
from stiffmap.model.description import Block, Spring
from stiffmap.solve.machine import Machine
from stiffmap.ui.paper.results import Results
from stiffmap.ui.paper.statement import Statement, judge, rounds_to

# Table 1 as printed: k11, k22, k33 in mm/N; k44, k55, k66 in rad/(N mm).
PRINTED = {
    "original": ("4.55e-5", "2.33e-1", "5.08e-2", "2.88e-5", "1.50e-6", "7.19e-6"),
    "revised": ("3.10e-5", "3.54e-1", "6.91e-2", "0.39e-5", "0.33e-6", "1.74e-6"),
}
TO_PRINTED = np.array([1e3] * 3 + [1e-3] * 3)
"""m/N to mm/N; rad/(N m) to rad/(N mm)."""
LENGTH = {"original": 310.0, "revised": 775.0}


def bar_statements(results: Results) -> list[Statement]:
    """The two rows of Table 1, and what they say about the bar."""
    bars = {"original": bar(results.original), "revised": bar(results.revised)}
    rows = [_row(name, compliance) for name, compliance in bars.items()]
    return [*rows, _stronger(bars), _length(bars["revised"])]


def bar(machine: Machine) -> Floats:
    """Compliance (6, 6) of a bar in the units of Table 1."""
    block = next(e for e in machine.description.legs[0].elements if isinstance(e, Block))
    spring = next(e for e in block.branches[0].elements if isinstance(e, Spring))
    if spring.compliance is None:
        return np.linalg.inv(np.array(spring.stiffness)) * np.sqrt(np.outer(TO_PRINTED, TO_PRINTED))
    return np.array(spring.compliance) * np.sqrt(np.outer(TO_PRINTED, TO_PRINTED))


def _row(name: str, compliance: Floats) -> Statement:
    ours = np.diag(compliance)
    same = all(np.isclose(o, float(p), rtol=1e-9) for o, p in zip(ours, PRINTED[name], strict=True))
    text = ", ".join(f"{v:.3g}" for v in ours)
    return Statement(
        "5.3",
        f"Table 1, {name} bar: k11 … k66 = {', '.join(PRINTED[name])}",
        text,
        judge(same),
        "The table is headed Stiffness but holds compliances (its units say so), and "
        "only "
        "their diagonal; our model adds k26 and k35 of beam theory",
        {f"k{i}{i}": float(v) for i, v in enumerate(ours, 1)},
        printed=", ".join(PRINTED[name]),
        own_input=True,
    )


def _stronger(bars: dict[str, Floats]) -> Statement:
    area = {n: LENGTH[n] / c[0, 0] for n, c in bars.items()}
    ratio = area["revised"] / area["original"]
    return Statement(
        "5.3",
        "the length and cross-section of the bar element was increased",
        f"EA = L/k11 grows {ratio:.2f} times",
        judge(ratio > 1),
        "with L = 310 and 775 mm; the revised length is not in the paper",
        {"EA_ratio": ratio},
        printed="increased",
        own_input=True,
    )


def _length(c: Floats) -> Statement:
    y, z = np.sqrt(3 * c[1, 1] / c[5, 5]), np.sqrt(3 * c[2, 2] / c[4, 4])
    return Statement(
        "5.3",
        "new stiffness matrix for the bar element (its length is not stated)",
        f"L = {y:.0f} and {z:.0f} mm",
        judge(rounds_to(y, "780") and rounds_to(z, "790")),
        "lengths of the beam whose k22/k66 and k33/k55 the table holds; our 775 mm (2.5 times 310) is "
        "within 2.5 % "
        "of both",
        {"L_from_k22_k66_mm": float(y), "L_from_k33_k55_mm": float(z)},
        printed="not stated",
        own_input=True,
    )
