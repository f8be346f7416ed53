"""Commanded poses of an experiment on one machine: orientations of the TCP, and poses of commanded joints."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from stiffmap.errors import StiffmapError
from stiffmap.experiment.experiment import Experiment, Floats, Mask
from stiffmap.experiment.orientation import against_base
from stiffmap.kinematics import forward_kinematics, inverse_kinematics
from stiffmap.machine import Machine

AS_HOME = 1e-9
SAME_COMMAND = 1e-6
"""m, rad: commanded coordinates that the pose leads back to."""


def located(machine: Machine, experiment: Experiment) -> Experiment:
    """The experiment with its orientations in base axes, and with the poses that its commanded
    coordinates stand for, by the declared machine's kinematics.

    Raises StiffmapError where the coordinates are not those of the machine's actuators, and names the
    rows that no pose belongs to, or whose pose the machine reaches from home in another branch.
    """
    if experiment.command is None:
        return against_base(experiment, machine.description.home.r)
    actuators = experiment.command[:, _columns(machine, experiment)]
    found = forward_kinematics(machine, actuators)
    lost: Mask = np.asarray(~np.isfinite(found.position).all(axis=1))
    _refuse(experiment, lost, "the machine has no pose at", "out of reach, or units are wrong")
    back = inverse_kinematics(machine, found.position, found.rotation).actuators
    _refuse(
        experiment,
        _differ(machine, actuators, back),
        "the machine reaches from home in another branch the pose of",
        "such rows cannot be predicted at these coordinates; give the machine a home in their branch, "
        "or leave them out",
    )
    home = np.abs(found.rotation - machine.description.home.r).max() < AS_HOME
    rotation = None if home else found.rotation
    return replace(experiment, position=found.position, rotation=rotation, rotation_against="base")


def _differ(machine: Machine, commanded: Floats, back: Floats) -> Mask:
    """(n,) rows whose pose leads back to other coordinates; a full turn of a joint is the same place."""
    turns = np.array([not machine.compiled.names.is_prismatic(a) for a in machine.actuators])
    gap = back - commanded
    gap = np.where(turns, (gap + np.pi) % (2 * np.pi) - np.pi, gap)
    return np.asarray(~(np.abs(gap).max(axis=1) < SAME_COMMAND))


def _refuse(experiment: Experiment, wrong: Mask, what: str, why: str) -> None:
    rows = np.flatnonzero(wrong)
    if rows.size:
        names = ", ".join(experiment.ids[i] for i in rows[:5]) + (" ..." if rows.size > 5 else "")
        plural = "s" if rows.size > 1 else ""
        raise StiffmapError(
            f"{experiment.name}: {what} the commanded coordinates of {rows.size} row{plural} (id {names}): {why}"
        )


def _columns(machine: Machine, experiment: Experiment) -> list[int]:
    given = [c.joint for c in experiment.command_of]
    if sorted(given) != sorted(machine.actuators):
        raise StiffmapError(
            f"{experiment.name}: command: expected all actuators of {machine.name} "
            f"({', '.join(machine.actuators)}), got {', '.join(given)}"
        )
    return [given.index(a) for a in machine.actuators]
