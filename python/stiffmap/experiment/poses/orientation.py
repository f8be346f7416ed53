"""Orientations of a plan in base axes, once the machine and its home are known."""

from __future__ import annotations

from dataclasses import replace

from stiffmap.experiment.experiment import Experiment, Floats


def against_base(experiment: Experiment, home: Floats) -> Experiment:
    """The experiment with its orientations as those of the TCP; `home` (3, 3) is that at home."""
    if experiment.rotation is None or experiment.rotation_against == "base":
        return replace(experiment, rotation_against="base")
    second = experiment.other_rotation
    return replace(
        experiment,
        rotation=experiment.rotation @ home,
        other_rotation=None if second is None else second @ home,
        rotation_against="base",
    )
