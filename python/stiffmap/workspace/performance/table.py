"""All measures of a machine in one table, next to what a task requires (docs/measures.md)."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import nullcontext
from dataclasses import dataclass
from os import PathLike
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from stiffmap.common.broadcasting import Floats, names_of, real_array, thread_count, whole_number
from stiffmap.common.errors import StiffmapError
from stiffmap.common.number_text import place_text
from stiffmap.common.short import short_repr
from stiffmap.common.tasks import client_of
from stiffmap.solve.machine import Machine, takes_machine
from stiffmap.solve.status import Status
from stiffmap.workspace.maps.inputs import box_nodes, magnitude, plane_axes, read_box
from stiffmap.workspace.performance.motion.closing import drive_kinematics
from stiffmap.workspace.performance.motion.motion_files import Motion, load_motion
from stiffmap.workspace.performance.registry import Case, Found, Measure, all_measures, get_measure
from stiffmap.workspace.performance.requirements import Bound, Requirements, load_requirements


@dataclass(frozen=True, eq=False)
class MeasureRow:
    """One measure: SI values, the poses that decide, the requirement and the verdict."""

    measure: Measure
    found: Found
    bound: Bound | None
    reason: str = ""
    """Why there is no value."""

    @property
    def margin(self) -> float:
        """How far inside its requirement the worst value is, SI; NaN without a requirement or a value."""
        if self.bound is None or not np.isfinite(self.found.worst):
            return float("nan")
        return self.bound.margin(self.found.worst)

    @property
    def verdict(self) -> str:
        """``pass``, ``fail`` (also where a pose failed), ``unknown`` (no value to be had), or empty."""
        if self.bound is None:
            return ""
        if self.reason:
            return "unknown"
        return "pass" if self.margin >= 0 else "fail"

    def as_plain(self) -> dict[str, object]:
        """The row as plain data, SI."""
        m, f, bound = self.measure, self.found, self.bound or Bound()
        worst_at, best_at = (None if at is None else list(at) for at in (f.worst_at, f.best_at))
        return {
            "name": m.name, "title": m.title, "unit": m.unit, "worst": f.worst, "worst_at": worst_at, "best": f.best,
            "best_at": best_at, "at_least": bound.at_least, "at_most": bound.at_most, "margin": self.margin,
            "verdict": self.verdict, "note": self.reason or f.note,
        }  # fmt: skip


@short_repr
@dataclass(frozen=True, eq=False)
class MeasuresTable:
    """All measures of a machine over a box."""

    machine: Machine
    case: Case
    requirements: Requirements
    rows: tuple[MeasureRow, ...]
    notes: tuple[str, ...]

    def __getitem__(self, name: str) -> MeasureRow:
        return {row.measure.name: row for row in self.rows}[name]

    @property
    def passed(self) -> bool:
        """Whether every requirement holds."""
        return all(row.verdict in ("", "pass") for row in self.rows)

    def as_plain(self) -> dict[str, object]:
        """The table as plain data, SI; numbers that are not finite stay so."""
        return {
            "machine": self.machine.name,
            "box": [self.case.low.tolist(), self.case.high.tolist()],
            "force": self.case.force,
            "plane": self.case.plane,
            "requirements": self.requirements.name,
            "passed": self.passed,
            "notes": list(self.notes),
            "measures": [row.as_plain() for row in self.rows],
        }


@takes_machine
def measures(
    machine: Machine,
    *,
    box: ArrayLike | None = None,
    force: float | None = None,
    plane: str | None = None,
    requirements: Requirements | str | PathLike[str] | None = None,
    only: Sequence[str] | None = None,
    nodes: int = 51,
    coarse: int = 7,
    length: float | None = None,
    gravity: ArrayLike | None = None,
    rotation: ArrayLike | None = None,
    box_tolerance: float = 1e-4,
    toolpath: Motion | str | PathLike[str] | None = None,
    clearance: float | None = None,
    deflection: float | None = None,
    threads: int | None = None,
    scheduler: object = None,
) -> MeasuresTable:
    """Table of all measures of §3: worst and best pose, requirement, margin, pass or fail.

    Parameters
    ----------
    box
        (2, 3) m, poses that are judged. None: the requirement's box about the centre of the machine's
        workspace if all of it is within reach, else the workspace itself (the notes say which).
    force
        N on the tool for deflections; None: the requirement's, else 100 N.
    plane
        Plane of velocities, forces and deflections; None: the requirement's, else ``xy``.
    requirements
        A file (`load_requirements`), a shipped name, or `Requirements`; None: none.
    only
        Names of measures; None: all.
    nodes, coarse
        Nodes along each edge of the box for kinematic measures, and for those that cost more.
    length
        Characteristic length, m, where units mix; None: the machine's own.
    box_tolerance
        m between the bounds of the largest box.
    toolpath
        A motion file (`load_motion`) for measures along the task's own path; None: the requirement's.
    clearance, deflection
        m, what poses of the workspace and of the largest box keep: least distance between members of different
        legs, largest deflection under `force` in `plane`; None: the requirement's, else not asked for.
    scheduler
        Address of a dask scheduler, or a `distributed.Client`: its workers close the poses of the kinematic measures
        and prove the cells of the largest box, with the same answer.

    Raises
    ------
    StiffmapError
        For bad input.

    Notes
    -----
    A measure that the machine lacks the data for says so in its row.
    """
    task = Requirements() if requirements is None else requirements
    task = task if isinstance(task, Requirements) else load_requirements(task)
    chosen = all_measures() if only is None else tuple(get_measure(n) for n in names_of(only, "only", 1))
    turned = None if rotation is None else real_array(rotation, "rotation")
    low, high, notes = _box(machine, box, task, turned)
    size = force if force is not None else task.force if task.force is not None else 100.0
    path = toolpath or task.toolpath
    plane = task.plane if plane is None else plane
    plane_axes(plane)  # refused here: a row would only lack its number
    for name, number in {"nodes": nodes, "coarse": coarse}.items():
        whole_number(number, name, 2)
    case = Case(
        machine, low, high, magnitude(size, "force", "N"), plane,
        transmission=task.transmission, proportions=task.proportions, nodes=nodes, coarse=coarse, gap=box_tolerance,
        length=length, gravity=None if gravity is None else real_array(gravity, "gravity"),
        rotation=turned, threads=threads,
        toolpath=path if path is None or isinstance(path, Motion) else load_motion(path),
        clearance=_positive("clearance", task.clearance if clearance is None else clearance),
        deflection=_positive("deflection", task.deflection if deflection is None else deflection),
    )  # fmt: skip
    with nullcontext() if scheduler is None else client_of(scheduler) as case.scheduler:
        found = _rows(chosen, case, task)
    case.scheduler = None
    return MeasuresTable(machine, case, task, found, notes)


def _rows(chosen: Sequence[Measure], case: Case, task: Requirements) -> tuple[MeasureRow, ...]:
    """In the order given; measures of their own run in parallel to those that share kinematics."""
    machine = case.machine
    apart = [m for m in chosen if m.apart] if thread_count(case.threads) > 1 else []
    _ = machine.fast, machine.compiled.core.not_enclosed  # made once, before two threads ask for it
    with ThreadPoolExecutor(1) as pool:
        later = {m.name: pool.submit(_row, m, case, task.bound(m.name)) for m in apart}
        rows = {m.name: _row(m, case, task.bound(m.name)) for m in chosen if m.name not in later}
        rows |= {name: found.result() for name, found in later.items()}
    return tuple(rows[m.name] for m in chosen)


def _positive(name: str, value: float | None) -> float | None:
    return None if value is None else magnitude(value, name, "m")


def _row(measure: Measure, case: Case, bound: Bound | None) -> MeasureRow:
    try:
        return MeasureRow(measure, measure.compute(case), bound)
    except StiffmapError as error:
        return MeasureRow(measure, Found(float("nan")), bound, str(error))


def _box(
    machine: Machine, box: ArrayLike | None, task: Requirements, rotation: Floats | None
) -> tuple[Floats, Floats, tuple[str, ...]]:
    low, high = read_box(machine, box)
    if box is not None or task.box is None:
        notes, some = _outside(machine, low, high, rotation, "the box")
        if not some:
            raise StiffmapError(f"{notes[0]}: the workspace of {machine.name} is elsewhere")
        return low, high, notes
    half = np.array(task.box) / 2
    wanted = ((low + high) / 2 - half, (low + high) / 2 + half)
    notes, _ = _outside(machine, *wanted, rotation, "the required box about the centre of the workspace")
    if not notes:
        return (*wanted, ())
    return low, high, (*notes, "measures are over the machine's own workspace instead")


def _outside(
    machine: Machine, low: Floats, high: Floats, rotation: Floats | None, what: str
) -> tuple[tuple[str, ...], bool]:
    """What is said of nodes of a box that are out of reach, and whether some are within it."""
    p = box_nodes(low, high, 5)
    bad = drive_kinematics(machine, p, rotation, patient=False).status != Status.CONVERGED
    if not bad.any():
        return (), True
    first = place_text(p[int(np.argmax(bad))], ".1f")
    lost = f"{what} is not within reach: {int(bad.sum())} of {len(p)} nodes, for example {first}"
    return (lost,), not bad.all()


class BoxMap(NamedTuple):
    """Nodes along each axis, m, and values (x, y, z) in the measure's shown unit."""

    x: Floats
    y: Floats
    z: Floats
    values: Floats


def box_map(row: MeasureRow) -> BoxMap | None:
    """Of a row of a table of measures; None where its poses are no grid."""
    if row.found.positions is None or row.found.values is None:
        return None
    x, y, z = (np.unique(row.found.positions[:, i]) for i in range(3))
    if len(x) * len(y) * len(z) != len(row.found.values):
        return None
    values = row.found.values.reshape(len(x), len(y), len(z))
    return BoxMap(x, y, z, np.asarray(row.measure.factor * values))


def levels(*values: Floats) -> Floats:
    """Thirteen that increase, from the least to the largest finite value."""
    every = np.concatenate([v.ravel() for v in values])
    finite = every[np.isfinite(every)]
    low, high = (float(finite.min()), float(finite.max())) if finite.size else (0.0, 1.0)
    return np.linspace(low, high if high - low > 1e-9 * abs(high) else low + max(abs(low), 1.0), 13)
