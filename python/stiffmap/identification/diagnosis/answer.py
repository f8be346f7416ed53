"""From what the inference found to a diagnosis: machines, effects with intervals, numbers, what is left, before and after."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from stiffmap.common.errors import StiffmapError
from stiffmap.experiment.comparison.limitations import limitations
from stiffmap.experiment.experiment import Experiment, Floats
from stiffmap.experiment.noise.checks import checks
from stiffmap.experiment.noise.nuisance import nuisance_columns
from stiffmap.experiment.prediction.predict import Predictor
from stiffmap.identification.calibration.calibrate import table_of
from stiffmap.identification.clock import Clock
from stiffmap.identification.diagnosis.report.findings import (
    Effect,
    FoundNumbers,
    NoiseReport,
    Rest,
    detectable,
    effects_of,
)
from stiffmap.identification.diagnosis.report.result import Diagnosis
from stiffmap.identification.diagnosis.report.separation import separation
from stiffmap.identification.inference.amplitudes import Fit
from stiffmap.identification.inference.chosen import Chosen, Term
from stiffmap.identification.inference.columns import Columns
from stiffmap.identification.inference.constants import ODDS, RARE
from stiffmap.identification.inference.corrected import Corrected, along_travel, corrected, instead
from stiffmap.identification.inference.machines import (
    CALIBRATED,
    CORRECTED,
    DECLARED,
    Written,
    lack_of_fit,
    vouched,
    written,
)
from stiffmap.identification.inference.names import Inferred, put_instead, with_travel
from stiffmap.identification.inference.parts import GAPS, NOISE
from stiffmap.identification.inference.readings import Readings, readings
from stiffmap.identification.inference.shares import from_row_to_row, gap_of, shares, tolerance_word, too_wide
from stiffmap.identification.inference.verdict import NOISIER, Named, Verdict, judged, not_as_stated

UNFITTED = "more than noise stays at the best fit"
RIVALS = 3
"""Places in an effect's stead that are fitted; all are named."""


def answer(predictor: Predictor, found: Inferred, clock: Clock, seed: int, cross_validate: bool) -> Diagnosis:
    """The diagnosis of an experiment."""
    e, columns, sigma = predictor.experiment, found.columns, found.noise.sigma
    clock.say("corrected machine")
    models, found, v, notes = _models(predictor, found)
    fit = found.search.best.fit
    best = models.get(CORRECTED)
    if best and (more := with_travel(fit, anew=False)) is not fit:
        models[CORRECTED] = along_travel(best, _given(predictor, found, v, more))
    clock.say("readings that no fit saw")
    plain = bool(models or v.rest)
    made = written(models, predictor, found, seed, lambda: clock.over or not cross_validate, plain=plain)
    held, late, listed = made.held_out, made.over_time, made.listed
    noise = _noise(found, made, best, v.noise)
    each, gap = shares(columns, fit), gap_of(columns, fit)
    if not (v.rest or v.time) and noise.lack_of_fit_after < RARE:
        v, gap = replace(v, rest=v.gone[-1][0].part.name if v.gone else UNFITTED), made.left[1]
    effects = _effects(v, best, each, fit)
    # where nothing is named, the numbers alone are corrected
    which = made.which if made.which == DECLARED or (effects and made.which == CORRECTED) else CALIBRATED
    others = list(_alternatives(found, v, best, clock)) if best and effects else []
    several = bool(others or clock.left_out or any(n.numbers or n.equivalents[RIVALS:] for n in v.named))
    rest, numbers = _rest(columns, fit, v, each, gap), _numbers(found, v, best or models.get(CORRECTED))
    cut_short = clock.stopped and noise.lack_of_fit_before < RARE
    return Diagnosis(
        verdict=_word(v, effects, rest, several, cut_short or (numbers is not None and bool(numbers.wide))),
        effects=effects,
        alternatives=[effects_ for effects_, _ in others],
        separations=[
            separation(predictor, found.noise.floor, best.effects if best else (), other.effects, seed)
            for _, other in others
        ],
        before=held.before if held else made.sizes[0],
        after=held.after if held else made.sizes[1],
        held_out=held,
        noise=noise,
        detectable=detectable(columns, fit),
        unobservable=_unobservable(found),
        outliers=[e.ids[i] for i in np.flatnonzero(listed)],
        checks_before=checks(e, e.reading, sigma, ~listed),
        checks_after=checks(e, made.difference, sigma, ~listed),
        unexplained=rest,
        limitations=[
            *_first(fit, v, bool((found.noise.declared >= found.noise.floor).any())),
            *notes,
            *(_or_numbers(n) for n in v.named if n.numbers or n.against_numbers < np.log(ODDS)),
            *limitations(e, found.noise, predictor.machine),
            *([] if late is None else [str(late)]),
        ],
        shares=each,
        machine=vouched(predictor, made, _said(which, effects, e)),
        declared=predictor.machine,
        experiment=e,
        residual_before=made.left[0],
        residual_after=made.left[1],
        set_aside=listed,
        gap=gap,
        calibration=numbers,
        refused=[*dict.fromkeys(f"{c.place.candidate}: {why}" for c, why in (*v.refused, *v.gone))],
        which=which,
        stopped=clock.stopped or bool(clock.left_out),
        not_tried=[*dict.fromkeys(clock.left_out)],
        seed=seed,
    )


def _change(predictor: Predictor, c: Chosen) -> Floats:
    """(n, c) m, rad: what an effect adds to the readings; nothing where the machine cannot have it."""
    try:
        return predictor([c.term]) - predictor()
    except StiffmapError:
        return np.zeros_like(predictor.experiment.reading)


def _given(predictor: Predictor, found: Inferred, v: Verdict, fit: Fit) -> Readings:
    """The readings under the amplitudes of a fit, with what a verdict refuses to name."""
    nameless = [_change(predictor, c) for c, _ in v.refused]
    return readings(predictor, found, fit, nameless, v.as_effects)


def _models(
    predictor: Predictor, found: Inferred
) -> tuple[dict[str, Corrected], Inferred, Verdict, list[str]]:
    """The machines that may be handed over besides the declared one, by name, the corrected one last; what was found, and the verdict,
    less effects that are nothing at the optimum; and what must be said."""
    out: dict[str, Corrected] = {}
    v, plain = judged(found.columns, found.search), found.search.calibrated
    if v.named and plain is not None:
        plain = with_travel(plain, anew=True)  # as a calibration has it
        own = readings(predictor, found, plain)
        if len(own.spread):
            out[CALIBRATED] = corrected(own, ())
    while True:
        given = _given(predictor, found, v, found.search.best.fit)
        if not v.named and not len(given.spread):
            break
        chosen = [n.chosen for n in v.named]
        starts = [Term.of(c.place.candidate, c.term) for c in chosen]
        try:
            best = corrected(given, starts)
        except StiffmapError as problem:
            if not chosen:
                return out, found, v, [f"the numbers have no corrected machine: {problem}"]
            # of effects that no machine has together, that which shows least
            k = int(np.argmin([np.linalg.norm(np.nan_to_num(_change(predictor, c))) for c in chosen]))
            why, heirs = str(problem), v.named[k].equivalents[:1]
        else:
            if best.refused is None:
                out[CORRECTED] = best
                break
            k, why = best.refused
            heirs = v.named[k].equivalents[: int(best.terms[k].undetermined.any())]
        found = replace(found, search=found.search.less(chosen[k], *heirs))
        v = judged(found.columns, found.search, (*v.gone, (chosen[k], why)))
    return out, found, v, []


def _effects(v: Verdict, best: Corrected | None, each: dict[str, float], fit: Fit) -> list[Effect]:
    if best is None or not v.named:
        return []
    total = float(np.sum(fit.columns.residual**2))
    evidence = [
        {
            "ln_odds": n.log_odds,
            "share": each.get(n.chosen.part.name) or n.share**2 * len(fit.columns) / total,
            "same_everywhere": 1.0 - n.scatter,
        }
        for n in v.named
    ]
    return effects_of(best, [n.chosen.place for n in v.named], evidence)


def _alternatives(
    found: Inferred, v: Verdict, best: Corrected, clock: Clock
) -> Iterator[tuple[list[Effect], Corrected]]:
    """Each other place of each effect, all else refitted; those that are likeliest first, at most `RIVALS` of an effect."""
    named = [n.chosen.place for n in v.named]
    for k, n in enumerate(v.named):
        for place in n.equivalents[:RIVALS]:
            if clock.over:
                clock.left_out.append("other places of the effects, fitted")
                return
            other = put_instead(found.search.best.fit, n.chosen, place)
            start = Term.of(place.candidate, other.term)
            try:
                fitted = instead(best, [*best.terms[:k], start, *best.terms[k + 1 :]])
            except StiffmapError:
                continue
            places = [*named[:k], place, *named[k + 1 :]]
            if not fitted.terms[k].undetermined.any():
                yield effects_of(fitted, places, [{} for _ in places]), fitted


def _word(v: Verdict, effects: Sequence[Effect], rest: Sequence[Rest], several: bool, off: bool) -> str:
    """`several`: whether something would do in an effect's stead. `off`: whether the machine is not as declared even where nothing is
    left: its numbers are off as a group, or the search could not come to an end though the readings are no noise."""
    if effects and several and v.word == "ambiguous":
        return "ambiguous"
    if effects or v.beyond:
        return "effects+unattributed" if rest else "effects"
    return "unattributed" if rest or off else "none"


def _noise(found: Inferred, made: Written, best: Corrected | None, scale: float) -> NoiseReport:
    n, e = found.noise, found.columns.experiment
    frames = nuisance_columns(e, found.plan.base).shape[-1]
    values = 0 if best is None else sum(len(t.values) for t in best.terms)
    heavy = found.search.best.fit.heavy

    floor, repeats, declared, consistency = (
        {c.name: float(v) for c, v, read in zip(e.channels, each, e.axis_read, strict=True) if read}
        for each in (n.floor, n.repeats, n.declared, n.consistency)
    )
    before, after = (
        lack_of_fit((left / (scale * n.sigma))[~made.listed], heavy, frames + k, len(found.columns))
        for left, k in zip(made.left, (0, values), strict=True)
    )
    return NoiseReport(floor, repeats, declared, consistency, before, after, n.rms, scale)


def _rest(columns: Columns, fit: Fit, v: Verdict, each: dict[str, float], gap: Floats) -> list[Rest]:
    """What is left that has no name, and where what nobody can name, `gap` (n, c), is largest."""
    if not v.rest:
        return []
    e = columns.experiment
    gap = np.abs(np.nan_to_num(gap))
    if v.rest == NOISIER:  # with all that is not demanded beside it
        scatter = [NOISE, *(p.name for p in fit.parts if p.kind in (*GAPS, "time"))]
        return [Rest(v.rest, sum(each.get(name, 0.0) for name in scatter))]
    reasons = {c.part.name: f"{c.part.name}: {why}" for c, why in (*v.refused, *v.gone)}
    what = reasons.get(v.rest, v.rest)
    share = sum(each.get(p.name, 0.0) for p in fit.parts if p.kind in GAPS or p.name == v.rest)
    noise = np.full(gap.shape, np.inf)
    noise[columns.rows, columns.channel] = columns.sigma
    in_noise = gap / noise
    if not in_noise.any():
        return [Rest(what, share)]
    if share == 0.0:  # no part of the model: what stays at the fit
        share = min(1.0, float(np.sum(in_noise**2) / np.sum(columns.residual**2)))
    pose = e.groups
    each_pose = np.stack([np.bincount(pose, one**2) for one in in_noise.T]) / np.bincount(pose)
    axis, k = np.unravel_index(int(np.argmax(each_pose)), each_pose.shape)
    x, y, z = (float(c) for c in e.position[pose == k][0])
    size = float(np.sqrt(np.mean(gap[pose == k][:, axis] ** 2)))
    return [Rest(what, share, e.channels[int(axis)].name, (x, y, z), size)]


def _first(fit: Fit, v: Verdict, stated: bool) -> list[str]:
    """What must be known of the noise, and of the order of the readings, before anything else."""
    out = not_as_stated(v.noise, "is stated" if stated else "repeats or steps show")
    if fit.heavy:
        out.append("some readings lie far from the others and count less")
    if v.time:
        out.append(f"the noise of a reading carries over to the following ones ({v.time})")
    if v.rest and from_row_to_row(fit):
        out.append(
            "what is left goes on from row to row: if rows stand in the order in which they were read, add a column `order` "
            "and diagnose again"
        )
    return out


def _or_numbers(n: Named) -> str:
    place = n.chosen.place.candidate
    if names := " or ".join(b.unknown.name for b in n.numbers[:RIVALS]):
        return f"instead of {place} these declared numbers may be out of tolerance: {names}"
    return (
        f"instead of {place} declared numbers within their tolerances may show the same: it is "
        f"{np.exp(n.against_numbers):.2g} times as likely as they are"
    )


def _numbers(found: Inferred, v: Verdict, best: Corrected | None) -> FoundNumbers | None:
    if best is None or not len(best.numbers):
        return None
    fit, known = found.search.best.fit, {u.name for u in best.given.sensitivity.unknowns}
    table = tuple(n for n in table_of(found.columns, fit, best)[0] if n.name in known)
    off, wide = {b.unknown.name for b in v.beyond}, too_wide(fit, v.out_of_tolerance)
    beyond = tuple(sorted((n for n in table if n.name in off), key=lambda n: -n.share))
    return FoundNumbers(tolerance_word(", ".join(n.name for n in beyond), wide), wide, beyond, table)


def _unobservable(found: Inferred) -> list[str]:
    seen = {id(c) for p in found.columns.places for c in (p.candidate, *p.aliases)}
    all_ = {id(v.candidate): v.candidate for v in found.plan.variants}
    failed = [f"{c} ({why})" for c, why in found.plan.failed]
    return [str(c) for k, c in all_.items() if k not in seen] + failed


def _said(which: str, effects: Sequence[Effect], e: Experiment) -> str:
    """What the file of the machine says that it has."""
    if which == CORRECTED:
        names = "; ".join(f"{x.kind} of {x.element} {' '.join(x.legs)}".strip() for x in effects)
        return f"Effects added by a diagnosis: {names}, from experiment {e.name}."
    return f"Numbers calibrated by experiment {e.name}."
