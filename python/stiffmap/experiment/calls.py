"""Residuals and virtual experiments with experiments, plans and effects as they are named elsewhere."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from os import PathLike

import numpy as np
from scipy.special import chdtrc

from stiffmap.common.broadcasting import given_path, instance_of, random_numbers, real_number
from stiffmap.common.errors import StiffmapError
from stiffmap.experiment.comparison.limitations import limitations, refuse_unreachable
from stiffmap.experiment.comparison.residual import Residual, summary
from stiffmap.experiment.experiment import Experiment, Floats
from stiffmap.experiment.files.load import load_experiment
from stiffmap.experiment.noise.checks import checks
from stiffmap.experiment.noise.nuisance import nuisance_columns
from stiffmap.experiment.noise.outliers import without_suspects
from stiffmap.experiment.noise.over_time import over_time
from stiffmap.experiment.noise.whitening import LinearProblem, nuisance_part
from stiffmap.experiment.prediction.predict import Predictor
from stiffmap.model.description import AppliedEffect
from stiffmap.model.effects import parse_effect
from stiffmap.model.effects.apply import place_of
from stiffmap.model.effects.registry import get
from stiffmap.model.files.load import Source
from stiffmap.solve.machine import Machine, as_machine, takes_machine

Effects = str | AppliedEffect | Sequence[str | AppliedEffect]
UNKNOWN = 1e-4
"""m, rad: standard deviation of an unknown frame, tool point or zero of a simulation."""
EFFECTS = "effects, as text such as 'dead_zone actuator y half_width=10um' or records"
"""One effect or several, each as text (``compliance actuator x scale=1.2``) or as a record."""


def residual(
    machine: Machine | Source,
    experiment: Experiment | str | PathLike[str],
    effects: Effects = (),
    *,
    threads: int | None = None,
) -> Residual:
    """Residual of every reading: what was read minus what the machine, with `effects`, should show.

    machine
        A machine, a shipped name or a machine file.
    experiment
        An experiment, its folder or its YAML file.
    effects
        What the prediction has in addition to the machine, as text or records; effects of the measurement may be among them.
    threads
        None: all cores that this process may use.

    Arrays of the answer are (rows, axes) in m and rad. Raises StiffmapError for unknown points or joints, poses
    out of reach, and an unknown noise.
    """
    m = as_machine(machine)
    e, base = _predicted(m, as_experiment(experiment), effects, threads)
    refuse_unreachable(e, base)
    noise, out = without_suspects(e, base)
    problem = LinearProblem.of(e, noise.sigma, base, ~out)
    values = e.reading - base
    part = nuisance_part(problem, values)
    values -= part
    kept = np.where(out[:, None], np.nan, values)
    white = problem.residual(base)
    late = over_time(problem, white)
    return Residual(
        e,
        base + part,
        values,
        noise,
        out,
        summary(kept, noise.sigma, e.channels),
        float(chdtrc(problem.freedom, float(white @ white))) if problem.freedom > 0 else float("nan"),
        int(problem.nuisance.shape[1]),
        _groups_off(problem, white),
        checks(e, e.reading, noise.sigma, ~out),
        [*limitations(e, noise, m), *([] if late is None else [str(late)])],
    )


@takes_machine
def predict(machine: Machine, experiment: Experiment | str | PathLike[str], terms: Effects = ()) -> Floats:
    """(n, c) m, rad: what the instrument would show of a machine with `terms`, effects as text or records, added.

    Raises StiffmapError for bad input, an unknown point or effect.
    """
    return Predictor(machine, as_experiment(experiment))(effects_of(machine, terms, "terms"))


def _predicted(
    machine: Machine, experiment: Experiment, effects: Effects, threads: int | None
) -> tuple[Experiment, Floats]:
    """Rows in reach, and what they should read; nothing else stays in memory."""
    predictor = Predictor(machine, experiment, threads=threads)
    return predictor.experiment, predictor(effects_of(machine, effects))


def _groups_off(problem: LinearProblem, white: Floats) -> int:
    total, number = np.bincount(problem.groups, white**2), np.bincount(problem.groups)
    p = chdtrc(number[number > 0], total[number > 0])
    return int((p < 1e-3 / max(len(p), 1)).sum())


def simulate(
    machine: Machine | Source,
    plan: Experiment | str | PathLike[str],
    effects: Effects = (),
    *,
    seed: int = 0,
    outlier_share: float = 0.0,
) -> Experiment:
    """The plan's readings on a machine that has `effects`, with noise of the declared size.

    Zeros that readings share, and the frames and zeros that the plan calls unknown, are drawn too.

    machine
        A machine, a shipped name or a machine file.
    plan
        An experiment whose readings are not used, its folder or its YAML file.
    effects
        What the simulated machine has, as text (``dead_zone actuator y half_width=12um``) or records.
    seed
        Of the noise.
    outlier_share
        Share of rows that are off by 5 to 20 standard deviations.

    Readings of the answer are (rows, axes) in m and rad. Raises StiffmapError where no noise is declared or the machine
    cannot be solved.
    """
    m, plan = as_machine(machine), as_experiment(plan)
    if np.isnan(plan.sigma[plan.read]).any():
        raise StiffmapError(f"{plan.name}: a virtual experiment needs a declared noise for every axis read")
    predictor = Predictor(m, plan)
    exact = predictor(effects_of(m, effects))
    plan = predictor.experiment
    refuse_unreachable(plan, exact)
    rng = random_numbers(seed)
    if not 0 <= real_number(outlier_share, "outlier_share", "a share") <= 1:
        raise StiffmapError(f"outlier_share: expected a share from 0 to 1, got {outlier_share}")
    reading = exact + np.nan_to_num(plan.sigma) * rng.standard_normal(exact.shape)
    zeros = rng.standard_normal((int(plan.groups.max()) + 1, len(plan.channels))) * plan.zeros
    unknown = nuisance_columns(plan, predictor())
    unknown = unknown @ (UNKNOWN * rng.standard_normal(unknown.shape[-1]))
    reading = reading + zeros[plan.groups] + unknown
    wild = rng.random(len(plan)) < outlier_share
    size = rng.uniform(5, 20, (int(wild.sum()), 1)) * plan.sigma[wild]
    reading[wild] += rng.choice([-1, 1], (int(wild.sum()), exact.shape[1])) * size
    return replace(plan, reading=np.where(plan.read, reading, np.nan), joints=None, other_joints=None)


def as_experiment(given: Experiment | str | PathLike[str]) -> Experiment:
    """The experiment itself, or that of a folder or file."""
    if isinstance(given, Experiment):
        return given
    given_path(given, "experiment", "an Experiment, or its folder")
    return load_experiment(given)


def effects_of(machine: Machine, given: Effects, name: str = "effects") -> list[AppliedEffect]:
    """Records of effects; texts are read with the machine's own names of element and legs filled in."""
    several = (
        [given]
        if isinstance(given, str | AppliedEffect)
        else list(instance_of(given, Sequence, name, EFFECTS))
    )
    for one in several:
        instance_of(one, (str, AppliedEffect), name, EFFECTS)
    return [placed(machine, one) if isinstance(one, str) else one for one in several]


def placed(machine: Machine, given: str | AppliedEffect) -> AppliedEffect:
    """One effect, text or record, with the machine's own names of element and legs filled in; one of the measurement too."""
    d = machine.description
    term = parse_effect(given, d) if isinstance(given, str) else given
    effect = get(term.kind)
    if effect.measurement:
        element, legs = place_of(effect, d, term.element or None, term.legs or None)
        return AppliedEffect(term.kind, element, legs, term.parameters, term.options)
    more = {**dict(term.parameters), **dict(term.options)}
    added = machine.with_effect(term.kind, element=term.element or None, legs=term.legs or None, **more)
    return added.description.effects[-1]
