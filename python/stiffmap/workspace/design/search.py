"""Search for the Pareto set: NSGA-II or NSGA-III of pymoo over processes (docs/design.md);
evaluations are kept on disk, so that a search that was killed goes on where it was."""

from __future__ import annotations

import json
from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from stiffmap.common.broadcasting import Floats, thread_count, whole_number
from stiffmap.common.errors import FileError, StiffmapError, needed
from stiffmap.common.fingerprints import code, digest, file_digest, named_files
from stiffmap.common.json_text import parse_json
from stiffmap.common.outputs import add_lines, make_folder, only_job
from stiffmap.common.tasks import workers
from stiffmap.model.files.shipped import find
from stiffmap.workspace.design.judging import IMPOSSIBLE, Judged, judge
from stiffmap.workspace.design.problem import DesignProblem, load_design, near
from stiffmap.workspace.performance.registry import get_measure

if TYPE_CHECKING:
    from pymoo.core.algorithm import Algorithm


class Evaluations:
    """Judged designs by their exact variables; one line of JSON each, written per generation.

    A search is deterministic, so that replaying it from the start with these answers at hand leads to
    the same state without a single evaluation.
    """

    def __init__(self, design: DesignProblem, path: Path | None) -> None:
        self.path, self.known = path, dict[bytes, Judged]()
        self.mark = fingerprint(design)
        self._sizes = (len(design.model.objectives),), (len(design.constraints),)
        if path is not None and path.exists():
            self._read(path)

    def _read(self, path: Path) -> None:
        lines = path.read_text(encoding="utf-8", errors="replace").splitlines()
        if not lines:
            return
        self._same_design(lines[0], path)
        for line in lines[1:]:
            try:
                row = parse_json(line)
                f, g, x = (np.array(row[k], dtype=float) for k in "fgx")
                if (f.shape, g.shape) != self._sizes:
                    raise ValueError
                self.known[x.tobytes()] = Judged(f, g, dict(row["values"]), str(row["reason"]))
            except (ValueError, KeyError, TypeError, OverflowError):
                continue  # the line at which the process was killed, or a damaged one: judged again

    def _same_design(self, line: str, path: Path) -> None:
        try:
            mark = parse_json(line)["design"]
        except (ValueError, KeyError, TypeError) as error:
            raise FileError(
                "is damaged: expected the mark of the design whose evaluations these are; delete the file, or give "
                "another folder",
                file=str(path),
                line=1,
            ) from error
        if mark != self.mark:
            raise FileError("holds evaluations of another design; give another folder", file=str(path))

    def missing(self, x: Floats) -> list[int]:
        """Rows that nobody judged yet."""
        return [i for i, row in enumerate(x) if row.tobytes() not in self.known]

    def add(self, x: Floats, judged: list[Judged]) -> None:
        """Keep, and write at once."""
        lines: list[dict[str, object]] = []
        for row, one in zip(x, judged, strict=True):
            self.known[row.tobytes()] = one
            f, g = one.objectives.tolist(), one.violations.tolist()
            lines.append({"x": row.tolist(), "f": f, "g": g, "values": one.values, "reason": one.reason})
        if self.path is None or not lines:
            return
        if not (self.path.exists() and self.path.stat().st_size):
            lines.insert(0, {"design": self.mark})
        add_lines(self.path, [json.dumps(line) for line in lines])

    def get(self, x: Floats) -> Judged:
        """The judgement of one row."""
        return self.known[x.tobytes()]


def fingerprint(design: DesignProblem) -> str:
    """Of everything that the answers depend on: the files as read, those that they name, code."""
    model, data = design.model.model_dump(), design.document.data
    files = (
        named_files(model, Path(design.file).parent),
        named_files(data, Path(design.machine_file).parent),
    )
    beside = [file_digest(find(name)) for name in design.model.beside if near(name, design.file) == name]
    return digest(
        model, data, design.requirements, design.constraints, *files, beside, design.toolpath, code()
    )[:16]


@dataclass(frozen=True, eq=False)
class ParetoSet:
    """Designs that no other one betters in everything."""

    design: DesignProblem
    x: Floats
    """(n, variables)."""
    judged: tuple[Judged, ...]
    history: tuple[tuple[int, int, float], ...]
    """Generation, designs evaluated so far, hypervolume (of objectives scaled to the first generation's)."""
    evaluated: int

    @property
    def dataset(self) -> xr.Dataset:
        """Dimensions (design, variable), (design, measure), (design, constraint); SI, worst values."""
        names = list(self.judged[0].values)
        design, model = self.design, self.design.model
        values = np.array([[j.values[n] for n in names] for j in self.judged])
        violations = np.array([j.violations for j in self.judged])
        data = {
            "x": (("design", "variable"), self.x),
            "value": (("design", "measure"), values),
            "violation": (("design", "constraint"), violations),
        }
        constraints = [n for n, _ in design.constraints]
        coords = {"variable": list(design.variables), "measure": names, "constraint": constraints}
        attrs = {"design": model.name, "seed": model.search.seed, "evaluated": self.evaluated}
        return xr.Dataset(data, coords, attrs)

    def chosen(self) -> dict[str, int]:
        """The best of each objective, and the one nearest to all of them at once."""
        f = np.array([j.objectives for j in self.judged])
        out = {f"best-{n}": int(np.argmin(f[:, i])) for i, n in enumerate(self.design.model.objectives)}
        span = np.ptp(f, axis=0)
        away = (f - f.min(axis=0)) / np.where(span > 0, span, 1)
        out["compromise"] = int(np.argmin(np.linalg.norm(away, axis=1)))
        return out


Progress = Callable[[int, int, float, int], None]


def optimize(
    design: DesignProblem | str | PathLike[str],
    *,
    folder: str | PathLike[str] | None = None,
    generations: int | None = None,
    processes: int | None = None,
    progress: Progress | None = None,
    scheduler: object = None,
) -> ParetoSet:
    """Pareto set of a design problem; the same for the same seed, on any number of processes or machines.

    folder
        Where evaluations are kept: a search that was killed goes on from there.
    generations
        None: as the file says.
    processes
        None: all cores.
    progress
        Called after each generation with its number, evaluations, hypervolume, feasible designs.
    scheduler
        Address of a dask scheduler, or a `distributed.Client`: its workers judge the designs of a generation. What a
        lost worker had is judged again.

    Raises StiffmapError where no design meets all constraints: which one is missed, by how much at least.
    """
    problem = design if isinstance(design, DesignProblem) else load_design(design)
    place = None if folder is None else Path(folder)
    with nullcontext() if place is None else only_job(make_folder(place)):
        kept = Evaluations(problem, None if place is None else place / "evaluations.jsonl")
        count = problem.model.search.generations
        if generations is not None:
            count = whole_number(generations, "generations", 1)
        algorithm = _algorithm(problem, count)
        history: list[tuple[int, int, float]] = []
        seen: list[Floats] = []
        measure: Callable[[Floats], float] | None = None
        with workers(judge, problem, scheduler=scheduler, processes=thread_count(processes)) as judges:
            while algorithm.has_next():
                asked = algorithm.ask()
                x = np.ascontiguousarray(asked.get("X"), dtype=float)
                todo = kept.missing(x)
                kept.add(x[todo], judges.in_order(list(x[todo])))
                judged = [kept.get(row) for row in x]
                asked.set("F", np.array([j.objectives for j in judged]))
                if problem.constraints:
                    asked.set("G", np.array([j.violations for j in judged]))
                algorithm.tell(infills=asked)
                seen.extend(x)
                measure = measure or _hypervolume([kept.get(r) for r in seen])
                good = [kept.get(r) for r in seen if feasible(kept.get(r))]
                volume = measure(np.array([j.objectives for j in good])) if good and measure else 0.0
                history.append((len(history) + 1, len(seen), volume))
                if progress is not None:
                    progress(len(history), len(seen), volume, len(good))
        return _front(problem, np.unique(np.array(seen), axis=0), kept, history, len(seen))


def feasible(judged: Judged) -> bool:
    """Whether every constraint holds."""
    return bool((judged.violations <= 0).all() and (judged.objectives < IMPOSSIBLE).all())


def _front(
    problem: DesignProblem, x: Floats, kept: Evaluations, history: list[tuple[int, int, float]], count: int
) -> ParetoSet:
    good = [row for row in x if feasible(kept.get(row))]
    if not good:
        raise StiffmapError(_shortfall(problem, [kept.get(row) for row in x]))
    f = np.array([kept.get(row).objectives for row in good])
    no_worse, somewhere = (f[None] <= f[:, None]).all(axis=2), (f[None] < f[:, None]).any(axis=2)
    better = np.asarray(no_worse & somewhere)
    keep = ~better.any(axis=1)
    order = np.argsort(f[keep, 0], kind="stable")
    rows = np.array(good)[keep][order]
    return ParetoSet(problem, rows, tuple(kept.get(r) for r in rows), tuple(history), count)


def _shortfall(problem: DesignProblem, judged: list[Judged]) -> str:
    """Which constraint the least bad design misses, and by how much."""
    built = [j for j in judged if not j.reason]
    if not built:
        return f"{problem.file}: no design can be built, for example: {judged[0].reason}"
    nearest = min(built, key=lambda j: float(np.maximum(j.violations, 0).sum()))
    parts = []
    for (name, bound), v in zip(problem.constraints, nearest.violations, strict=True):
        if v > 0:
            m = get_measure(name)
            parts.append(
                f"{name} is {m.factor * nearest.values[name]:.4g} {m.shown} where {bound.text(m.factor)} is required ({100 * v:.1f} % off)"
            )
    return f"{problem.file}: none of {len(judged)} designs meets all constraints; the nearest one misses: {'; '.join(parts)}"


def _hypervolume(judged: list[Judged]) -> Callable[[Floats], float] | None:
    """Measure with the first generation's feasible designs as scale, or None while there are none."""
    from pymoo.indicators.hv import HV

    f = np.array([j.objectives for j in judged if feasible(j)])
    if len(f) < 2:
        return None
    low, high = f.min(axis=0), f.max(axis=0)
    span = np.where(high > low, high - low, 1.0)
    indicator = HV(ref_point=np.full(f.shape[1], 1.1))
    return lambda values: float(indicator((values - low) / span))


def _algorithm(problem: DesignProblem, generations: int) -> Algorithm:
    with needed("design", "design"):
        from pymoo.algorithms.moo.nsga2 import NSGA2
        from pymoo.algorithms.moo.nsga3 import NSGA3
        from pymoo.core.problem import Problem
        from pymoo.util.ref_dirs import get_reference_directions
    search, low_high = problem.model.search, problem.bounds
    goals = len(problem.model.objectives)
    counts = {"n_var": len(problem.variables), "n_obj": goals, "n_ieq_constr": len(problem.constraints)}
    task = Problem(**counts, xl=low_high[0], xu=low_high[1])
    if search.method == "nsga2":
        algorithm = NSGA2(pop_size=search.population)
    else:
        algorithm = NSGA3(
            ref_dirs=get_reference_directions("energy", goals, search.population, seed=search.seed),
            pop_size=search.population,
        )
    algorithm.setup(task, termination=("n_gen", generations), seed=search.seed, verbose=False)
    return algorithm
