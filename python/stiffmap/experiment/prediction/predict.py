"""Prediction of every reading, solving each different (pose, wrench) once."""

from __future__ import annotations

import copy
from collections.abc import Hashable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from stiffmap import effects
from stiffmap.description import AppliedEffect
from stiffmap.effects import apply_records
from stiffmap.errors import StiffmapError
from stiffmap.experiment.experiment import Experiment, Floats, Mask
from stiffmap.experiment.poses.against_command import resolved
from stiffmap.experiment.poses.commanded import OUT_OF_REACH, located, without
from stiffmap.experiment.poses.configuration import coordinates_of
from stiffmap.experiment.prediction.equilibria import Work, motions
from stiffmap.experiment.prediction.history import Drives, drives_of, history_motion
from stiffmap.experiment.prediction.joints import check_joints
from stiffmap.experiment.prediction.kept import Kept
from stiffmap.experiment.prediction.measurement import readings, true_wrench
from stiffmap.experiment.prediction.recorded import at_records
from stiffmap.machine import Machine

Terms = tuple[AppliedEffect, ...]
FAILURE = 20.0
"""How much dearer an equilibrium is that is not found (measured: 10 to 30 times)."""
DEAR = 100.0
"""How much dearer one is that the kernels leave to the reference path (measured: 140 to 400 times)."""


@dataclass(eq=False)
class Effort:
    """What predictions have cost, in those of the declared machine."""

    total: float = 0.0
    own_share: float = 0.0
    """Of the reference path, where the machine is as declared."""

    def add(self, motion: Floats, slow_share: float, *, declared: bool) -> None:
        """One prediction more, of motions (n, c)."""
        if declared:
            self.own_share = slow_share
        failed = float(np.isnan(motion).all(axis=1).mean())
        self.total += 1.0 + FAILURE * failed + DEAR * max(slow_share - self.own_share, 0.0)


class Predictor:
    """Readings of one plan for any set of effects; remembers what it has solved.

    machine
        The declared machine; `terms` of a call come on top of the effects that it already has.
    """

    def __init__(self, machine: Machine, experiment: Experiment, *, threads: int | None = None) -> None:
        check_points(machine, experiment)
        check_joints(machine, experiment)
        self.threads = threads
        self.machine, self.experiment = resolved(machine, located(machine, experiment))
        self.solved = 0
        self._effort = Effort()
        self.patience = float("inf")
        """Effort that one fit may cost before it is given up."""
        self._work = Work()
        self._memory: Kept[tuple[Terms, Terms], Floats] = Kept()
        self.tangents: Kept[Hashable, Any] = Kept()
        """Slopes of predictions by effects, kept by those who fit them."""
        self._drives: dict[tuple[Terms, Terms], Drives] = {}
        self._set_aside()
        self._close_from_here()

    def __call__(self, terms: Sequence[AppliedEffect] = ()) -> Floats:
        """(n, c) m, rad predicted readings; NaN where a pose fails."""
        kinds = [(t, effects.get(t.kind)) for t in terms]
        mechanical = tuple(t for t, kind in kinds if kind.apply)
        load = tuple(t for t, kind in kinds if kind.load)
        key = (mechanical, load)
        motion = self._memory.get(key)
        if motion is None:
            self._work = Work()
            motion = self._motion(mechanical, load)
            self._memory.put(key, motion, motion.nbytes)
            self._effort.add(motion, self._work.slow_share, declared=not terms)
        remembering = tuple(t for t, kind in kinds if kind.drive)
        if remembering:
            plan = replace(self.experiment, wrench=true_wrench(self.experiment, load))
            if key not in self._drives:
                self._drives = {key: drives_of(self.with_terms(mechanical), plan)}
            motion = motion + history_motion(self._drives[key], plan, remembering)
        return readings(self.experiment, motion, terms)

    def beside(self, *, machine: Machine | None = None, rows: Mask | None = None) -> Predictor:
        """The same of another machine, or of some rows (n,); what was solved before counts for neither."""
        out = copy.copy(self)
        out.machine = machine or self.machine
        out.experiment = self.experiment if rows is None else self.experiment.rows(rows)
        out._memory, out._effort, out._drives = Kept(), Effort(), {}
        return out

    @property
    def effort(self) -> float:
        """Predictions that were not known yet when they were asked for; those that fail, or that the kernels leave to the
        reference path where they solve the declared machine, count more."""
        return self._effort.total

    def under(self, wrench: Floats) -> Floats:
        """(n, c) m, rad: the same readings under other wrenches (n, 6); NaN where the machine fails under them."""
        plan = replace(self.experiment, wrench=wrench)
        return readings(plan, at_records(plan, (), self._branches), ())

    def _set_aside(self) -> None:
        """Leaves out the rows that the declared machine has no equilibrium for, and names them."""
        e = self.experiment
        failed = np.asarray((e.read & ~np.isfinite(self())).any(axis=1))
        if failed.any():
            self._memory.clear()
            self.experiment = without(e, failed, "the machine has no equilibrium at", self._cause(failed))

    def _cause(self, failed: Mask) -> str:
        """Of rows without an equilibrium: the load, where the machine gets there without it."""
        there = np.isfinite(self.under(np.zeros_like(self.experiment.wrench)))[failed]
        if (there | ~self.experiment.read[failed]).all():
            return "it gives way under the load there; smaller loads, or slender rods in several pieces (docs/machine_files.md)"
        return OUT_OF_REACH

    def _close_from_here(self) -> None:
        """Keeps where the joints stand, for variants of the machine; one on the fast path closes faster by itself."""
        e, compiled = self.experiment, self.machine.compiled
        if e.joints is None and compiled.not_fast:
            near = coordinates_of(self.machine, e)
            if np.isfinite(near).all():
                self.experiment = replace(e, near=near, near_names=tuple(compiled.names.coordinates))

    def with_terms(self, terms: Sequence[AppliedEffect]) -> Machine:
        """The machine with the mechanical terms added."""
        mechanical = [t for t in terms if effects.get(t.kind).apply]
        if not mechanical:
            return self.machine
        return Machine(apply_records(self.machine.description, mechanical), like=self.machine)

    def _motion(self, mechanical: Terms, load: Terms) -> Floats:
        w = true_wrench(self.experiment, load)
        # the plan itself where nothing changes it: what it has counted is kept
        plan = self.experiment if w is self.experiment.wrench else replace(self.experiment, wrench=w)
        return at_records(plan, mechanical, self._branches)

    def _branches(self, plan: Experiment, terms: Terms) -> Floats:
        if not any(_has_branch(t) for t in terms):
            return self._solve(plan, terms)
        out = np.full((len(plan), len(plan.channels)), np.nan)
        branch = np.array(plan.branch or ("loading",) * len(plan))
        branch = np.where(branch == "", "loading", branch)
        for name in np.unique(branch):
            here = np.flatnonzero(branch == name)
            out[here] = self._solve(plan.rows(here), tuple(_on_branch(t, str(name)) for t in terms))
        return out

    def _solve(self, plan: Experiment, terms: Terms) -> Floats:
        out, work = motions(self.with_terms(terms), plan, self.threads)
        self.solved += work.solved
        self._work += work
        return out


def predict(machine: Machine, experiment: Experiment, terms: Sequence[AppliedEffect] = ()) -> Floats:
    """(n, c) m, rad: what the instrument would show of a machine with `terms` added.

    Raises StiffmapError for an unknown point or effect.
    """
    return Predictor(machine, experiment)(terms)


def check_points(machine: Machine, experiment: Experiment) -> None:
    """Raises StiffmapError where the experiment names a point that the machine does not have."""
    loop = experiment.loop
    bodies = [b for b in (loop.instrument_on, loop.force_against) if b not in ("floor", "base")]
    own = (*experiment.points, *experiment.load_points)
    for name in dict.fromkeys((experiment.point, experiment.load_point, *own, *bodies)):
        if name not in machine.points:
            raise StiffmapError(
                f"{experiment.name}: machine {machine.name} has no point '{name}'; "
                f"it has {', '.join(machine.points)} (a machine file names more with 'point')"
            )


def _has_branch(term: AppliedEffect) -> bool:
    return any(o.name == "branch" and o.recorded for o in effects.get(term.kind).options)


def _on_branch(term: AppliedEffect, branch: str) -> AppliedEffect:
    if not _has_branch(term):
        return term
    return replace(term, options=tuple({**dict(term.options), "branch": branch}.items()))
