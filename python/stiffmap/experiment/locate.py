"""Commanded actuator coordinates to commanded poses, by the declared machine's kinematics."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from stiffmap.errors import StiffmapError
from stiffmap.experiment.experiment import Experiment
from stiffmap.kinematics import forward_kinematics
from stiffmap.machine import Machine

AS_HOME = 1e-9


def located(machine: Machine, experiment: Experiment) -> Experiment:
    """The experiment with the poses that its commanded coordinates stand for.

    Raises StiffmapError where the coordinates are not those of the machine's actuators, and names the
    rows that no pose belongs to.
    """
    if experiment.command is None:
        return experiment
    order = _columns(machine, experiment)
    found = forward_kinematics(machine, experiment.command[:, order])
    failed = np.flatnonzero(~np.isfinite(found.position).all(axis=1))
    if failed.size:
        rows = ", ".join(experiment.ids[i] for i in failed[:5])
        raise StiffmapError(
            f"{experiment.name}: the machine has no pose at the commanded coordinates of {failed.size} "
            f"rows (id {rows}{' ...' if failed.size > 5 else ''}): out of reach, or units are wrong"
        )
    home = np.abs(found.rotation - machine.description.home.r).max() < AS_HOME
    return replace(experiment, position=found.position, rotation=None if home else found.rotation)


def _columns(machine: Machine, experiment: Experiment) -> list[int]:
    given = [c.joint for c in experiment.command_of]
    if sorted(given) != sorted(machine.actuators):
        raise StiffmapError(
            f"{experiment.name}: command: expected all actuators of {machine.name} "
            f"({', '.join(machine.actuators)}), got {', '.join(given)}"
        )
    return [given.index(a) for a in machine.actuators]
