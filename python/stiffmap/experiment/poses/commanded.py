"""Commanded poses of an experiment on one machine: orientations of the TCP, configurations of commanded joints."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from stiffmap.common.errors import StiffmapError
from stiffmap.experiment.experiment import Experiment, Floats, Mask
from stiffmap.solve.kinematics import Kinematics, forward_kinematics
from stiffmap.solve.machine import Machine

AS_HOME = 1e-9
NAMED = 5
"""Rows that a sentence names."""
OUT_OF_REACH = "out of reach, or units are wrong"


def located(machine: Machine, experiment: Experiment) -> Experiment:
    """The experiment with its orientations in base axes, and with the configurations and poses that its
    commanded coordinates stand for, by the declared machine's kinematics.

    Rows without one are left out and named in `out_of_reach`. Raises StiffmapError where the coordinates
    are not those of the machine's actuators, or no row has a pose.
    """
    if experiment.command is None or experiment.joints is not None:
        return against_base(experiment, machine.description.home.r)
    order = _columns(machine, experiment)
    found = forward_kinematics(machine, experiment.command[:, order])
    names = machine.compiled.names
    index = list(names.joints.values())
    home = np.nanmax(np.abs(found.rotation - machine.description.home.r), initial=0.0) < AS_HOME
    out = replace(
        experiment,
        position=found.position,
        rotation=None if home else found.rotation,
        rotation_against="base",
        joints=found.coordinates[:, index],
        joint_names=tuple(names.joints),
    )
    failed: Mask = np.asarray(~np.isfinite(found.position).all(axis=1))
    if experiment.other_command is not None:
        there = forward_kinematics(machine, experiment.other_command[:, order])
        out = _with_other(out, found, there, index)
        wanted = np.asarray(np.isfinite(experiment.other_command).all(axis=1))
        failed |= wanted & ~np.asarray(np.isfinite(there.position).all(axis=1))
    return without(out, failed, "the machine has no pose at the commanded coordinates of")


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


def _with_other(plan: Experiment, here: Kinematics, there: Kinematics, index: list[int]) -> Experiment:
    turned = plan.rotation is not None or not np.allclose(
        np.nan_to_num(there.rotation), np.nan_to_num(here.rotation[:1]), atol=AS_HOME
    )
    return replace(
        plan,
        other=there.position,
        rotation=here.rotation if turned else None,
        other_rotation=there.rotation if turned else None,
        other_joints=there.coordinates[:, index],
    )


def without(experiment: Experiment, failed: Mask, why: str, cause: str = OUT_OF_REACH) -> Experiment:
    """The experiment without the rows `failed` (n,), which it then names; StiffmapError if none is left."""
    if not failed.any():
        return experiment
    text = rows_in_words(experiment, failed, why, cause)
    if failed.all():
        raise StiffmapError(f"{experiment.name}: {text}")
    return replace(experiment.rows(~failed), out_of_reach=(*experiment.out_of_reach, text))


def rows_in_words(experiment: Experiment, failed: Mask, why: str, cause: str = OUT_OF_REACH) -> str:
    """How many rows `failed` (n,) and why, the names of some, where the first one is, and the cause."""
    at = np.flatnonzero(failed)
    rows = ", ".join(experiment.ids[i] for i in at[:NAMED]) + (" ..." if at.size > NAMED else "")
    where = experiment.position[at[0]]
    if np.isfinite(where).all():
        rows += f"; first at ({', '.join(f'{1e3 * v:.1f}' for v in where)}) mm"
    return f"{why} {at.size} row{'s' if at.size > 1 else ''} (id {rows}): {cause}"


def _columns(machine: Machine, experiment: Experiment) -> list[int]:
    given = [c.joint for c in experiment.command_of]
    if sorted(given) != sorted(machine.actuators):
        raise StiffmapError(
            f"{experiment.name}: command: expected all actuators of {machine.name} "
            f"({', '.join(machine.actuators)}), got {', '.join(given)}"
        )
    return [given.index(a) for a in machine.actuators]
