"""A design problem: ``DESIGN.yaml`` read, checked, and turned into machines (docs/design.md)."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from stiffmap.common.arithmetic import evaluate
from stiffmap.common.broadcasting import Floats, given_path
from stiffmap.common.errors import FileError, StiffmapError
from stiffmap.common.yaml_text import Document, read
from stiffmap.model.description import MachineDescription
from stiffmap.model.files.report import validated
from stiffmap.model.files.schema.base import EachOnce, FileModel, Name
from stiffmap.model.files.shipped import find
from stiffmap.solve.machine import Machine
from stiffmap.solve.redesign import on_branch_of, settled
from stiffmap.workspace.design.editing import described, edited, indices, unshared
from stiffmap.workspace.performance.motion.motion_files import (
    Motion,
    given_or_shipped,
    load_motion,
    near_or_shipped,
)
from stiffmap.workspace.performance.registry import all_measures
from stiffmap.workspace.performance.requirements import (
    Bound,
    BoundModel,
    Requirements,
    bound_in,
    load_requirements,
)

START_NODES = 3  # of a machine that is asked for a few hundred poses once


class VariableModel(FileModel):
    """A design variable: bounds, or one of a catalogue's rows."""

    low: float | int | None = None
    high: float | int | None = None
    note: str = ""


class SearchModel(FileModel):
    """How to search."""

    method: Literal["nsga2", "nsga3"] = "nsga2"
    population: int = Field(default=40, ge=4)
    generations: int = Field(default=30, ge=1)
    seed: int = 1
    nodes: int = Field(default=7, ge=2)


class DesignFile(FileModel):
    """The keys of a design file."""

    name: Name
    title: str = ""
    machine: str
    requirements: str | None = None
    toolpath: str | None = None
    beside: Annotated[list[str], EachOnce] = Field(default_factory=list)
    variables: dict[str, VariableModel] = Field(default_factory=dict)
    catalogues: dict[str, list[dict[str, float | int | str]]] = Field(default_factory=dict)
    constants: dict[str, float | int] = Field(default_factory=dict)
    derived: dict[str, str | float | int] = Field(default_factory=dict)
    numbers: dict[str, str | float | int] = Field(min_length=1)
    objectives: Annotated[list[str], EachOnce] = Field(min_length=1)
    constraints: dict[str, BoundModel] = Field(default_factory=dict)
    search: SearchModel = SearchModel()


@dataclass(frozen=True, eq=False)
class DesignProblem:
    """A design problem, checked. Variables first, then one row number per catalogue."""

    file: str
    model: DesignFile
    document: Document
    """Of the machine file whose numbers change."""
    machine_file: str
    requirements: Requirements
    constraints: tuple[tuple[str, Bound], ...]

    @property
    def variables(self) -> tuple[str, ...]:
        """Names of variables, then of catalogues."""
        return (*self.model.variables, *self.model.catalogues)

    @property
    def bounds(self) -> tuple[Floats, Floats]:
        """Lowest and highest value of each; of a catalogue, from 0 to its number of rows."""
        rows = [(v.low, v.high) for v in self.model.variables.values()]
        rows += [(0, len(c) - 1e-9) for c in self.model.catalogues.values()]
        low, high = np.array(rows, dtype=float).T
        return low, high

    @property
    def measures(self) -> list[str]:
        """Names of the objectives, then of the other measures with a bound."""
        return list(dict.fromkeys([*self.model.objectives, *(n for n, _ in self.constraints)]))

    def names(self, x: Floats) -> dict[str, float]:
        """Every name that expressions may use, for a vector of variables."""
        out = {k: float(v) for k, v in self.model.constants.items()}
        count = len(self.model.variables)
        out.update(zip(self.model.variables, map(float, x[:count]), strict=True))
        for name, row in zip(self.model.catalogues, x[count:], strict=True):
            chosen = self.model.catalogues[name][int(row)]
            out.update({f"{name}_{k}": float(v) for k, v in chosen.items() if not isinstance(v, str)})
        for name, text in self.model.derived.items():
            out[name] = evaluate(text, out)
        return out

    def data(self, x: Floats) -> Any:
        """The machine file's data with the design's numbers."""
        names = self.names(x)
        values = {place: evaluate(text, names) for place, text in self.model.numbers.items()}
        return edited(self.document.data, values)

    @cached_property
    def toolpath(self) -> Motion | None:
        """The task's own path, for measures along it."""
        return None if self.requirements.toolpath is None else load_motion(self.requirements.toolpath)

    def machine(self, x: Floats) -> Machine:
        """The machine of a vector of variables; StiffmapError where it cannot be."""
        made = described(self.data(x), self.document, self.machine_file)
        return Machine(self._on_branch(made), start_nodes=START_NODES)

    def _on_branch(self, description: MachineDescription) -> MachineDescription:
        """On the assembly branch of the machine file, where a home is searched for."""
        return on_branch_of(self._base, description) if description.search_home else description

    @cached_property
    def _base(self) -> MachineDescription:
        """As the machine file has it, its home found once for all designs."""
        base = described(unshared(self.document.data), self.document, self.machine_file)
        return settled(base.declared or base)


def near(name: str, file: str) -> str | Path:
    """What a file calls by a name: the file next to it, where there is one."""
    here = Path(file).parent / name
    return here if here.is_file() else name


def load_design(path: str | PathLike[str]) -> DesignProblem:
    """A design problem from a file, or a shipped one by name (``redesign``).

    Raises FileError naming file, line, key, what was expected and what was found.
    """
    given = given_path(path, "design", "a file or a shipped name")
    given = given_or_shipped(given, Path(__file__).parent)
    if not given.is_file():
        raise FileError("no such design file", file=str(given))
    document, file = read(given), str(given)
    expected = "a design file is a mapping with name, machine, variables, numbers, objectives"
    model = validated(DesignFile, document, file, expected)

    def fail(message: str, *keys: str) -> FileError:
        return FileError(message, file=file, line=document.line(keys), key=".".join(keys))

    words = set(re.findall(r"\w+", " ".join(map(str, [*model.derived.values(), *model.numbers.values()]))))
    for name, v in model.variables.items():
        if name not in words:
            raise fail("no expression uses this variable", "variables", name)
        if v.low is None or v.high is None:
            raise fail("give low and high", "variables", name)
        if not v.low < v.high:
            raise fail(f"low ({v.low}) must be below high ({v.high})", "variables", name)
    if not model.variables and not model.catalogues:
        raise fail("give variables or catalogues", "variables")
    for name, rows in model.catalogues.items():
        if not rows:
            raise fail("the catalogue is empty", "catalogues", name)
    known = {m.name for m in all_measures()}
    for i, name in enumerate(model.objectives):
        if name not in known:
            what = f"unknown objective '{name}' (number {i + 1}); known: {', '.join(sorted(known))}"
            raise fail(what, "objectives")
    machine = find(near(model.machine, file))
    task = Requirements()
    if model.requirements is not None:
        task = load_requirements(near(model.requirements, file))
    for name in model.beside:
        find(near(name, file))
    if model.toolpath is not None:
        task = replace(task, toolpath=near_or_shipped(model.toolpath, given.parent))
    if task.toolpath is not None:
        load_motion(task.toolpath)  # a mistake in it is reported before the search
    own = (
        (name, bound_in(document, file, bound, "constraints", name))
        for name, bound in model.constraints.items()
    )
    design = DesignProblem(file, model, read(machine), str(machine), task, (*task.bounds, *own))
    low, high = design.bounds
    try:  # every expression and place once, in the middle of the bounds
        names = design.names((low + high) / 2)
    except StiffmapError as error:
        raise fail(str(error), "derived") from None
    for place, text in model.numbers.items():
        try:
            edited(design.document.data, {place: evaluate(text, names)})
        except StiffmapError as error:
            raise fail(str(error), "numbers", place) from None
    at = [indices(design.document.data, place) for place in model.numbers]
    if twice := [place for i, place in enumerate(model.numbers) if at[i] in at[:i]]:
        raise fail("another place above is the same number", "numbers", twice[0])
    return design
