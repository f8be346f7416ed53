"""`calibrate`: every uncertain number of a machine from readings, at once."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from os import PathLike

import numpy as np

from stiffmap.calibration.beyond import beyond_tolerance, none_beyond
from stiffmap.calibration.certificate import INSTRUMENT, certified
from stiffmap.calibration.defaults import Tolerances
from stiffmap.calibration.edit import edited
from stiffmap.calibration.facts import Beyond, HeldOut, Row, Wider
from stiffmap.calibration.floor import Blocks, model_form
from stiffmap.calibration.groups import STRONG, Choice, compare
from stiffmap.calibration.homing import own_part, zeros_anew
from stiffmap.calibration.model import (
    Fitted,
    Progress,
    Sensitivity,
    bends,
    fitted,
    sensitivity,
    sensitivity_at,
)
from stiffmap.calibration.result import Calibration
from stiffmap.calibration.statistics import Sums, directions, independent
from stiffmap.calibration.unknowns import GROUPS, Unknown, unknowns
from stiffmap.calibration.width import widened
from stiffmap.errors import StiffmapError
from stiffmap.experiment.channels import metres
from stiffmap.experiment.comparison.limitations import refuse
from stiffmap.experiment.comparison.summary import rms
from stiffmap.experiment.experiment import Experiment, Floats, Integers, Mask
from stiffmap.experiment.files.load import load_experiment
from stiffmap.experiment.noise.folds import folds
from stiffmap.experiment.noise.level import Noise, noise_of
from stiffmap.experiment.noise.outliers import outliers
from stiffmap.experiment.noise.whitening import Problem, nuisance_part
from stiffmap.experiment.prediction.predict import Predictor
from stiffmap.machine import Machine, load_machine
from stiffmap.one_thread import on_one_thread

BASE = ("zeros", "tool")
"""Groups that every machine has: the others are compared beside them."""
TYPICAL = 1.2
"""Robust spread of residuals, in noise floors, that still counts as a model that fits."""
Size = Callable[[Floats], float]
"""rms of (n, c) residuals in the unit of the report."""


@on_one_thread
def calibrate(
    machine: Machine | str | PathLike[str],
    experiment: Experiment | str | PathLike[str],
    *,
    tolerances: Tolerances | None = None,
    exclude: Sequence[str] = (),
    seed: int = 0,
    threads: int | None = None,
    budget: float | None = None,
    progress: Progress | None = None,
) -> Calibration:
    """What a machine's uncertain numbers are, and which of them the readings can tell.

    Parameters
    ----------
    machine
        Declared machine, the name of a shipped one, or a machine file.
    experiment
        An experiment, its folder or its YAML file.
    tolerances
        Standard uncertainties per class where the machine file gives none.
    exclude
        Groups that are left out (`GROUPS`): what is known to be right.
    seed
        Of the folds.
    budget
        Seconds after which no new step begins; the answer is then the best so far, and says so.
    progress
        Called with what is being tried, its number, and of how many.

    Raises StiffmapError for files that cannot be used, poses out of reach, an unknown noise or group.
    docs/calibration.md tells the method.
    """
    machine = machine if isinstance(machine, Machine) else load_machine(machine)
    data = experiment if isinstance(experiment, Experiment) else load_experiment(experiment)
    for name in exclude:
        if name not in GROUPS:
            raise StiffmapError(f"calibration: unknown group '{name}'; there are: {', '.join(GROUPS)}")
    predictor = Predictor(machine, data, threads=threads)
    refuse(predictor.experiment, predictor())
    wanted = [
        p
        for p in unknowns(machine.description, predictor.experiment, certified(tolerances, data))
        if p.group not in exclude
    ]
    until = time.monotonic() + budget if budget else np.inf
    return Calibrator.of(predictor, wanted, until, progress).answer(seed)


@dataclass(frozen=True, eq=False)
class Calibrator:
    """Readings, unknowns and what the readings feel of them, ready for inference."""

    predictor: Predictor
    sensitivity: Sensitivity
    noise: Noise
    problem: Problem
    columns: Floats
    """(N, p) whitened."""
    fit: Fitted
    rho: float
    """Variance of the model's error per pose, in noise variances."""
    out: Mask
    seconds: dict[str, float]
    until: float = np.inf

    @property
    def stopped(self) -> bool:
        """Whether the time budget ended it before it was done."""
        late = not self.fit.converged and time.monotonic() > self.until
        return self.sensitivity.stopped or late

    @staticmethod
    def of(
        predictor: Predictor,
        wanted: Sequence[Unknown],
        until: float = np.inf,
        progress: Progress | None = None,
    ) -> Calibrator:
        """Sensitivities, one fit, outliers taken out, the fit again without them."""
        start = time.perf_counter()
        e = predictor.experiment
        s = sensitivity(predictor, wanted, until=until, progress=progress)
        noise = noise_of(e)
        nobody = np.zeros(len(e), bool)
        begun = time.perf_counter()
        seconds = {"sensitivities": begun - start}
        first = Calibrator._on(predictor, s, noise, nobody, until, seconds)
        out = first._alone()
        found = first if not out.any() else Calibrator._on(predictor, s, noise, out, until, seconds)
        more = zeros_anew(s, e)
        if more is not None and found.better_with(more):
            s = more
            found = Calibrator._on(predictor, s, noise, out, until, seconds)
        fit = found.fit
        if time.monotonic() < until and bends(found.problem, s, fit.values, fit.prediction):
            s = sensitivity_at(predictor, s, fit.values, until)
            found = Calibrator._on(predictor, s, noise, out, until, seconds, fit.values)
        seconds["fit"] = time.perf_counter() - begun
        return found

    @staticmethod
    def _on(
        predictor: Predictor,
        s: Sensitivity,
        noise: Noise,
        out: Mask,
        until: float,
        seconds: dict[str, float],
        start: Floats | None = None,
    ) -> Calibrator:
        e = predictor.experiment
        problem = Problem.of(e, noise.sigma, s.base, ~out)
        columns = problem.white(s.columns)
        label = pose_labels(problem)
        q = problem.nuisance.shape[1]
        felt = columns @ directions(columns)

        def weigh(a: Floats, linear: Floats) -> tuple[Floats, float]:
            rho = model_form(Blocks.of(felt, linear, label, q))
            return Blocks.of(a, linear, label, q).beside(rho).estimate, 1.0 + rho

        fit = fitted(predictor, problem, s, columns, weigh, start=start, until=until)
        rho = model_form(Blocks.of(felt, fit.linear, label, q))
        return Calibrator(predictor, s, noise, problem, columns, fit, rho, out, seconds, until)

    def better_with(self, more: Sensitivity) -> bool:
        """Whether the evidence asks for unknowns beyond those that there are, each at a floor of its own."""
        label, q = pose_labels(self.problem), self.problem.nuisance.shape[1]
        wide = self.problem.white(more.columns)
        own, other = (Blocks.of(c @ directions(c), self.fit.linear, label, q) for c in (self.columns, wide))
        gain = other.log_likelihood(model_form(other)) - own.log_likelihood(model_form(own))
        return gain > STRONG

    def _alone(self) -> Mask:
        """(n,) outliers of the fit's residuals, judged against their typical size, so that a model that misfits as a
        whole makes none."""
        e = self.predictor.experiment
        left = self.left(self.fit.prediction)
        seen = np.isfinite(left).any(axis=0)
        typical = np.ones(left.shape[1])
        typical[seen] = 1.4826 * np.nanmedian(np.abs(left / self.noise.sigma)[:, seen], axis=0)
        return outliers(e, left, self.noise.sigma * np.maximum(typical / TYPICAL, 1.0))

    def left(self, prediction: Floats) -> Floats:
        """(n, c) reading minus prediction, less the frames and zeros that fit best."""
        raw = self.predictor.experiment.reading - prediction
        return np.asarray(raw - nuisance_part(self.problem, raw))

    def blocks(self, rows: Mask | None = None) -> Blocks:
        """Readings (of some, (N,)) in blocks of one pose and channel."""
        label, q = pose_labels(self.problem), int(self.problem.nuisance.shape[1])
        if rows is None:
            return Blocks.of(self.columns, self.fit.linear, label, q)
        return Blocks.of(self.columns[rows], self.fit.linear[rows], label[rows])

    @property
    def sums(self) -> Sums:
        """All readings, at the model-form floor."""
        return self.blocks().beside(self.rho)

    def members(self) -> dict[str, list[int]]:
        """Numbers of the unknowns of each group."""
        out: dict[str, list[int]] = {g: [] for g in GROUPS}
        for i, p in enumerate(self.sensitivity.unknowns):
            out[p.group].append(i)
        return {g: i for g, i in out.items() if i}

    def answer(self, seed: int = 0) -> Calibration:
        """The calibration with its verdict."""
        start = time.perf_counter()
        sums, members = self.sums, self.members()
        names = self.sensitivity.unknowns
        found = beyond_tolerance(sums, names, self._folds(seed), self.sensitivity.at)
        wider, times = widened(sums, members, (INSTRUMENT,))
        if (
            found.found and wider and wider[0].nats > found.found[0].nats
        ):  # many a little rather than one by much
            found = none_beyond(len(names))
        elif found.found:
            wider, times = widened(sums.scaled(found.factor), members, (INSTRUMENT,))
        factor = found.factor * times
        freed = sums.scaled(factor)
        choice = compare(freed, members, [b for b in BASE if b in members])
        fit, rho = self.fit, self.rho
        moved = bool(found.which or wider)
        values = freed.estimate * factor if moved else fit.values
        moves: dict[tuple[str, str], float] = {}
        built = values + found.logarithm
        for p, v in zip(names, built, strict=True):
            for place, weight in p.moves if not p.setup else ():
                moves[place] = moves.get(place, 0.0) + weight * p.u * float(v)
        e = self.predictor.experiment
        before = self.left(self.sensitivity.base)
        after = self.unwhite(self.residual_at(values)) if moved else self.left(fit.prediction)
        keep = ~self.out[:, None]
        unit, size, noise = _unit(e, self.noise)
        b, a = (size(np.where(keep, v, np.nan)) for v in (before, after))
        held = self._held_out(freed, choice, factor, seed, size)
        as_declared = sums.log_evidence <= sums.pick([]).log_evidence and not moved
        seconds = {**self.seconds, "evidence": time.perf_counter() - start}
        return Calibration(
            verdict=_verdict(as_declared, found.found, wider),
            rows=_rows(names, freed, factor, built),
            beyond=found.found,
            groups=choice,
            rank=sums.rank,
            held_out=held,
            rms_before=b,
            rms_after=a,
            noise=noise,
            floor=float(np.sqrt(rho)) * noise,
            explained=1.0 - (a / b) ** 2 if b > 0 else 0.0,
            rest=_rest(e, np.where(keep, after, np.nan), size),
            wider=wider,
            outliers=tuple(e.ids[i] for i in np.flatnonzero(self.out)),
            failed=self.sensitivity.failed,
            stopped=self.stopped,
            unit=unit,
            machine=Machine(edited(self.predictor.machine.description, moves)),
            experiment=e,
            residual=after,
            unknowns=names,
            values=built,
            seconds=seconds,
        )

    def _folds(self, seed: int) -> list[Sums]:
        """The sums of each fold's own readings."""
        label = folds(self.predictor.experiment, seed)[0][self.problem.index[0]]
        return [self.blocks(label == k).beside(self.rho) for k in np.unique(label)]

    def residual_at(self, values: Floats) -> Floats:
        """(N,) whitened residual at values (p,), linear in them."""
        return np.asarray(self.fit.linear - self.columns @ values)

    def unwhite(self, residual: Floats) -> Floats:
        """(n, c) SI of whitened residuals (N,)."""
        out = np.full(self.problem.sigma.shape, np.nan)
        out[self.problem.index] = residual * self.problem.sigma[self.problem.index]
        return out

    def _held_out(self, sums: Sums, choice: Choice, factor: Floats, seed: int, size: Size) -> HeldOut | None:
        """Each fold predicted from the others, linear in the unknowns; frames from all readings."""
        label, by = folds(self.predictor.experiment, seed)
        if label.max() == 0:
            return None
        members = self.members()
        base = [i for g in BASE for i in members.get(g, [])]
        sets = {
            "before": [],
            "all": list(range(len(sums.right))),
            "chosen": sorted({*base, *(i for g in choice.chosen for i in members[g])}),
        } | {g: sorted({*base, *i}) for g, i in members.items() if g not in BASE}
        at = label[self.problem.index[0]]
        left = {name: np.zeros(len(self.problem)) for name in sets}
        for fold in range(int(label.max()) + 1):
            test = at == fold
            others = self.blocks(~test).beside(self.rho).scaled(factor)
            for name, which in sets.items():
                values = np.zeros(len(sums.right))
                values[which] = others.pick(which).estimate * factor[which]
                rest = self.residual_at(values)
                left[name][test] = (rest - own_part(self.sensitivity.unknowns, self.columns, rest, test))[
                    test
                ]
        found = {name: size(self.unwhite(r)) for name, r in left.items()}
        keep = ~self.out[:, None]
        found["before"] = size(np.where(keep, self.left(self.sensitivity.base), np.nan))
        return HeldOut(by, found.pop("before"), found.pop("all"), found.pop("chosen"), found)


def pose_labels(problem: Problem) -> Integers:
    """(N,) number of the cluster (of one pose), set-up and channel of each reading."""
    e = problem.experiment
    row, axis = problem.index
    return np.asarray((e.clusters[row] * (int(e.runs.max()) + 1) + e.runs[row]) * len(e.channels) + axis)


def _unit(e: Experiment, noise: Noise) -> tuple[str, Size, float]:
    """What misfits are told in: lengths, or angles where nothing else is read."""
    lengths = metres(e.channels)
    columns = lengths & e.axis_read if (lengths & e.axis_read).any() else e.axis_read
    floor = float(np.sqrt(np.mean(noise.floor[columns] ** 2)))
    return ("m" if lengths[columns].any() else "rad"), (lambda values: rms(values[:, columns])), floor


def _rest(e: Experiment, left: Floats, size: Size) -> dict[str, float]:
    out = {c.name: rms(left[:, [i]]) for i, c in enumerate(e.channels) if e.axis_read[i]}
    setups = list(dict.fromkeys(e.setup))
    if len(setups) > 1:
        labels = np.array(e.setup)
        out |= {f"set-up {s}": size(left[labels == s]) for s in setups[:12]}
    return out


def _verdict(as_declared: bool, beyond: Sequence[Beyond], wider: Sequence[Wider]) -> str:
    single = [
        b.name if not b.rivals else f"{b.name} or {len(b.rivals)} other{'s' * (len(b.rivals) > 1)}"
        for b in beyond
    ]
    whole = [f"{' or '.join((w.group, *w.rivals))} as a whole" for w in wider]
    if single or whole:
        return "beyond tolerance: " + ", ".join([*single, *whole])
    return "as declared" if as_declared else "adjusted within tolerance"


def _rows(names: Sequence[Unknown], sums: Sums, factor: Floats, values: Floats) -> tuple[Row, ...]:
    spread = np.sqrt(np.maximum(np.diag(sums.covariance), 0.0)) if len(names) else np.zeros(0)
    kept, _ = independent(sums.gram)
    minimal = {int(i) for i in kept}
    out = []
    for i, (p, v) in enumerate(zip(names, values, strict=True)):
        told = 1.0 - spread[i] ** 2
        u = p.u * factor[i]
        out.append(
            Row(
                p.name,
                p.group,
                p.leg,
                p.unit,
                float(v * p.u),
                p.u,
                float(spread[i] * u),
                float(v / factor[i] / np.sqrt(told)) if told > 1e-9 else 0.0,
                bool(told > 0.5),
                float(1.0 / spread[i]),
                i in minimal,
            )
        )
    return tuple(out)
