"""Chosen designs refined, as machine files, measured in full and compared with the machine that the search began with; what tolerances
`u` of the machine file do to their measures: first order, and random machines."""

from __future__ import annotations

from copy import deepcopy
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from stiffmap.common.broadcasting import Floats, random_numbers
from stiffmap.common.outputs import write_text
from stiffmap.common.yaml_text import Document
from stiffmap.model.files.templates import expanded
from stiffmap.solve.machine import Machine, load_machine
from stiffmap.workspace.design.editing import described, edited
from stiffmap.workspace.design.judging import Judged, refine, values_of, violation
from stiffmap.workspace.design.problem import DesignProblem, near
from stiffmap.workspace.design.search import ParetoSet
from stiffmap.workspace.performance.registry import get_measure
from stiffmap.workspace.performance.table import MeasuresTable, measures

SHARE = 0.1  # of a tolerance: how far each number is moved for its slope
DRAWS = 100


@dataclass(frozen=True, eq=False)
class Robustness:
    """Standard deviations of a design's measures (worst values over the box), SI."""

    places: tuple[str, ...]  # numbers with a tolerance, every leg's for itself
    first_order: dict[str, float]  # by measure, from slopes: every number independent of the others
    drawn: dict[str, float]  # by measure, among random machines
    meets: float  # share of the random machines that meet all constraints
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
    names = design.measures

    def at(numbers: Floats) -> dict[str, float]:
        given = dict(zip(places, map(float, numbers), strict=True))
        made = described(edited(document.data, given), document, design.machine_file)
        return values_of(design, Machine(made))

    pairs = [(at(values + step), at(values - step)) for step in SHARE * np.diag(u)]
    slopes = {n: np.array([(up[n] - down[n]) / (2 * SHARE) for up, down in pairs]) for n in names}
    rng = random_numbers(0)
    drawn = [at(values + u * rng.standard_normal(len(u))) for _ in range(draws)]
    met = sum(all(violation(b, one[n]) <= 0 for n, b in design.constraints) for one in drawn)
    spread = np.std(np.array([[one[n] for n in names] for one in drawn]), axis=0, ddof=1)
    first_order = {n: float(np.linalg.norm(slopes[n])) for n in names}
    deviations = dict(zip(names, map(float, spread), strict=True))
    return Robustness(places, first_order, deviations, met / draws, draws)


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


SLIGHT = 0.01  # weight of the other objectives while one is refined
NOTHING = 1e-9  # of a measure: a standard deviation that is round-off


@dataclass(frozen=True, eq=False)
class ChosenDesign:
    """A design of the Pareto set, refined by gradients, and what its tolerances do to it."""

    found: Judged  # as the search left it
    x: Floats  # (variables,) refined
    judged: Judged
    robust: Robustness | None
    table: MeasuresTable

    def as_plain(self) -> dict[str, object]:
        """Data of JSON, SI."""
        out: dict[str, object] = {
            "found": self.found.values,
            "refined": self.judged.values,
            "x": self.x.tolist(),
        }
        if self.robust is not None:
            out["deviation"] = {"first_order": self.robust.first_order, "drawn": self.robust.drawn}
            out["meets"] = self.robust.meets
        return out


@dataclass(frozen=True, eq=False)
class ComparedDesigns:
    """The chosen designs next to other machines, all measured in full."""

    others: dict[str, MeasuresTable]  # `start` and the machines that the design file names
    chosen: dict[str, ChosenDesign]

    @property
    def tables(self) -> dict[str, MeasuresTable]:
        """All of them by name."""
        return {**self.others, **{name: c.table for name, c in self.chosen.items()}}

    def as_plain(self) -> dict[str, object]:
        """Data of JSON, SI."""
        return {
            "chosen": {name: t.as_plain() for name, t in self.tables.items()},
            "refined": {name: c.as_plain() for name, c in self.chosen.items()},
        }

    def lines(self) -> list[str]:
        """What refinement gained, and how random machines differ from first order."""

        def shown(name: str, value: float, digits: int) -> str:
            return f"{get_measure(name).factor * value:.{digits}g}"

        out = []
        for name, c in self.chosen.items():
            before, after = c.found.values, c.judged.values
            gains = [
                f"{n} {shown(n, v, 4)} → {shown(n, after[n], 4)}"
                for n, v in before.items()
                if abs(after[n] - v) > 1e-4 * abs(v)
            ]
            out.append(f"{name}, refined by gradients: {', '.join(gains) or 'nothing better nearby'}")
            if (r := c.robust) is not None:
                pairs = [
                    f"{n} {shown(n, r.first_order[n], 2)} ({shown(n, s, 2)} drawn)"
                    for n, s in r.drawn.items()
                    if s > NOTHING * abs(after[n])
                ]
                out.append(f"{name}, standard deviations by {len(r.places)} tolerances: {', '.join(pairs)}")
        return out


def measured(found: ParetoSet, place: Path, nodes: int = 21, draws: int = DRAWS) -> ComparedDesigns:
    """The machine that the search began with and each chosen design, whose machine file is written to `place`."""
    design = found.design
    names = [n for n, _ in design.constraints]
    names += [*design.model.objectives, "force", "acceleration", "frequency"]
    names += [] if design.toolpath is None else ["path_compliance", "path_effort"]
    task = replace(design.requirements, bounds=design.constraints)

    def full(machine: str | Path) -> MeasuresTable:
        return measures(
            load_machine(machine), requirements=task, only=list(dict.fromkeys(names)), nodes=nodes
        )

    others = {"start": full(design.machine_file)}
    for other in design.model.beside:
        others[Path(other).stem] = full(near(other, design.file))
    chosen: dict[str, ChosenDesign] = {}
    for name, i in found.chosen().items():
        x, judged = refine(design, found.x[i], _weights(design, name), keep=name == "compromise")
        file = place / f"{name}.yaml"
        write_machine(design, x, name, file)
        chosen[name] = ChosenDesign(
            found.judged[i], x, judged, robustness(design, x, draws=draws), full(file)
        )
    return ComparedDesigns(others, chosen)


def _weights(design: DesignProblem, name: str) -> Floats:
    objectives = design.model.objectives
    if name == "compromise":
        return np.ones(len(objectives))
    return np.array([1.0 if name == f"best-{n}" else SLIGHT for n in objectives])


def write_machine(design: DesignProblem, x: Floats, name: str, file: Path) -> None:
    """The machine file of a vector of variables."""
    data = dict(design.data(x))
    data["name"] = f"{design.model.name}-{name}"
    values = ", ".join(f"{k} = {v:.5g}" for k, v in design.names(x).items())
    text = yaml.safe_dump(data, sort_keys=False, allow_unicode=True, width=110)
    head = f"# Written by stiffmap optimize ({design.model.name}): {values}"
    write_text(file, f"{head}\n{text}")
