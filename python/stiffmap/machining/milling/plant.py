"""The machine under a force at its tool: batches of poses, drives with play or friction on the side of their travel."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from stiffmap.common.broadcasting import Floats
from stiffmap.experiment.prediction.unloaded_state import STILL, TRAVEL, lagging, lags
from stiffmap.machining.milling.setting import Setting
from stiffmap.solve.kinematics import inverse_kinematics, missed
from stiffmap.solve.machine import Machine
from stiffmap.solve.status import Status


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

    def __init__(self, job: Setting, machine: Machine | None = None, threads: int | None = None) -> None:
        """`machine`: None, or another than the job's, that follows its commands."""
        self.job, self.machine, self.threads = job, machine or job.machine, threads
        self.heavy = bool(np.any(self.machine.compiled.gravity(None)))

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
            s = machine.solve(
                np.nan_to_num(command[here], nan=1e3),
                np.nan_to_num(wrench[here]),
                rotation=self._turns(mine[here]),
                stiffness=full,
                threads=self.threads,
            )
            ok = s.ok & np.isfinite(command[here]).all(axis=1)
            # along what the machine does not command the tool stays where it was
            stays = missed(machine, np.nan_to_num(command[here], nan=1e3), self._turns(mine[here]))[:, :3]
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

    def _turns(self, rows: NDArray[np.int64]) -> Floats:
        """One orientation where all are the same: the kernels need not check each."""
        r = self.job.rotation
        return r[0] if r.strides[0] == 0 else r[rows]
