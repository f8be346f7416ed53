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
from stiffmap.workspace.design.problem import DesignProblem, near
from stiffmap.workspace.design.robustness import DRAWS, Robustness, robustness
from stiffmap.workspace.design.search import ParetoSet
from stiffmap.workspace.performance.registry import get_measure
from stiffmap.workspace.performance.table import MeasuresTable, measures

SLIGHT = 0.01
"""Weight of the other objectives while one is refined."""
NOTHING = 1e-9
"""Of a measure: a standard deviation that is round-off."""


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

    others: dict[str, MeasuresTable]
    """``start`` and the machines that the design file names."""
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
