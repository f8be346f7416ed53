"""`calibrate`: every uncertain number of a machine from readings, at once."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from os import PathLike

import numpy as np

from stiffmap.calibration.certificate import certified
from stiffmap.calibration.claims import BesideField, Claims, claims
from stiffmap.calibration.defaults import Tolerances
from stiffmap.calibration.edit import edited
from stiffmap.calibration.facts import Beyond, HeldOut, Row, Wider
from stiffmap.calibration.floor import Blocks, model_form
from stiffmap.calibration.groups import STRONG, Choice, compare
from stiffmap.calibration.homing import own_part, zeros_anew
from stiffmap.calibration.model import (
    FIRST,
    STEPS,
    Fitted,
    Progress,
    Sensitivity,
    bends,
    fitted,
    predicted,
    sensitivity,
    sensitivity_at,
)
from stiffmap.calibration.result import Calibration
from stiffmap.calibration.statistics import Sums, directions, gain_of, independent
from stiffmap.calibration.travel import Drive, Travel, travel
from stiffmap.calibration.unknowns import GROUPS, Unknown, unknowns
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
from stiffmap.experiment.poses.configuration import coordinates_of
from stiffmap.experiment.prediction.predict import Predictor
from stiffmap.machine import Machine, load_machine
from stiffmap.one_thread import on_one_thread

BASE = ("zeros", "tool")
"""Groups that every machine has: the others are compared beside them."""
TYPICAL = 1.2
"""Robust spread of residuals, in noise floors, that still counts as a model that fits."""
AGAIN, NEAR = 4, 0.3
"""Fits of what is claimed through the full prediction; change of all readings together, in noise, that ends them."""
BORNE_OUT = 0.5
"""Share of what slopes promise of a claim that the full prediction must keep."""
DEMANDED = 5.41
"""Nats by which readings must demand a floor: half the chi-square of one degree of freedom of one in a thousand."""
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
        found = first
        if out.any():
            found = Calibrator._on(predictor, s, noise, out, until, seconds, start=first.fit.values)
        more = zeros_anew(s, e)
        if more is not None and found.better_with(more):
            begin = np.append(found.fit.values, np.zeros(len(more.unknowns) - len(s.unknowns)))
            s = more
            found = Calibrator._on(predictor, s, noise, out, until, seconds, start=begin)
        fit = found.fit
        bent = not fit.converged or bends(found.problem, s, fit.values, fit.prediction)
        if time.monotonic() < until and bent:
            s = sensitivity_at(predictor, s, fit.values, until)
            found = Calibrator._on(predictor, s, noise, out, until, seconds, fit)
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
        at: Fitted | None = None,
        start: Floats | None = None,
    ) -> Calibrator:
        """`start`: values to begin with. `at`: where the columns of `s` were taken anew. What frames and tools do is then taken there as well: a
        tool's shift turned otherwise than its frame would else leave a thousandth that no frame explains."""
        e = predictor.experiment
        problem = Problem.of(e, noise.sigma, s.base if at is None else at.prediction, ~out)
        columns = problem.white(s.columns)
        label = pose_labels(problem)
        q = problem.nuisance.shape[1]
        felt = columns @ directions(columns)

        def weigh(a: Floats, linear: Floats) -> tuple[Floats, float]:
            rho = model_form(Blocks.of(felt, linear, label, q))
            return Blocks.of(a, linear, label, q).beside(rho).estimate, 1.0 + rho

        start, steps = (start, FIRST) if at is None else (at.values, STEPS)
        fit = fitted(predictor, problem, s, columns, weigh, start=start, until=until, steps=steps)
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
        by_noise = outliers(e, left, self.noise.sigma * np.maximum(typical / TYPICAL, 1.0))
        return by_noise | outliers(e, left, self.noise.sigma * np.maximum(typical, 1.0), lone=True)

    def left(self, prediction: Floats) -> Floats:
        """(n, c) reading minus prediction, less the frames and zeros that fit best."""
        raw = self.predictor.experiment.reading - prediction
        return np.asarray(raw - nuisance_part(self.problem, raw))

    def blocks(self, rows: Mask | None = None, fit: Fitted | None = None) -> Blocks:
        """Readings (of some, (N,)) in blocks of one pose and channel; `fit`: another than the calibration's own."""
        label, q = pose_labels(self.problem), int(self.problem.nuisance.shape[1])
        linear = (fit or self.fit).linear
        if rows is None:
            return Blocks.of(self.columns, linear, label, q)
        return Blocks.of(self.columns[rows], linear[rows], label[rows])

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
        claimed, fit, rho = self._claimed(sums, members, seed)
        factor, found, wider = claimed.factor, claimed.singles, claimed.groups
        freed = self.blocks(fit=fit).beside(rho).scaled(factor)
        choice = compare(freed, members, [b for b in BASE if b in members])
        built = found.built(fit.values, names, self.sensitivity.at)
        moves: dict[tuple[str, str], float] = {}
        for p, v in zip(names, built, strict=True):
            for place, weight in p.moves if not p.setup else ():
                moves[place] = moves.get(place, 0.0) + weight * p.u * float(v)
        e = self.predictor.experiment
        before, after = self.left(self.sensitivity.base), self.left(fit.prediction)
        keep = ~self.out[:, None]
        unit, size, noise = _unit(e, self.noise)
        b, a = (size(np.where(keep, v, np.nan)) for v in (before, after))
        held = self._held_out(choice, factor, fit, rho, seed, size)
        as_declared = sums.log_evidence <= sums.pick([]).log_evidence and not claimed.any
        misfits = self._misfits(fit, factor)
        profiles = self._travel(fit, rho, factor, seed, size) if misfits else None
        rest = _outweighs(held.before, held.after, noise) if held else _outweighs(b, a, noise)
        unexplained = (rest or bool(claimed.refused)) and not claimed.any and misfits
        seconds = {**self.seconds, "evidence": time.perf_counter() - start}
        return Calibration(
            verdict=_verdict(as_declared, found.found, wider, unexplained),
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
            refused=claimed.refused,
            travel=profiles,
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

    def _claimed(self, sums: Sums, members: dict[str, list[int]], seed: int) -> tuple[Claims, Fitted, float]:
        """What is claimed, the fit with that let go, and its floor."""
        judged: list[tuple[BesideField, list[Fold]]] = []
        everything = {"all": list(range(len(sums.right)))}

        def why_not(factor: Floats, trial: Floats) -> str:
            if not judged:
                judged.append((self._beside_field(), self._parts(self.fit, seed)))
            field, parts = judged[0]
            nats = field.log_evidence(trial) - field.log_evidence(factor)
            if nats < STRONG:
                return f"a smooth field that knows nothing of the machine explains as much ({nats:+.0f} nats beside it)"
            if len(parts) < 2:
                return ""
            one, other = (
                self._left_out(parts, everything, self.fit, self.rho, f)["all"] for f in (factor, trial)
            )
            gain, error = gain_of(one, other, [f.test for f in parts])
            # a fit that is as good as noise has nothing to gain
            holds = gain > (error if misfits else -error)
            return "" if holds else f"held-out readings gain {gain:.2g} ± {error:.2g} noise variances"

        misfits = self._misfits(self.fit, np.ones(len(sums.right)))
        found = claims(
            sums, self.sensitivity.unknowns, members, self._folds(seed), self.sensitivity.at, why_not
        )
        if not found.any:
            return found, self.fit, self.rho
        fit, rho = self._let_go(found)
        if fit.converged:
            return found, fit, rho
        return found.withdrawn("so far off the machine does not do what its slopes say"), self.fit, self.rho

    def _beside_field(self) -> BesideField:
        left = self.left(self.fit.prediction)
        return BesideField.of(self.problem, self.columns, self.fit.linear, pose_labels(self.problem), left)

    def _let_go(self, claimed: Claims) -> tuple[Fitted, float]:
        """The fit with what is claimed let go, and its floor: by the slopes that there are, through the full prediction."""
        names, at = self.sensitivity.unknowns, self.sensitivity.at
        fit, rho, promised = self.fit, self.rho, 0.0
        before = float(fit.residual @ fit.residual)
        for again in range(AGAIN):
            blocks = self.blocks(fit=fit).scaled(claimed.factor)
            rho = model_form(blocks)
            values = blocks.beside(rho).estimate * claimed.factor
            told = fit.linear - self.columns @ values
            promised = promised if again else before - float(told @ told)
            close = float(np.linalg.norm(self.columns @ (values - fit.values))) < NEAR
            try:
                prediction = predicted(self.predictor, names, claimed.singles.built(values, names, at))
                residual = self.problem.residual(prediction)
            except StiffmapError:
                return replace(fit, converged=False), rho
            fit = Fitted(values, prediction, residual, residual + self.columns @ values, True)
            if close:
                break
        gained = before - float(fit.residual @ fit.residual)
        return replace(fit, converged=gained > BORNE_OUT * promised), rho

    def _misfits(self, fit: Fitted, factor: Floats) -> bool:
        """Whether the readings demand a floor beyond noise."""
        blocks = self.blocks(fit=fit).scaled(factor)
        return blocks.log_likelihood(model_form(blocks)) - blocks.log_likelihood(0.0) > DEMANDED

    def _folds(self, seed: int) -> list[Sums]:
        """The sums of each fold's own readings."""
        label = folds(self.predictor.experiment, seed)[0][self.problem.index[0]]
        return [self.blocks(label == k).beside(self.rho) for k in np.unique(label)]

    def _parts(self, fit: Fitted, seed: int) -> list[Fold]:
        """Which readings (N,) each fold leaves out, and the others in blocks; nothing where there are not two folds."""
        label = folds(self.predictor.experiment, seed)[0]
        at = label[self.problem.index[0]]
        tests = [at == k for k in range(int(label.max()) + 1)] if label.max() else []
        return [Fold(test, self.blocks(~test, fit)) for test in tests]

    def unwhite(self, residual: Floats) -> Floats:
        """(n, c) SI of whitened residuals (N,)."""
        out = np.full(self.problem.sigma.shape, np.nan)
        out[self.problem.index] = residual * self.problem.sigma[self.problem.index]
        return out

    def _held_out(
        self, choice: Choice, factor: Floats, fit: Fitted, rho: float, seed: int, size: Size
    ) -> HeldOut | None:
        """Each fold predicted from the others, linear in the unknowns; frames from all readings."""
        _, by = folds(self.predictor.experiment, seed)
        parts = self._parts(fit, seed)
        if not parts:
            return None
        members = self.members()
        base = [i for g in BASE for i in members.get(g, [])]
        sets: dict[str, list[int]] = {
            "all": list(range(len(factor))),
            "chosen": sorted({*base, *(i for g in choice.chosen for i in members[g])}),
        } | {g: sorted({*base, *i}) for g, i in members.items() if g not in BASE}
        left = self._left_out(parts, sets, fit, rho, factor)
        found = {name: size(self.unwhite(r)) for name, r in left.items()}
        keep = ~self.out[:, None]
        before = size(np.where(keep, self.left(self.sensitivity.base), np.nan))
        return HeldOut(by, before, found.pop("all"), found.pop("chosen"), found)

    def _travel(self, fit: Fitted, rho: float, factor: Floats, seed: int, size: Size) -> Travel | None:
        """What is left, as profiles over the drives' coordinates."""
        e, s = self.predictor.experiment, self.sensitivity
        label, by = folds(e, seed)
        zeros = [i for i, u in enumerate(s.unknowns) if u.group == "zeros" and not u.setup]
        if e.quantity != "position" or not zeros or self.stopped:
            return None
        machine = self.predictor.machine
        at = coordinates_of(machine, e)
        drives = [
            Drive(name, u.unit, s.columns[..., i] / u.u, at[:, machine.compiled.names.joints[name]])
            for i, u, name in ((i, s.unknowns[i], s.unknowns[i].moves[0][0][0]) for i in zeros)
        ]

        def own(rest: Floats, test: Mask) -> Floats:
            return own_part(s.unknowns, self.columns, rest, test)

        def told(left: Floats) -> float:
            return size(self.unwhite(left))

        label = label[self.problem.index[0]]
        return travel(self.problem, drives, self.columns * factor, fit.linear, rho, label, by, own, told)

    def _left_out(
        self,
        parts: Sequence[Fold],
        sets: Mapping[str, Sequence[int]],
        fit: Fitted,
        rho: float,
        factor: Floats,
    ) -> dict[str, Floats]:
        """(N,) residual of each fold predicted from the others, by sets of unknowns at `factor` times their uncertainty."""
        left = {name: np.zeros(len(self.problem)) for name in sets}
        for fold in parts:
            others = fold.others.beside(rho).scaled(factor)
            for name, which in sets.items():
                values = np.zeros(len(factor))
                values[list(which)] = others.pick(which).estimate * factor[list(which)]
                rest = fit.linear - self.columns @ values
                own = own_part(self.sensitivity.unknowns, self.columns, rest, fold.test)
                left[name][fold.test] = (rest - own)[fold.test]
        return left


@dataclass(frozen=True, eq=False)
class Fold:
    """Readings that are left out together, and the others."""

    test: Mask
    """(N,)."""
    others: Blocks


def _outweighs(before: float, after: float, noise: float) -> bool:
    """Whether of a misfit (rms) more is left than is explained, noise taken off."""
    return after**2 - noise**2 > 0.5 * (before**2 - noise**2) > 0.0


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


def _verdict(as_declared: bool, beyond: Sequence[Beyond], wider: Sequence[Wider], unexplained: bool) -> str:
    single = [
        b.name if not b.rivals else f"{b.name} or {len(b.rivals)} other{'s' * (len(b.rivals) > 1)}"
        for b in beyond
    ]
    whole = [f"{' or '.join((w.group, *w.rivals))} as a whole" for w in wider]
    if single or whole:
        return "beyond tolerance: " + ", ".join([*single, *whole])
    if unexplained:
        return "unattributed"
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
