"""Chosen designs refined, as machine files, measured in full and compared with the machine that the search began with."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import yaml

from stiffmap.common.broadcasting import Floats
from stiffmap.common.outputs import write_text
from stiffmap.solve.machine import load_machine
from stiffmap.workspace.design.judging import Judged, refine
from stiffmap.workspace.design.problem import DesignProblem
from stiffmap.workspace.design.robustness import DRAWS, Robustness, robustness
from stiffmap.workspace.design.search import ParetoSet
from stiffmap.workspace.performance.table import MeasuresTable, measures

SLIGHT = 0.01
"""Weight of the other objectives while one is refined."""


@dataclass(frozen=True, eq=False)
class ChosenDesign:
    """A design of the Pareto set, refined by gradients, and what its tolerances do to it."""

    found: Judged
    """As the search left it."""
    x: Floats
    """(variables,) refined."""
    judged: Judged
    robust: Robustness | None
    table: MeasuresTable


@dataclass(frozen=True, eq=False)
class Report:
    """Machines for comparison."""

    beside: dict[str, MeasuresTable]
    """``start`` and the machines that the design file names."""
    chosen: dict[str, ChosenDesign]

    @property
    def tables(self) -> dict[str, MeasuresTable]:
        """All of them by name."""
        return {**self.beside, **{name: c.table for name, c in self.chosen.items()}}


def measured(found: ParetoSet, place: Path, nodes: int = 21, draws: int = DRAWS) -> Report:
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

    beside = {"start": full(design.machine_file)}
    for other in design.model.beside:
        near = Path(design.file).parent / other
        beside[Path(other).stem] = full(near if near.is_file() else other)
    chosen: dict[str, ChosenDesign] = {}
    for name, i in found.chosen().items():
        x, judged = refine(design, found.x[i], _weights(design, name), keep=name == "compromise")
        file = place / f"{name}.yaml"
        write_machine(design, x, name, file)
        chosen[name] = ChosenDesign(
            found.judged[i], x, judged, robustness(design, x, draws=draws), full(file)
        )
    return Report(beside, chosen)


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
