"""What tolerances `u` of the machine file do to the measures of a chosen design: first order, and random machines."""

from __future__ import annotations

from copy import deepcopy
from dataclasses import dataclass
from typing import Any

import numpy as np

from stiffmap.common.broadcasting import Floats, random_numbers
from stiffmap.common.yaml_text import Document
from stiffmap.model.files.templates import expanded
from stiffmap.solve.machine import Machine
from stiffmap.workspace.design.editing import Editor
from stiffmap.workspace.design.judging import values_of, violation
from stiffmap.workspace.design.problem import DesignProblem

SHARE = 0.1
"""Of a tolerance: how far each number is moved for its slope."""
DRAWS = 100


@dataclass(frozen=True, eq=False)
class Robustness:
    """Standard deviations of a design's measures (worst values over the box), SI."""

    places: tuple[str, ...]
    """Numbers with a tolerance, every leg's for itself."""
    first_order: dict[str, float]
    """By measure, from slopes: every number independent of the others."""
    drawn: dict[str, float]
    """By measure, among random machines."""
    meets: float
    """Share of the random machines that meet all constraints."""
    draws: int


def robustness(design: DesignProblem, x: Floats, *, draws: int = DRAWS) -> Robustness | None:
    """Of a vector of variables; None where no number of the machine file has a tolerance.

    A tolerance is the standard deviation of a normal distribution. A number of a template is another one in every
    leg. Lengths of offsets are those of the machine as built; its controller keeps the nominal ones.
    """
    document = expanded(Document(_own_elements(design.data(x)), design.document.lines), design.machine_file)
    found = [f for f in _tolerances(document.data, "") if f[2] > 0]
    if not found:
        return None
    places = tuple(f[0] for f in found)
    values, u = (np.array(column) for column in list(zip(*found, strict=True))[1:])
    editor = Editor(document, design.machine_file, list(places))
    names = design.measures

    def at(numbers: Floats) -> dict[str, float]:
        given = dict(zip(places, map(float, numbers), strict=True))
        return values_of(design, Machine(editor.description(given)))

    pairs = [(at(values + step), at(values - step)) for step in SHARE * np.diag(u)]
    slopes = {n: np.array([(up[n] - down[n]) / (2 * SHARE) for up, down in pairs]) for n in names}
    rng = random_numbers(0)
    drawn = [at(values + u * rng.standard_normal(len(u))) for _ in range(draws)]
    met = sum(all(violation(b, one[n]) <= 0 for n, b in design.constraints) for one in drawn)
    spread = np.std(np.array([[one[n] for n in names] for one in drawn]), axis=0, ddof=1)
    first_order = {n: float(np.linalg.norm(slopes[n])) for n in names}
    return Robustness(
        places, first_order, dict(zip(names, map(float, spread), strict=True)), met / draws, draws
    )


def _own_elements(data: Any) -> Any:
    """Every leg of a template with elements of its own."""
    data = deepcopy(data)
    for leg in data["legs"].values():
        template = data.get("templates", {}).get(leg.get("template"))
        if isinstance(template, list):
            del leg["template"]
            leg["elements"] = deepcopy(template)
        _as_built(leg.get("elements", []))
    return data


def _as_built(elements: list[Any]) -> None:
    """Offsets with a tolerance get an `actual` transform that holds it: the controller keeps the nominal one."""
    for e in elements:
        for branch in e.get("branches", {}).values():
            _as_built(branch)
        if "offset" in e and "actual" not in e and _tolerances(e, "offset"):
            frame = {k: v for k, v in e.items() if k not in ("offset", "actual", "note")}
            e.update(_plain(frame))
            e["actual"] = frame


def _plain(data: object) -> Any:
    """Numbers without their tolerances."""
    if isinstance(data, dict):
        return data["value"] if "value" in data else {k: _plain(v) for k, v in data.items()}
    return [_plain(v) for v in data] if isinstance(data, list) else data


def _tolerances(data: object, place: str) -> list[tuple[str, float, float]]:
    """Place, value and tolerance of every number that has one, in the legs."""
    if isinstance(data, dict):
        if "value" in data and "u" in data:
            return [(place, float(data["value"]), float(data["u"] or 0.0))]
        keys = data.items() if place else [("legs", data["legs"])]
        return [t for k, v in keys for t in _tolerances(v, f"{place}.{k}".lstrip("."))]
    if isinstance(data, list):
        return [t for i, v in enumerate(data) for t in _tolerances(v, f"{place}[{i}]")]
    return []
