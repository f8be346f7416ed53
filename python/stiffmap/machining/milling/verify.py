"""A program run on a machine: where the tool then is, against the path that was wanted."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from stiffmap.common.broadcasting import Floats
from stiffmap.machining.milling.equilibrium import Equilibrium, equilibrium
from stiffmap.machining.milling.plant import Plant
from stiffmap.machining.milling.program import Program
from stiffmap.machining.milling.setting import Setting, setting
from stiffmap.machining.toolpath import Points, Toolpath
from stiffmap.machining.toolpath.path import Kind
from stiffmap.machining.toolpath.sampling import sampled
from stiffmap.solve.machine import Machine

ROUNDS = 3


@dataclass(frozen=True, eq=False)
class Run:
    """k points of a program, base axes."""

    job: Setting
    """Points of the wanted path that belong to those of the program."""
    state: Equilibrium
    normal: Floats
    """(k,) m: error across the wall, positive where material stays."""
    way: Floats
    """(k,) m along the wanted path."""


def run(
    job: Setting,
    made: Program,
    machine: Machine | None = None,
    *,
    step: float = 2e-3,
    threads: int | None = None,
) -> Run:
    """Simulate a program on the job's machine or on another one, the force re-evaluated at the true distance from the wall."""
    p = made.path
    own = sampled(p, step)
    u = job.place.points(own.position)
    wanted = made.origin[own.move].astype(np.int64)
    cutting = job.path.cuts[wanted]
    own_rows = np.flatnonzero(cutting)
    u, wanted, feed, spindle = u[own_rows], wanted[own_rows], own.feed[own_rows], own.spindle[own_rows]
    at = job.place.back(u)
    start = np.r_[0.0, np.cumsum(np.where(job.path.cuts, job.path.length, 0.0))][:-1]
    for _ in range(ROUNDS):
        share = nearest(job.path, wanted, at)
        position, tangent, bend = job.path.at(wanted, share)
        way = start[wanted] + share * job.path.length[wanted]
        points = Points(wanted, share, position, tangent, job.path.tool[wanted], bend, way, feed, spindle)
        here = _job(job, points, p.turn_at(own.move[own_rows], own.share[own_rows]))
        plant = Plant(here, machine, threads)
        state = equilibrium(plant, u)
        at = job.place.back(here.position + np.nan_to_num(state.error))
    normal = (state.error * here.off).sum(axis=1)
    return Run(here, state, normal, way)


def _job(job: Setting, points: Points, angle: Floats | None) -> Setting:
    """The job at other points, the tool turned by `angle`; width and depth as at the nearest of its own."""
    order = np.argsort(job.points.way, kind="stable")
    way = job.points.way[order]
    made = setting(job.machine, job.path, job.process, points, job.place, scale=job.scale, angle=angle)
    k = np.clip(np.searchsorted(way, points.way), 1, len(way) - 1)
    k -= np.abs(points.way - way[k - 1]) < np.abs(points.way - way[k])
    old = order[k]
    same = job.points.move[old] == points.move
    other = np.clip(k + 1, 0, len(way) - 1)
    old = np.where(same, old, np.where(job.points.move[order[other]] == points.move, order[other], old))
    e = job.engaged
    bent = np.interp(points.way, way, e.curvature[order])
    engaged = replace(
        made.engaged, radial=e.radial[old], axial=e.axial[old], corner=e.corner[old], curvature=bent
    )
    return replace(made, engaged=engaged)


def nearest(path: Toolpath, move: NDArray[np.int64], p: Floats) -> Floats:
    """(k,) shares of the moves (k,) whose points are nearest to positions (k, 3), m, in the axes of the part."""
    a, b = path.start[move], path.end[move]
    way = b - a
    size = (way**2).sum(axis=1)
    share = np.divide(((p - a) * way).sum(axis=1), size, out=np.zeros(len(p)), where=size > 0)
    arcs = np.flatnonzero(path.kind[move] == Kind.ARC)
    if arcs.size:
        i = move[arcs]
        axis = np.eye(3)[path.normal[i]]
        spoke = (a[arcs] - path.centre[i]) * (1 - axis)
        seen = (p[arcs] - path.centre[i]) * (1 - axis)
        angle = np.arctan2((np.cross(spoke, seen) * axis).sum(axis=1), (spoke * seen).sum(axis=1))
        sweep = path.sweep[i]
        turns = np.round((sweep / 2 - angle) / (2 * np.pi))  # the turn that lies about the middle of the arc
        share[arcs] = (angle + 2 * np.pi * turns) / sweep
    return np.asarray(np.clip(share, 0.0, 1.0))
