"""Prediction of every reading, solving each different (pose, wrench) once."""

from __future__ import annotations

import copy
from collections.abc import Callable, Hashable, Iterable, Sequence
from dataclasses import fields, replace
from functools import partial

import numpy as np

from stiffmap.common.arguments import checked
from stiffmap.common.broadcasting import Mask, instance_of
from stiffmap.common.errors import StiffmapError
from stiffmap.common.fingerprints import code, digest
from stiffmap.common.kept import MOST_BYTES, Kept
from stiffmap.experiment.experiment import Experiment, Floats
from stiffmap.experiment.poses.commanded import OUT_OF_REACH, located, resolved, without
from stiffmap.experiment.poses.configuration import at_rest, coordinates_of
from stiffmap.experiment.prediction.equilibria import motions
from stiffmap.experiment.prediction.history import Drives, Terms, at_records, history_motion, records_of
from stiffmap.experiment.prediction.joints import check_joints
from stiffmap.experiment.prediction.nearby import Near, Nearby
from stiffmap.experiment.setups import standing
from stiffmap.model import effects
from stiffmap.model.description import AppliedEffect, MachineDescription
from stiffmap.model.effects import apply_records
from stiffmap.solve.machine import Machine

MACHINES, OTHERS = 4, 32
"""Machines with terms, and predictors of other machines and of some rows, that are kept."""
FAR = 1e-3
"""m, rad: a machine that shows more of itself than that does not stand where it is commanded, and its frames are found where it stands."""
SAMPLE, SLOW = 100, 0.02
"""Poses that are asked whether the fast path closes them, and the share of others from which on it pays to keep where the joints stand."""


class Predictor:
    """Readings of one plan for any set of effects; remembers what it has solved.

    machine
        The declared machine; `terms` of a call come on top of the effects that it already has. Of these, too, the rows say what
        its file leaves open: the temperature, the branch.

    Raises StiffmapError for an unknown point, joint or effect, and for what is no machine or experiment.
    """

    machine: Machine
    experiment: Experiment

    def __init__(self, machine: Machine, experiment: Experiment, *, threads: int | None = None) -> None:
        instance_of(machine, Machine, "machine", "a Machine")
        instance_of(experiment, Experiment, "experiment", "an Experiment")
        check_points(machine, experiment)
        check_joints(machine, experiment)
        self.threads = threads
        self.solved = 0
        self._given = machine, located(machine, experiment)
        self._register()
        self._set_aside()
        if self.is_sighted and _far(shown := self()):
            self._register(shown)
        self._close_from_here()

    @property
    def is_sighted(self) -> bool:
        """Whether frames of instruments or places of targets were found by the readings."""
        return self._given[1].seen is not None and self.experiment.frame != "known"

    def registered(self, shown: Floats) -> Predictor:
        """The same with the frames and targets of best fit where a machine stands that shows `shown` (n, c) m, rad; itself where none were
        found, or it stands as commanded."""
        if not self.is_sighted or not _far(shown):
            return self
        out = copy.copy(self)
        out._register(shown)
        out._close_from_here()
        return out

    def _register(self, shown: Floats | None = None) -> None:
        """Begins with frames and targets where the machine is commanded, or stands."""
        stands = None if shown is None else standing(self.experiment, shown)
        self.machine, self.experiment = resolved(*self._given, stands)
        self._own = _left_open(self.machine, self.experiment)
        self._forget(MOST_BYTES)

    def _forget(self, room: int) -> None:
        """Has solved nothing; `room` for what it will remember, bytes."""
        self._memory: Kept[tuple[Terms, Terms], Floats] = Kept(room)
        self._changes: Kept[tuple[Terms, Terms], Floats] = Kept(room)
        self._machines: Kept[Hashable, Machine] = Kept(MACHINES)
        self._others: Kept[Hashable, Predictor] = Kept(OTHERS)
        self._drives: dict[tuple[Terms, Terms], Drives] = {}

    @checked
    def __call__(self, terms: Sequence[AppliedEffect] = ()) -> Floats:
        """(n, c) m, rad predicted readings; NaN where a pose fails."""
        mechanical, load = _parts(terms)
        key = (mechanical, load)
        motion = self._motion_of(mechanical, load)
        remembering = tuple(t for t in terms if effects.get(t.kind).drive)
        if remembering:
            plan = self._plan_under(load)
            if key not in self._drives:
                self._drives = {key: Drives.of(self.with_terms(mechanical), plan)}
            motion = motion + history_motion(self._drives[key], plan, remembering)
        return readings(self.experiment, motion, terms)

    def changes(
        self, moved: Sequence[Terms], base: Terms = (), unmoved: Sequence[Terms] | None = None
    ) -> list[Floats | None]:
        """(n, c) m, rad each: how much more the readings of some sets of terms show than those of `base`, to first order in
        what differs, many at a fraction of a prediction each; not to be written to. None where whole predictions are needed: other loads, laws
        that bend, records, branches, memory of the drives, and all that `Nearby.changes` leaves.

        unmoved
            For each of `moved`, terms of the same parts with nothing off: effects at their null.
        """
        if self._own:
            return [None] * len(moved)
        keys = [(base, m) for m in moved]
        out = [self._changes.get(k) for k in keys]
        left = [i for i, m in enumerate(moved) if out[i] is None and _only_numbers(base, m)]
        near = {i: n for i in left if (n := self._near(moved[i], unmoved[i] if unmoved else None))}
        if not near:
            return out
        shown = self._shown(list(near.values()), base, [moved[i] for i in near])
        for i, seen in zip(near, shown, strict=True):
            if seen is not None:
                seen.flags.writeable = False
                out[i] = self._changes.put(keys[i], seen, seen.nbytes)
        return out

    def _near(self, terms: Terms, unmoved: Terms | None) -> Near | None:
        """The machine with some terms; None where it cannot have them."""
        try:
            other = self._described(terms)
        except StiffmapError:
            return None
        return Near(other, None if unmoved is None else partial(self._described, unmoved))

    def _described(self, terms: Terms) -> MachineDescription:
        d, mechanical = self.machine.description, _parts(terms)[0]
        places = [(t.kind, t.element, t.legs) for t in mechanical]
        said_again = [t for t in self._own if (t.kind, t.element, t.legs) in places]
        if not said_again or d.declared is None:
            return apply_records(d, mechanical)
        return apply_records(d.declared, [*(t for t in d.effects if t not in said_again), *mechanical])

    def changes_of_machines(self, others: Sequence[Near], terms: Terms = ()) -> list[Floats | None]:
        """The same of other machines near this one, of which nothing is kept; `terms` of the measurement belong to all."""
        return self._shown(others, terms, [terms] * len(others))

    def _shown(self, others: Sequence[Near], base: Terms, terms: Sequence[Terms]) -> list[Floats | None]:
        """What readings with their terms show of the motions of others, beyond those of `base`."""
        mechanical, load = _parts(base)
        motion = self._motion_of(mechanical, load)
        before = readings(self.experiment, motion, base)
        told = Nearby(self.with_terms(mechanical), self._plan_under(load), self.threads)
        out = [
            readings(self.experiment, motion + change, t) - before
            if change is not None and np.isfinite(change[np.isfinite(motion)]).all()
            else None
            for change, t in zip(told.changes(others), terms, strict=True)
        ]
        self.solved += told.solved
        return out

    def beside(self, *, machine: Machine | None = None, rows: Mask | None = None) -> Predictor:
        """The same of another machine, or of some rows (n,); what was solved before counts for neither."""
        out = copy.copy(self)
        out.machine = machine or self.machine
        out.experiment = self.experiment if rows is None else self.experiment.rows(rows)
        out._own = self._own if machine is None else _left_open(machine, self.experiment)
        out._forget(MOST_BYTES // OTHERS)  # all that are kept together need no more than one predictor may
        return out

    def kept(self, key: Hashable, make: Callable[[], Predictor]) -> Predictor:
        """That of another machine or of some rows that was made for the key, or is made now; the last few are kept."""
        return self._others.made(key, make)

    def under(self, wrench: Floats) -> Floats:
        """(n, c) m, rad: the same readings under other wrenches (n, 6); NaN where the machine fails under them."""
        plan = replace(self.experiment, wrench=wrench)
        return readings(plan, at_records(plan, self._own, self._branches), ())

    def _set_aside(self) -> None:
        """Leaves out the rows that the declared machine has no equilibrium for, and names them."""
        e = self.experiment
        failed = np.asarray((e.read & ~np.isfinite(self())).any(axis=1))
        if failed.any():
            self._memory.clear()
            machine, given = self._given
            why, cause = "the machine has no equilibrium at", self._cause(failed)
            self.experiment = without(e, failed, why, cause)
            self._given = machine, without(given, failed, why, cause)

    def _cause(self, failed: Mask) -> str:
        """Of rows without an equilibrium: the load, where the machine gets there without it."""
        there = np.isfinite(self.under(np.zeros_like(self.experiment.wrench)))[failed]
        if (there | ~self.experiment.read[failed]).all():
            return "it gives way under the load there; smaller loads, or slender rods in several pieces (docs/machine_files.md)"
        return OUT_OF_REACH

    def _close_from_here(self) -> None:
        """Keeps where the joints stand, for variants of the machine; poses on the fast path are closed faster without."""
        e = self.experiment
        if e.joints is not None:
            return
        some = e.each_pose.rows(np.arange(len(e.each_pose))[:: 1 + len(e.each_pose) // SAMPLE])
        if at_rest(self.machine, some).reference_share > SLOW:
            near = coordinates_of(self.machine, e)
            if np.isfinite(near).all():
                names = self.machine.compiled.names.coordinates
                self.experiment = replace(e, near=near, near_names=tuple(names))

    def with_terms(self, terms: Sequence[AppliedEffect]) -> Machine:
        """The machine with the mechanical terms added."""
        mechanical = _parts(terms)[0]
        if not mechanical:
            return self.machine
        return self._machines.made(
            mechanical, lambda: Machine(self._described(mechanical), like=self.machine)
        )

    def _motion_of(self, mechanical: Terms, load: Terms) -> Floats:
        """(n, c) of the machine, remembered."""
        motion = self._memory.get((mechanical, load))
        if motion is None:
            motion = at_records(self._plan_under(load), (*self._own, *mechanical), self._branches)
            self._memory.put((mechanical, load), motion, motion.nbytes)
        return motion

    def _plan_under(self, load: Terms) -> Experiment:
        """The plan itself where nothing changes its wrenches: what it has counted is kept."""
        w = true_wrench(self.experiment, load)
        return self.experiment if w is self.experiment.wrench else replace(self.experiment, wrench=w)

    def _branches(self, plan: Experiment, terms: Terms) -> Floats:
        if not any(_has_branch(t) for t in terms):
            return self._solve(plan, terms)
        out = np.full((len(plan), len(plan.channels)), np.nan)
        branch = np.array([b or "loading" for b in plan.branch or ("",) * len(plan)])
        for name in np.unique(branch):
            here = np.flatnonzero(branch == name)
            out[here] = self._solve(plan.rows(here), tuple(_on_branch(t, str(name)) for t in terms))
        return out

    def _solve(self, plan: Experiment, terms: Terms) -> Floats:
        out, solved = motions(self.with_terms(terms), plan, self.threads)
        self.solved += solved
        return out


def _far(shown: Floats) -> bool:
    """Whether a machine that shows this stands where it is not commanded."""
    return bool(np.nanmax(np.abs(shown), initial=0.0) > FAR)


def true_wrench(experiment: Experiment, terms: Iterable[AppliedEffect]) -> Floats:
    """(n, 6) the wrench that acts, from the one that was noted."""
    w = experiment.wrench
    for term in terms:
        load = effects.get(term.kind).load
        w = w if load is None else load(w, experiment, term)
    return w


def readings(experiment: Experiment, motion: Floats, terms: Sequence[AppliedEffect]) -> Floats:
    """(n, c) what the instruments show for the true `motion` (n, c). A motor stands, unless an effect says that part
    of its drive yields before the encoder."""
    seen = np.array([0.0 if c.side == "motor" else 1.0 for c in experiment.channels])
    out: Floats = motion * seen
    for term in terms:
        reading = effects.get(term.kind).reading
        out = out if reading is None else reading(out, motion, experiment, term)
    return out


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


def _parts(terms: Sequence[AppliedEffect]) -> tuple[Terms, Terms]:
    """The terms of the machine, and those of its loads."""
    kinds = [(t, effects.get(t.kind)) for t in terms]
    return tuple(t for t, kind in kinds if kind.apply), tuple(t for t, kind in kinds if kind.load)


def _only_numbers(base: Terms, moved: Terms) -> bool:
    """Whether the machine is another, under the same loads, and nothing depends on rows before or on their records."""
    every = (*base, *moved)
    rows = any(_has_branch(t) or effects.get(t.kind).drive for t in every) or records_of(every)
    (machine, load), (other, same) = _parts(base), _parts(moved)
    return machine != other and load == same and not rows


def _left_open(machine: Machine, e: Experiment) -> Terms:
    """Effects of the machine itself of which the rows say what its file leaves open."""

    def is_open(term: AppliedEffect) -> bool:
        said = dict((*term.parameters, *term.options))
        asked = [(p.name, p.recorded) for p in effects.get(term.kind).parameters if p.recorded]
        asked += [("branch", "branch")] if _has_branch(term) else []
        return any(name not in said and getattr(e, column) is not None for name, column in asked)

    return tuple(filter(is_open, machine.description.effects))


def _has_branch(term: AppliedEffect) -> bool:
    return any(o.name == "branch" and o.recorded for o in effects.get(term.kind).options)


def _on_branch(term: AppliedEffect, branch: str) -> AppliedEffect:
    if not _has_branch(term):
        return term
    return replace(term, options=tuple({**dict(term.options), "branch": branch}.items()))


UNSEEN = {
    "name", "machine", "title", "record", "source", "ids", "repeat", "out_of_reach", "reading", "sigma", "zero_sigma", "certificate",
    "asked", "seen", "seen_rotation", "absolute", "rotation_against", "command", "command_of", "other_command", "near", "near_names",
}  # fmt: skip
"""Fields of a located experiment that no prediction depends on, or only by what others have of them."""


def fingerprint(predictor: Predictor) -> str:
    """Digest of the machine and of all of the plan that a prediction depends on."""
    e = predictor.experiment
    plan = [getattr(e, f.name) for f in fields(e) if f.name not in UNSEEN]
    return digest(predictor.machine.description, plan, code())
