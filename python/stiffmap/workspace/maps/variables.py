"""The variables of a map: dimensions, types, units, meaning."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from stiffmap.solve.labels import (
    COMPLIANCE_UNITS,
    TWIST_UNITS,
    flag_attrs,
    meaning,
    status_attrs,
)

BEYOND = "beyond_calibration"


@dataclass(frozen=True)
class Variable:
    """Name, dimensions after those of the grid, type and attributes of one variable."""

    name: str
    dims: tuple[str, ...]
    attrs: dict[str, Any]
    dtype: str = "f8"


def load_variables(case: tuple[str, ...], plane: str, compliance: bool) -> list[Variable]:
    """Variables that each load case has."""
    out = [
        Variable(
            "displacement", (*case, "component"), meaning(TWIST_UNITS, "displacement of the reference point")
        ),
        Variable("deflection", case, meaning("m", "norm of the translation")),
        Variable(f"deflection_{plane}", case, meaning("m", f"norm of the translation in the {plane} plane")),
        Variable("status", case, status_attrs("the pose under its load"), "u1"),
        Variable("flags", case, flag_attrs(), "u4"),
    ]
    if compliance:
        dims = (*case, "component", "wrench_component")
        out.append(Variable("compliance", dims, meaning(COMPLIANCE_UNITS, "loaded compliance")))
    return out


def beyond_variable(case: tuple[str, ...], covered: str) -> Variable:
    """Where nothing vouches for the numbers of a calibrated machine."""
    text = "1: joints or load are beyond the readings that the machine was calibrated by"
    return Variable(BEYOND, case, meaning("1", text, calibrated_by=covered), "u1")


def deviation_variables(case: tuple[str, ...], plane: str, turning: bool) -> list[Variable]:
    """Standard deviations of the load cases and of the worst direction."""
    what = "standard deviation of "
    loads = ("deflection", f"deflection_{plane}")
    out = [
        Variable("displacement_std", (*case, "component"), meaning(TWIST_UNITS, f"{what}displacement")),
        *(Variable(f"{n}_std", case, meaning("m", f"{what}{n}")) for n in loads),
        Variable(
            "variance_share",
            (*case, "parameter"),
            meaning("1", "share of a number in the variance of the deflection"),
        ),
    ]
    return out + [Variable(f"worst_{n}_std", (), meaning("m", f"{what}worst_{n}")) for n in loads if turning]


def extreme_variables(plane: str, tolerance: float) -> list[Variable]:
    """Variables over the force directions of a plane; the suffix says which components count."""
    out = [Variable("direction_status", (), status_attrs("the worst of all force directions solved"), "u1")]
    angle = f"direction of that force, from {plane[0]} towards {plane[1]}"
    for suffix, what in (("", "translation"), (f"_{plane}", f"translation in the {plane} plane")):
        for word, size in (("worst", "largest"), ("best", "smallest")):
            text = f"{size} norm of the {what} over the force directions of the {plane} plane"
            out.append(Variable(f"{word}_deflection{suffix}", (), meaning("m", text)))
            out.append(Variable(f"{word}_direction{suffix}", (), meaning("rad", angle, plane=plane)))
        text = f"force in the worst direction at which the norm of the {what} reaches the tolerance"
        out.append(Variable(f"force_limit{suffix}", (), meaning("N", text, tolerance_m=tolerance)))
    return out
