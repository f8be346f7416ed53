"""Which machine file is handed over: as declared, calibrated, or corrected; by readings that no fit saw, never a worse one."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import cholesky, solve_triangular
from scipy.special import fdtrc

from stiffmap.common.broadcasting import Mask
from stiffmap.experiment.channels import metres
from stiffmap.experiment.comparison.residual import Summary, summary
from stiffmap.experiment.experiment import Experiment, Floats, Integers
from stiffmap.experiment.noise.outliers import GROSS
from stiffmap.experiment.noise.over_time import OverTime, over_time
from stiffmap.experiment.noise.whitening import LinearProblem, folds, left_unseen, nuisance_part
from stiffmap.experiment.prediction.predict import Predictor
from stiffmap.identification.inference.columns import MOST_READINGS, drawn
from stiffmap.identification.inference.constants import DEGREES, STANDS_OUT
from stiffmap.identification.inference.corrected import Corrected, columns_of, corrected, machine_of, without
from stiffmap.identification.inference.names import Inferred, of_noise_alone
from stiffmap.identification.inference.readings import readings
from stiffmap.identification.validity import covered
from stiffmap.solve.machine import Machine
from stiffmap.solve.validity import Validity

SET_ASIDE = (DEGREES + 1.0) / (DEGREES + GROSS**2)
"""Weight below which a reading counts in no measure: that of one beyond `GROSS` times the noise."""
WORD = 10
"""Poses that the model's own word counts for in a promise."""
FOLDS = 10
"""Groups of poses of which the promise is the mean."""
DECLARED, PLAIN, CALIBRATED, CORRECTED = "declared", "calibrated, noise alone", "calibrated", "corrected"


@dataclass(frozen=True, eq=False)
class HeldOut:
    """Readings that no fit saw."""

    before: Summary
    after: Summary
    folds: int
    by: str
    """``poses`` or ``set-ups``."""


@dataclass(frozen=True, eq=False)
class Written:
    """The machine of the three that predicts best, and what it leaves of the readings."""

    which: str
    """``declared``, ``calibrated`` or ``corrected``."""
    best: Corrected | None
    """None: the declared machine."""
    machine: Machine
    held_out: HeldOut | None
    """None where there are not two groups of readings, or time is over."""
    promise: tuple[float, float] | None
    """By how much a reading of another pose will differ, m or rad, and its standard uncertainty; None of a declared machine whose
    poses were not held out."""
    listed: Mask
    """(n,) rows that stand alone: no measure of a prediction."""
    difference: Floats
    """(n, c) m, rad: readings less its prediction, with frames and tools near where they fit best."""
    left: tuple[Floats, Floats]
    """(n, c) m, rad: readings less the predictions of the declared machine and of this one, less the frames, tools and zeros that
    fit all other rows best where that machine stands."""
    sizes: tuple[Summary, Summary]
    """The same in numbers, rows that stand alone left out."""
    over_time: OverTime | None
    """What this machine leaves over time; None where no times were recorded."""


def plain_calibration(predictor: Predictor, found: Inferred) -> dict[str, Corrected]:
    """The numbers that set-ups share, under noise and nothing else, by its name; nothing where there are none. What nobody can name goes
    on from pose to pose; no machine file has it, and numbers that are fitted next to it may be worse alone."""
    fit = of_noise_alone(found.columns)
    if fit is None:
        return {}
    given = readings(predictor, found, fit, exact=[u for u in found.columns.unknowns if u.setup])
    return {PLAIN: corrected(given, ())} if len(given.spread) else {}


def written(
    models: dict[str, Corrected],
    predictor: Predictor,
    found: Inferred,
    seed: int,
    over: Callable[[], bool],
    *,
    plain: bool,
) -> Written:
    """The last of some machines, by name, unless another of them or the declared one is clearly better; `plain`: a plain calibration
    is one of the others."""
    e, declared, sigma = predictor.experiment, found.plan.base, found.noise.sigma
    listed = stands_out(found, models.values())
    if plain and not over():
        models = plain_calibration(predictor, found) | models
    which, held, listed = _chosen(models, e, found, listed, seed, over)
    machine, there, prediction, promise = predictor.machine, e, declared, None
    if best := models.get(which):
        machine, there, prediction = machine_of(best), best.experiment, best.prediction
        promise = promised(best)
    if held is not None and held.by == "poses":
        promise = borne_out(promise, held.after.size[0], len(np.unique(e.groups)))
    problems = [LinearProblem.of(of, sigma, p, ~listed) for of, p in ((e, declared), (there, prediction))]
    difference = e.reading - declared, there.reading - prediction
    before, after = (r - nuisance_part(p, r) for p, r in zip(problems, difference, strict=True))
    first, last = (summary(np.where(listed[:, None], np.nan, r), sigma, e.channels) for r in (before, after))
    late = over_time(problems[1], problems[1].residual(prediction))
    return Written(
        which, best, machine, held, promise, listed, difference[1], (before, after), (first, last), late
    )


def _chosen(
    models: dict[str, Corrected],
    e: Experiment,
    found: Inferred,
    listed: Mask,
    seed: int,
    over: Callable[[], bool],
) -> tuple[str, HeldOut | None, Mask]:
    """Which machine is handed over, each fold of readings predicted from all others; (n,) rows that stand alone there."""
    declared, sigma, (label, by) = found.plan.base, found.noise.sigma, folds(e, seed)
    number = int(label.max()) + 1
    last = [DECLARED, *(m for m in models if m != PLAIN)][-1]
    if number < 2 or over():
        return last, None, listed
    left = {name: np.full_like(e.reading, np.nan) for name in (DECLARED, *models)}
    for k in range(number):
        test = label == k
        seen, own = ~test & ~listed, test & ~listed
        left[DECLARED][own] = left_unseen(e, sigma, declared, seen, own)[own]
        for name, whole in models.items():
            part = without(whole, ~test)
            shown = part.prediction + own_zeros(part, own)
            unseen = left_unseen(whole.experiment, whole.given.weighted_sigma, shown, seen, own)
            left[name][own] = unseen[own]
    best = _best(left, last, sigma, e.groups)
    if best == PLAIN:
        given = models[best].given
        listed = listed | np.isin(np.arange(len(e)), given.rows[given.weights < SET_ASIDE])
    before, after = (
        summary(np.where(listed[:, None], np.nan, left[name]), sigma, e.channels) for name in (DECLARED, best)
    )
    return best, HeldOut(before, after, number, by), listed


def own_zeros(found: Corrected, own: Mask) -> Floats:
    """(n, c) m, rad: what zeros of drives add that a set-up has for itself, by the readings of the rows `own` (n,), whole set-ups:
    no other set-up says anything of them."""
    given = found.given
    e = given.predictor.experiment
    names = np.array(e.setup or ("",) * len(e))
    inside = set(np.unique(names[own])) - set(np.unique(names[~own]))
    mine = [k for k, u in enumerate(given.sensitivity.unknowns) if u.setup in inside and u.setup]
    if not mine:
        return np.zeros_like(found.prediction)
    columns = np.nan_to_num(given.sensitivity.columns[..., mine]) * given.spread[mine]
    problem = LinearProblem.of(e, given.sigma, found.prediction, own)
    white = problem.white(columns)
    values = np.linalg.solve(
        white.T @ white + np.eye(len(mine)), white.T @ problem.residual(found.prediction)
    )
    return np.asarray(columns @ values)


def _best(left: dict[str, Floats], wanted: str, sigma: Floats, pose: Integers) -> str:
    """The machine that is wanted, unless another predicts the poses better by more than one standard error of the difference, under the
    heavy tails of readings at the noise of the machine that leaves least."""
    read = np.isfinite(left[DECLARED])
    if not read.any():
        return wanted
    size = {name: np.abs(np.nan_to_num(r / sigma, nan=np.inf)) for name, r in left.items()}
    noise = max(1.0, 1.4826 * min(float(np.median(r[read])) for r in size.values()))
    each = {
        name: np.bincount(pose, np.where(read, np.log1p((r / noise) ** 2 / DEGREES), 0.0).sum(axis=1))
        for name, r in size.items()
    }
    best = min(each, key=lambda name: float(each[name].sum()))
    worse = each[wanted] - each[best]
    if not np.isfinite(worse).all():
        return best
    return best if worse.mean() > worse.std() / np.sqrt(len(worse)) else wanted


def borne_out(promise: tuple[float, float] | None, left: float, poses: int) -> tuple[float, float]:
    """A promise and its standard uncertainty after so many poses were predicted by the others, with what that left (rms): the model's
    word counts as much as `WORD` poses do, if it has one."""
    word, said = (WORD, promise[0]) if promise else (0, 0.0)
    size = float(np.sqrt((word * said**2 + poses * left**2) / (word + poses)))
    return size, size / float(np.sqrt(2.0 * (word + poses)))


def promised(found: Corrected) -> tuple[float, float]:
    """Standard deviation by which a reading of a pose that was not read differs from a machine file, m (rad where no length is
    read), noise and what nobody can name in it; and the standard uncertainty of that.

    With the columns B of numbers, effects and frames, their coefficients' posterior covariance P by the readings T of all other
    poses, and W the inverse of the covariance C of the rest: the error at poses F is B_F (β - β̂) + ε_F, of variance
    B P Bᵀ + C_FF - 2 B P B_TᵀW C_TF, since what nobody can name goes on from pose to pose and the file has none of it.
    """
    given = found.given
    e = given.predictor.experiment
    use = drawn(e.groups[given.rows], 0, MOST_READINGS)
    rows, channel = given.rows[use], given.channel[use]
    length = metres(e.channels)[channel]
    seen = length if length.any() else ~length
    factor = given.rest.factor[use]
    rest = factor @ factor.T + np.diag(given.rest.noise[use])
    columns, prior = columns_of(found)
    columns = columns[use]
    pose = e.groups[rows]
    number = len(np.unique(pose))
    label = np.random.default_rng(0).permutation(int(pose.max()) + 1)[pose] % max(2, min(FOLDS, number))
    total, count = 0.0, 0
    for k in np.unique(label):
        test = (label == k) & seen & (given.weights[use] >= 1.0 / STANDS_OUT)
        train = label != k
        if not test.any() or not train.any():
            continue
        root = cholesky(rest[np.ix_(train, train)], lower=True, check_finite=False)
        white = solve_triangular(root, columns[train], lower=True, check_finite=False)
        posterior = np.linalg.pinv(white.T @ white + np.diag(prior), rcond=1e-13, hermitian=True)
        cross = solve_triangular(root, rest[np.ix_(train, test)], lower=True, check_finite=False)
        b = columns[test]
        variance = np.sum((b @ posterior) * b, axis=1) + np.diag(rest)[test]
        variance = variance - 2.0 * np.sum((b @ posterior) * (cross.T @ white), axis=1)
        total += float(np.sum(variance * given.sigma[rows[test], channel[test]] ** 2))
        count += int(test.sum())
    size = float(np.sqrt(max(total, 0.0) / count)) if count else float("nan")
    return size, size / float(np.sqrt(2.0 * number))


def lack_of_fit(left: Floats, heavy: bool, fitted: int, known_by: int) -> float:
    """p-value (F) of what a machine leaves of the readings, in noise that is independent and of a size known by so many readings.
    `heavy`: of heavy tails, of which the bounded squares have the mean of one as well; `fitted`: how many numbers were."""
    square = left[np.isfinite(left)] ** 2
    if heavy:
        square *= (DEGREES + 1.0) / (DEGREES + square)
    free = max(1, len(square) - fitted)
    return float(fdtrc(free, max(1, known_by), square.sum() / free))


def vouched(predictor: Predictor, made: Written, said: str) -> Machine:
    """The machine that is handed over; its file says what it has from which experiment (`said`), what the readings that do not stand
    alone covered, and by how much its prediction of others is off."""
    own = Validity.of_machine(predictor.machine)
    if made.which == DECLARED and (
        made.promise is None or own is not None
    ):  # keeps what other readings covered
        return predictor.machine
    e, d = predictor.experiment, made.machine.description
    source = d.source if made.which == DECLARED else f"{d.source} {said}".strip()
    declared = None if d.declared is None else replace(d.declared, source=source)
    valid = covered(predictor.machine, e, ~made.listed)
    error, u = made.promise or (np.nan, np.nan)
    if np.isfinite(error):
        valid = replace(valid, error=error, error_u=u, unit=made.sizes[0].size[1])
    return valid.kept_by(Machine(replace(d, source=source, declared=declared)))


def stands_out(found: Inferred, models: Iterable[Corrected]) -> Mask:
    """(n,) rows with a reading that heavy tails give next to no weight, in the search or in a machine; of rows that neither has, those
    that stood alone from the first."""
    out, seen = found.suspects.copy(), np.zeros_like(found.suspects)
    searched = found.columns.rows, found.search.best.fit.weights
    weights = [searched, *((m.given.rows, m.given.weights) for m in models)]
    for rows, w in reversed(weights):
        out[rows[~seen[rows]]] = False
        seen[rows] = True
        out[rows[w < SET_ASIDE]] = True
    return out
