"""Residuals and virtual experiments with experiments, plans and effects as they are named elsewhere."""

from __future__ import annotations

from collections.abc import Sequence
from os import PathLike

from stiffmap.common.broadcasting import given_path, instance_of
from stiffmap.experiment.comparison import residual as comparison
from stiffmap.experiment.comparison.residual import Residual
from stiffmap.experiment.experiment import Experiment
from stiffmap.experiment.files.load import load_experiment
from stiffmap.experiment.virtual import simulate as virtual
from stiffmap.model.description import AppliedEffect
from stiffmap.model.effects import parse_effect
from stiffmap.model.effects.check import place_of
from stiffmap.model.effects.registry import get
from stiffmap.model.files.load import Source
from stiffmap.solve.machine import Machine, as_machine

Effects = str | AppliedEffect | Sequence[str | AppliedEffect]
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
    return comparison.residual(m, as_experiment(experiment), effects_of(m, effects), threads=threads)


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
    m = as_machine(machine)
    return virtual.simulate(m, as_experiment(plan), effects_of(m, effects), seed=seed, outliers=outlier_share)


def as_experiment(given: Experiment | str | PathLike[str]) -> Experiment:
    """The experiment itself, or that of a folder or file."""
    if isinstance(given, Experiment):
        return given
    given_path(given, "experiment", "an Experiment, or its folder")
    return load_experiment(given)


def effects_of(machine: Machine, given: Effects) -> list[AppliedEffect]:
    """Records of effects; texts are read with the machine's own names of element and legs filled in."""
    several = (
        [given]
        if isinstance(given, str | AppliedEffect)
        else list(instance_of(given, Sequence, "effects", EFFECTS))
    )
    for one in several:
        instance_of(one, (str, AppliedEffect), "effects", EFFECTS)
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
