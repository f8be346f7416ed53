"""The machine under a force at its tool, drives with play or friction on the side of their travel; deflection and cutting force
together, each what the other makes it, and commands that undo the deflection (theory.md, M9)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from stiffmap.common.broadcasting import Floats
from stiffmap.experiment.prediction.joints import STILL, TRAVEL, lagging, lags
from stiffmap.machining.milling.setting import Setting
from stiffmap.solve.kinematics import inverse_kinematics, missed
from stiffmap.solve.machine import Machine
from stiffmap.solve.status import Flag, Status


@dataclass(frozen=True, eq=False)
class Stand:
    """Where the tool stands, m points."""

    moved: Floats
    """(m, 3) m from the commanded position; NaN where there is no equilibrium."""
    compliance: Floats
    """(m, 3, 3) m/N; NaN where not asked for."""
    status: NDArray[np.uint8]
    flags: NDArray[np.uint32]
    effort: Floats
    """(m, actuators) N, N·m; NaN where not asked for."""
    turned: Floats
    """(m, 3) rad, rotation vector of the tool's holder from the commanded orientation; NaN where not asked for."""


class Plant:
    """A machine that runs along the points of a job, its own rigidity aside what the tool bends by."""

    def __init__(self, job: Setting, machine: Machine | None = None) -> None:
        """`machine`: None, or another than the job's, that follows its commands."""
        self.job, self.machine = job, machine or job.machine

    @cached_property
    def groups(self) -> list[tuple[Machine, NDArray[np.int64]]]:
        """Machines by the side from which their drives come, and the points of each."""
        everyone = np.arange(len(self.job))
        if not lags(self.machine.description):
            return [(self.machine, everyone)]
        job = self.job
        here = inverse_kinematics(job.machine, job.position, job.rotation).actuators
        before = inverse_kinematics(job.machine, job.position - TRAVEL * job.tangent, job.rotation).actuators
        moved = np.nan_to_num(here - before)
        top = np.abs(moved).max(axis=1, keepdims=True)
        sign = np.where(np.abs(moved) > STILL * np.where(top > 0, top, 1.0), np.sign(moved), 0.0)
        # friction of a drive that travels stays behind; its play is closed by the load
        return [
            (lagging(self.machine, s, True), np.flatnonzero((sign == s).all(axis=1)))
            for s in np.unique(sign, axis=0)
        ]

    def stand(
        self, command: Floats, force: Floats, full: bool = False, rows: NDArray[np.int64] | None = None
    ) -> Stand:
        """Equilibrium at commanded positions (m, 3) m under forces (m, 3) N at the tip; `full`: compliance and efforts too.

        rows: the points of the job that these are; None: all.
        """
        mine = np.arange(len(self.job)) if rows is None else rows
        n, a = len(mine), len(self.machine.actuators)
        moved, c = np.full((n, 3), np.nan), np.full((n, 3, 3), np.nan)
        status, flags = np.full(n, Status.NOT_CONVERGED, np.uint8), np.zeros(n, np.uint32)
        effort, turned = np.full((n, a), np.nan), np.full((n, 3), np.nan)
        wrench = np.hstack([force, np.zeros_like(force)])
        for machine, members in self.groups:
            here = np.flatnonzero(np.isin(mine, members)) if len(self.groups) > 1 else np.arange(n)
            if not here.size:
                continue
            u, load, turns = np.nan_to_num(command[here], nan=1e3), wrench[here], self.job.turns(mine[here])
            s = machine.solve(
                u, np.nan_to_num(load), rotation=turns, stiffness=full, threads=self.job.threads
            )
            ok = s.ok & np.isfinite(command[here]).all(axis=1)
            # along what the machine does not command the tool stays where it was
            stays = missed(machine, u, turns)[:, :3]
            moved[here] = np.where(ok[:, None], s.displacement[:, :3] + stays, np.nan)
            status[here], flags[here] = s.status, s.flags
            if full:
                turned[here] = s.displacement[:, 3:]
                c[here], effort[here] = s.compliance[:, :3, :3], s.actuator_effort
        bending = self.job.process.tool.compliance
        if bending:
            tool = self.job.tool[mine]
            across = np.eye(3) - tool[:, :, None] * tool[:, None, :]
            moved += bending * np.einsum("mij,mj->mi", across, force)
            c += bending * across
        return Stand(moved, c, status, flags, effort, turned)


STEPS, INNER, INVERSE = 30, 40, 40
"""Most solves of the machine, of the cut between two of them, and for a command."""
DONE = 1e-11
"""m: change of the tool's position below which an equilibrium stands, and distance from the path below which a command does."""
RANGES = int(Flag.JOINT_LIMIT | Flag.DRIVE_RANGE)
LONGEST = 0.05
"""m: no deflection of interest is longer."""


@dataclass(frozen=True, eq=False)
class Equilibrium(Stand):
    """m points under the force of the cut; NaN where there is no equilibrium."""

    error: Floats
    """(m, 3) m, the tool's tip from where it is wanted, base axes."""
    force: Floats
    """(m, 3) N, that the cut makes there."""
    gain: Floats
    """(m,) loop gain kp/k: largest real part of the eigenvalues of -C dF/de; below -1 the cut runs away."""
    steps: int
    """Solves of the machine."""


def equilibrium(plant: Plant, command: Floats) -> Equilibrium:
    """Where the tool stands at commanded positions (m, 3) m, base axes, under the force that the cut makes there.

    Newton: the machine is solved at a force, the cut and the machine's tangent are solved together, until the
    tool stands still. UNSTABLE where the force grows faster than the machine resists (det of I - C dF/de not positive).
    """
    job = plant.job
    away = np.zeros((len(job), 2))
    force = job.force(away)
    error = np.full((len(job), 3), np.nan)
    steps, s = 0, None
    while steps < STEPS:
        steps += 1
        s = plant.stand(command, force, full=True)
        error = command + s.moved - job.position
        away = _together(job, error, s.compliance, force, away)
        new = job.force(away)
        # how far the tool goes on under the force of where it now stands
        onward = np.einsum("mij,mj->mi", np.nan_to_num(s.compliance), new - force)
        if not np.nan_to_num(np.abs(onward)).max(initial=0.0) > DONE:
            break
        force = new
    assert s is not None
    slopes = job.force_slopes(np.einsum("mki,mi->mk", job.ways, np.nan_to_num(error)))
    # (m, 2, 2): what the cut's answer to a small push pushes further
    loop = -np.einsum("mki,mij,mjl->mkl", job.ways, np.nan_to_num(s.compliance), slopes)
    status = s.status.copy()
    unstable = (np.linalg.det(np.eye(2) + loop) <= 0) & (status == Status.CONVERGED)
    status[unstable] = Status.UNSTABLE
    lost = unstable | ~np.isfinite(error).all(axis=1)
    status[lost & (status == Status.CONVERGED)] = Status.NOT_CONVERGED
    values = np.linalg.eigvals(loop)
    strongest = np.abs(values).argmax(axis=1)[:, None]
    gain = np.take_along_axis(values, strongest, axis=1)[:, 0].real
    blank = np.where(lost[:, None], np.nan, 1.0)
    stand = vars(s) | {"status": status, "effort": s.effort * blank, "turned": s.turned * blank}
    gain = np.where(np.isfinite(error).all(axis=1), gain, np.nan)
    return Equilibrium(**stand, error=error * blank, force=force * blank, gain=gain, steps=steps)


def commanded(plant: Plant, before: Equilibrium) -> tuple[Floats, Floats, Floats]:
    """Commands (m, 3) m, base axes, at which the loaded machine stands on the path, NaN where it has no answer; (m,) m by which it is
    still off there; and the mirrored commands (m, 3) m, the wanted position less the error.

    Inverse of the loaded machine: on the path the cut is the wanted one, so that its force is known there.
    """
    job = plant.job
    force = job.force(np.zeros((len(job), 2)))
    steered = np.isin(["x", "y", "z"], job.machine.description.task)
    # the machine's tangent tells where the tool would stand under the wanted cut
    further = np.einsum("mij,mj->mi", before.compliance, force - before.force)
    u = job.position - steered * (np.nan_to_num(before.error) + np.nan_to_num(further))
    rest = np.full((len(job), 3), np.nan)
    active = np.arange(len(job))
    for _ in range(INVERSE):
        s = plant.stand(u[active], force[active], rows=active)
        rest[active] = u[active] + s.moved - job.position[active]
        active = active[np.abs(steered * rest[active]).max(axis=1) > DONE]  # a lost point compares false
        u[active] -= steered * rest[active]
        if not active.size:
            break
    u[~np.isfinite(rest).all(axis=1)] = np.nan
    return u, np.linalg.norm(rest, axis=1), job.position - steered * before.error


def wall_errors(job: Setting) -> Floats:
    """(m,) m across the wall as the cut is, before compensation; infinite where a point has no answer or leaves a range of the drives."""
    e = equilibrium(Plant(job), job.position)
    good = np.isfinite(e.error).all(axis=1) & (e.flags & RANGES == 0)
    return np.where(good, np.nan_to_num(job.across(e.error)), np.inf)


def _together(job: Setting, error: Floats, compliance: Floats, force: Floats, away: Floats) -> Floats:
    """(m, 2) m: the cut and the linear machine about the state (error, force) solved together."""
    if not any(job.coupled):
        return away
    soft = np.nan_to_num(np.einsum("mki,mij->mkj", job.ways, compliance))
    base = np.nan_to_num(np.einsum("mki,mi->mk", job.ways, error))
    x = base.copy()
    for _ in range(INNER):
        rest = x - base - np.einsum("mkj,mj->mk", soft, job.force(x) - force)
        slope = np.eye(2) - np.einsum("mkj,mjl->mkl", soft, job.force_slopes(x))
        (a, b, c, d), (u, v) = slope.reshape(-1, 4).T, rest.T
        det = a * d - b * c
        det = np.where(np.abs(det) > 1e-6, det, np.inf)
        move = np.stack([d * u - b * v, a * v - c * u], axis=1) / det[:, None]
        # the force has a root of the width in it where the cut ends: no step across more than half of what is left
        room = np.maximum(job.engaged.radial - x[:, 0], 0.0) / 2
        size = np.abs(move[:, 0])
        near = (room > 0) & (size > room) & (move[:, 0] < 0)
        move[:, 0] = np.where(near, -room, move[:, 0])
        x = np.clip(x - move, -LONGEST, LONGEST)
        if not np.abs(move).max(initial=0.0) > DONE / 10:
            break
    return np.asarray(x)
