"""Effects on top of a calibration: a real machine is off in many small ways before it has one fault.

One fault on an exact machine, and a machine whose every number is a little off, are compared by their evidence. Where
the second explains the readings better, effects are looked for jointly with it, all uncertain numbers integrated
out, and named only at the floor of what no model explains, where folds share them and held-out readings gain.
"""

from __future__ import annotations

import copy
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import chi2

from stiffmap.experiment.experiment import Floats
from stiffmap.experiment.noise.whitening import Problem
from stiffmap.identification.calibration import Calibration, Calibrator, Tolerances, unknowns
from stiffmap.identification.calibration.calibrator import pose_labels
from stiffmap.identification.calibration.conclude import conclude
from stiffmap.identification.calibration.floor import Blocks, model_form
from stiffmap.identification.calibration.statistics import Sums
from stiffmap.identification.diagnosis.decision.beside_field import standing
from stiffmap.identification.diagnosis.decision.beside_noise import above_noise
from stiffmap.identification.diagnosis.decision.beside_time import beside_time
from stiffmap.identification.diagnosis.decision.cross_validation import HeldOut, held_out
from stiffmap.identification.diagnosis.decision.few import MEETING, not_few, screened
from stiffmap.identification.diagnosis.decision.judge import judge, unexplained, with_model
from stiffmap.identification.diagnosis.decision.patterns import Pattern
from stiffmap.identification.diagnosis.decision.refusals import EVERYWHERE, RULES, Rule, why_not
from stiffmap.identification.diagnosis.fitting.fit import evaluate, fit_without
from stiffmap.identification.diagnosis.fitting.model import Model
from stiffmap.identification.diagnosis.search.calibrated import Layer
from stiffmap.identification.diagnosis.search.study import Finding, Study, find, search_on, study

COVERED, FAINT = 0.95, 0.1
"""Share of an effect's signature that uncertain numbers imitate; those that ten standard uncertainties of show at all."""
SELDOM = 1e-3
"""Odds of what tolerances may be by chance."""
NEAR = 2.0
"""Standard uncertainties by which numbers that are within tolerance may be off along one direction."""
WORTH_A_FLOOR = 0.3
"""Noise variances per pose that no linear explanation takes: effects are then looked for at that floor at once."""
LEAD, CLEAR = 3.0, 6.0
"""Nats by which effects on an exact machine must lead to be considered, odds of 20, and to be the only answer, odds of 400:
strong and very strong evidence (Kass and Raftery 1995). Between the two numbers that are a little off remain a rival."""
REJECTED = 5.41
"""Nats by which the readings must reject the floor that a search was done at, before it is done again at the lower
one: half the chi-square of one degree of freedom that chance exceeds once in a thousand."""
SCALES = (1.0, 0.3, 0.1, 0.03, 0.01)


@dataclass(frozen=True, eq=False)
class Answer:
    """What a diagnosis found, with or without a calibration below it."""

    study: Study
    finding: Finding
    verdict: str
    left: list[Pattern]
    calibration: Calibration | None = None
    held: HeldOut | None = None
    refused: tuple[str, ...] = ()
    """Effects that the readings seemed to demand and that are not named, and why."""
    notes: tuple[str, ...] = ()
    """What else the reader must know of the answer."""


def find_effects(s: Study, seed: int, tolerances: Tolerances, exclude: tuple[str, ...] = ()) -> Answer:
    """Effects on the declared machine, or on a calibrated one unless the former explain the readings better by `LEAD`
    nats: what tolerances may be is no cause."""
    found: Calibrator | None = None
    if s.experiment.quantity == "position" and not s.clock.over:
        found = calibrator(s, tolerances, exclude)
        if found is not None and not_few(s, screened(s), spread_evidence(s.whole[0], found)):
            return _layered(s, found, seed, tolerances)
    finding, verdict, left = judge(s, find(s))
    model, never = admissible(finding.model, finding, tolerances, EVERYWHERE)
    model, noisy = above_noise(finding, model)
    model, late = beside_time(finding, model)
    refused = never + noisy + late
    if refused:
        finding = with_model(finding, model)
        left = unexplained(s, finding)
        verdict = _without(finding, bool(left or never or late))
    first = Answer(s, finding, verdict, left, refused=refused)
    if s.clock.over or not (left or finding.model.candidates or refused):
        return first
    found = found or calibrator(s, tolerances, exclude)
    if found is None:
        return first
    lead = sparse_evidence(first) - spread_evidence(finding.search.problem, found)
    if not left and lead >= LEAD:
        return first if lead >= CLEAR or not model.candidates else _beside_numbers(first, lead)
    return _layered(s, found, seed, tolerances)


def _beside_numbers(first: Answer, lead: float) -> Answer:
    """Effects that numbers which are a little off explain nearly as well."""
    note = f"every number a little off, within its tolerance, explains the readings nearly as well (odds of {np.exp(lead):.0f} for the effect)"
    return replace(first, verdict="ambiguous", notes=(note,))


def _layered(s: Study, found: Calibrator, seed: int, tolerances: Tolerances) -> Answer:
    """Effects on top of a calibration; at the floor of what no model explains, where something is left."""
    s.clock.say("effects on top of a calibration")
    base = _above(s, Layer.of(found, conclude(found, seed)), seed)
    rho = _floor_beside_screen(base)
    if rho < WORTH_A_FLOOR:
        answer = _searched(base, tolerances)
        if not answer.left:
            return answer
        rho = floor_of(base, answer.finding)
    return _at_the_floor(base, found, rho, seed, tolerances)


def _above(s: Study, layer: Layer, seed: int) -> Study:
    """The study of the same readings above a calibration."""
    straight = copy.copy(s.predictor)  # shares what was solved
    straight.experiment = layer.straight(s.predictor.experiment)
    return study(straight, seed, layer, s.clock, s.without, s.scheduler)


def _floor_beside_screen(s: Study) -> float:
    """What the calibration and the best few effects, taken as linear, leave per pose, in noise variances."""
    left = screened(s).left
    blocks = Blocks.of(np.zeros((len(left), 0)), left, pose_labels(s.whole[0]))
    return model_form(blocks) * blocks.typical


def calibrator(s: Study, tolerances: Tolerances, exclude: tuple[str, ...]) -> Calibrator | None:
    """The calibration of a study's readings; None where the readings feel no uncertain number."""
    s.clock.say("calibration: every uncertain number at once")
    p = s.predictor
    names = [u for u in unknowns(p.machine.description, p.experiment, tolerances) if u.group not in exclude]
    found = Calibrator.of(p, names, s.clock.until)
    return found if found.sensitivity.unknowns else None


def sparse_evidence(first: Answer) -> float:
    """ln of the evidence of a few effects on an exact machine.

    Each parameter pays for how finely it had to be tuned (a normal prior of its own size), each effect for
    the choice among all candidates, each further one that several faults meet on one machine.
    """
    model, search = first.finding.model, first.finding.search
    if not model.candidates:
        return -0.5 * model.chi2
    assert model.jacobian is not None
    null = np.array([float(p.null or 0.0) / p.scale for c in model.candidates for p in c.parameters])
    sized = model.jacobian * np.abs(model.values - null)
    volume = float(np.linalg.slogdet(np.eye(sized.shape[1]) + sized.T @ sized)[1])
    number = len(model.candidates)
    price = 0.5 * (volume + model.freedom) + number * float(np.log(max(search.effective_trials, 1.0)))
    return -0.5 * model.chi2 - price - MEETING * (number - 1)


def spread_evidence(problem: Problem, found: Calibrator) -> float:
    """ln of the evidence of a machine whose every number is uncertain, on the same rows.

    Machines may be better than their tolerances: of a few scales of all uncertainties the best counts.
    """
    fit = found.fit
    columns = problem.white(found.sensitivity.columns)
    residual = problem.residual(fit.prediction) + columns @ fit.values
    sums = Sums.of(columns, residual)
    p = len(sums.right)
    return max(sums.scaled(np.full(p, f)).log_evidence for f in SCALES) - float(np.log(len(SCALES)))


def _searched(s: Study, tolerances: Tolerances) -> Answer:
    assert s.layer is not None
    finding, verdict, left = judge(s, find(s))
    model, refused = admissible(finding.model, finding, tolerances)
    model, more = _beyond_calibration(s, model, finding)
    model, noisy = above_noise(finding, model)
    model, late = beside_time(finding, model)
    refused += more + noisy + late
    if refused:
        finding = with_model(finding, model)
        left = unexplained(s, finding)
        verdict = _word(s, finding, left)
    return Answer(s, finding, verdict, left, s.layer.calibration, refused=refused)


def _at_the_floor(s: Study, found: Calibrator, rho: float, seed: int, tolerances: Tolerances) -> Answer:
    """The search where what no model explains counts as noise; only what holds is named."""
    assert s.layer is not None
    again, finding = _found_at(s, found, rho, seed)
    if finding.model.candidates and not s.clock.over:
        lower = floor_of(s, finding)
        if lower < rho and rejected(s, finding, rho):  # the first floor held what the effects explain
            again, finding = _found_at(s, found, lower, seed)
    model, refused = admissible(finding.model, finding, tolerances)
    model, same = _beyond_calibration(s, model, finding)
    model, late = beside_time(finding, model)
    same += late
    named = with_model(finding, model)
    left = unexplained(s, _on(s, named))
    model, smooth = standing(s, named) if left else (model, ())
    # what stands is held out as it was found; where nothing does, no fold is searched
    held = held_out(again, finding.outliers, seed, finding, search=bool(model.candidates))
    beside = _tolerated(again, with_model(finding, model)) if held and model.candidates else None
    if beside is not None and held is not None and not held.pays:
        held = replace(held, gain=_gain_beside(beside, finding, seed))
    model, more = _shared(model, finding, held)
    named = with_model(finding, model)
    if smooth or more:
        left = unexplained(s, _on(s, named))
    refused = (*refused, *same, *smooth, *more)
    return Answer(again, named, _word(s, named, left), left, s.layer.calibration, held, refused)


def _gain_beside(s: Study, finding: Finding, seed: int) -> tuple[float, float] | None:
    """What effects gain on held-out readings in another study."""
    held = held_out(s, finding.outliers, seed, finding)
    return None if held is None else held.gain


def _found_at(s: Study, found: Calibrator, rho: float, seed: int) -> tuple[Study, Finding]:
    """The search done again where `rho` noise variances of no model's count as noise."""
    s.clock.say("the search again, where what no model explains counts as noise")
    assert s.layer is not None
    raised = Layer.of(found, s.layer.calibration, rho)
    again = study(s.predictor, seed, raised, s.clock, s.without, s.scheduler)
    return again, find(again)


def _on(s: Study, finding: Finding) -> Finding:
    """The model of a finding judged at the noise of another study."""
    search = search_on(s, ~finding.outliers, finding.search.finalists)
    return replace(
        with_model(finding, evaluate(finding.model, search.predictor, search.problem)), search=search
    )


def floor_of(s: Study, finding: Finding) -> float:
    """What no model explains, in noise variances of one reading: REML per pose, jointly with calibration and effects."""
    blocks = _left_by(s, finding)
    return model_form(blocks) * blocks.typical


def rejected(s: Study, finding: Finding, rho: float) -> bool:
    """Whether what a finding leaves is likelier by `REJECTED` nats at a floor of its own than at `rho`."""
    blocks = _left_by(s, finding)
    own, first = model_form(blocks), rho / blocks.typical
    return blocks.log_likelihood(own) - blocks.log_likelihood(first) > REJECTED


def _left_by(s: Study, finding: Finding) -> Blocks:
    """What the calibration and the effects of a finding leave, in blocks of one pose and channel."""
    assert s.layer is not None
    problem = s.problem_of(~finding.outliers).exact
    columns = problem.white(s.layer.columns)
    residual = problem.residual(s.predictor(finding.model.terms()))
    return Blocks.of(columns, residual, pose_labels(problem))


def _without(finding: Finding, rest: bool) -> str:
    """The verdict on an exact machine where effects were refused; `rest`: something is left, or what they explained is."""
    named = bool(finding.model.candidates)
    if rest:
        return "effects+unattributed" if named else "unattributed"
    return "effects" if named else "none"


def _word(s: Study, finding: Finding, left: list[Pattern]) -> str:
    named = bool(finding.model.candidates)
    calibration = None if s.layer is None else s.layer.calibration
    if left or (calibration is not None and calibration.verdict == "unattributed" and not named):
        return "effects+unattributed" if named else "unattributed"
    if (
        calibration is not None and calibration.wider and not named
    ):  # a group of numbers is beyond tolerance, and none of them stands out
        return "ambiguous"
    return "effects" if named else "none"


def admissible(
    model: Model, finding: Finding, tolerances: Tolerances, rules: tuple[Rule, ...] = RULES
) -> tuple[Model, tuple[str, ...]]:
    """The model without effects that are never named, and why they are not."""
    refused: list[str] = []
    while model.candidates:
        why = [
            (i, w)
            for i, w in ((i, why_not(model, i, tolerances, rules)) for i in range(len(model.candidates)))
            if w
        ]
        if not why:
            break
        i, word = why[0]
        refused.append(f"{model.candidates[i]}: {word}")
        model = fit_without(model, i, finding.search.predictor, finding.search.problem)
    return model, tuple(refused)


def _beyond_calibration(s: Study, model: Model, finding: Finding) -> tuple[Model, tuple[str, ...]]:
    """The model without effects that are nothing but numbers which the calibration finds within tolerance."""
    assert s.layer is not None
    if s.layer.calibration.beyond:
        return model, ()
    problem, predictor = finding.search.problem.exact, finding.search.predictor
    columns = problem.white(s.layer.columns)
    refused: list[str] = []
    for c in tuple(model.candidates):
        i = model.candidates.index(c)
        less = fit_without(model, i, predictor, finding.search.problem)
        alone = problem.white(predictor(model.terms()) - predictor(model.without(i).terms()))
        if imitated(columns, alone):
            refused.append(f"{c}: numbers that are uncertain anyway show the same, and are within tolerance")
            model = less
    return model, tuple(refused)


def imitated(columns: Floats, signature: Floats) -> bool:
    """Whether numbers with columns (N, p) per standard uncertainty show `COVERED` of a signature (N,), none of it by being
    off more than all of them together are once in `SELDOM`."""
    needed, told = imitation(columns, signature)
    return needed is not None and float(needed @ needed) <= float(chi2.isf(SELDOM, max(told, 1)))


def imitation(columns: Floats, signature: Floats) -> tuple[Floats | None, int]:
    """(p,) the most likely values with which numbers show `COVERED` of a signature (N,), None where they do not, and how
    many directions of them the readings determine."""
    u, size, v = np.linalg.svd(columns, full_matrices=False)
    felt = size > FAINT
    along = u[:, felt].T @ signature
    told = int((size[felt] > 1.0).sum())
    if float(along @ along) <= COVERED * float(signature @ signature):
        return None, told
    return np.asarray(v[felt].T @ (along * size[felt] / (1.0 + size[felt] ** 2))), told


def _tolerated(s: Study, finding: Finding) -> Study | None:
    """The study where the numbers that imitate an effect of a finding stay as near as tolerances allow; None: none does.

    Many readings overrun a prior: jointly with numbers that are as far off as they like no such effect gains anything.
    """
    assert s.layer is not None
    problem, predictor, model = finding.search.problem.exact, finding.search.predictor, finding.model
    layer = s.layer
    for i in range(len(model.candidates)):
        alone = problem.white(predictor(model.terms()) - predictor(model.without(i).terms()))
        needed, _ = imitation(problem.white(layer.columns), alone)
        far = 0.0 if needed is None else float(np.linalg.norm(needed))
        if needed is not None and far > NEAR:
            layer = layer.narrowed(needed, NEAR / far)
    return None if layer is s.layer else replace(s, layer=layer)


def _shared(model: Model, finding: Finding, held: HeldOut | None) -> tuple[Model, tuple[str, ...]]:
    """The model without effects that the folds do not share; nothing where held-out readings do not gain."""
    if held is None:
        return model, ()
    refused = {
        c: f"chosen in {held.chosen.get(str(c), 0)} of {held.folds} folds only"
        for c in model.candidates
        if not held.shared(str(c))
    }
    if not refused and not held.pays and held.gain is not None:
        why = f"held-out readings gain {held.gain[0]:.2g} ± {held.gain[1]:.2g} noise variances"
        refused = dict.fromkeys(model.candidates, why)
    for c in refused:
        i = model.candidates.index(c)
        model = fit_without(model, i, finding.search.predictor, finding.search.problem)
    return model, tuple(f"{c}: {why}" for c, why in refused.items())
