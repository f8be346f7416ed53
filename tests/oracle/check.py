"""The core against Cartesian bodies (`cartesian`) on tasks of `classes`: statuses, displacement, compliance, efforts,
wrenches of legs, natural frequencies, by pose and by drives, by both paths."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

import stiffmap as sm
from stiffmap.model.description import Cable

from .cartesian.solve import Answer, Machine
from .statics import coordinates
from .tasks import Task
from .verify import Question, verified

LIMIT = 1e-8
ROUND_OFF = 1e-15  # over the lowest eigenvalue: of the oracle's own compliance
CRITICAL = 1e-10  # eigenvalue over the largest: too small to have a sign
SAME = 1e-9  # m, rad
OFF = 1e-8  # m, rad: from the core's TCP to the equilibrium
FAR = 0.1  # m, rad
METRE = 1.0
EPS = float(np.finfo(float).eps)
PLACE = ("translation", "rotation", "displacement")
MODES = 3
FINER = 16


@dataclass(frozen=True)
class Check:
    """One answer of the core beside the oracle's; largest differences relative to the largest entry of each kind."""

    how: str
    status: str
    flagged: bool
    truth: str
    gaps: dict[str, float]
    wrong: str
    """Empty: nothing to object to."""


def checks(task: Task, machine: sm.Machine | None = None) -> tuple[Answer, list[Check]]:
    """Every way to ask. What disagrees is asked again of bodies that close, and take the load, in finer steps."""
    machine = machine or sm.Machine(task.description)
    truth, found = checked(task, machine, Machine(task.description))
    if any(c.wrong for c in found):
        truth, found = checked(task, machine, Machine(task.description, FINER))
    return truth, found


def checked(task: Task, machine: sm.Machine, bodies: Machine) -> tuple[Answer, list[Check]]:
    modes = MODES if vibrates(task) else 0
    truth = bodies.solve(task.loads, task.pose, task.drives, task.kind, modes=modes)
    out = []
    for how, s in asked(machine, task, truth):
        there, asking = truth, task
        if task.drives is not None and "pose" in how and (own := other_drives(machine, truth)):
            asking = replace(task, drives=own)
            there = bodies.solve(task.loads, None, own, task.kind, modes=modes)
            if not same_pose(there, truth):
                there = truth  # those drives lead elsewhere: let it be judged as it stands
        elif task.drives is not None and "pose" in how and s.status == sm.Status.UNREACHABLE:
            there = bodies.solve(
                task.loads, truth.pose, None, task.kind
            )  # drives may lead where no straight way does
        out.append(against(there, how, s, machine, asking, bodies))
    return truth, out


def other_drives(machine: sm.Machine, truth: Answer) -> dict[str, float]:
    """Commands of the core at the oracle's pose, of another configuration than the oracle's; empty: the same."""
    if truth.kind == "unreachable":
        return {}
    k = sm.inverse_kinematics(machine, truth.pose.p, truth.pose.r)
    found = dict(zip(machine.compiled.names.coordinates, (float(v) for v in k.coordinates), strict=True))
    full = {n: next((v for m, v in found.items() if m.removeprefix("platform.") == n.removeprefix("platform.")), None)
            for n in truth.drives}  # fmt: skip
    if k.status != sm.Status.CONVERGED or None in full.values():
        return {}
    far = any(abs(found_v - truth.drives[n]) > SAME for n, found_v in full.items() if found_v is not None)
    return {n: v for n, v in full.items() if v is not None} if far else {}


def same_pose(a: Answer, b: Answer) -> bool:
    return bool(
        np.abs(np.subtract(a.pose.p, b.pose.p)).max() < SAME
        and np.abs(np.subtract(a.pose.r, b.pose.r)).max() < SAME
    )


def vibrates(task: Task) -> bool:
    """The core's frequencies are those of dead wrenches at the TCP."""
    named = task.description.name in ("few", "strut")  # without a mass
    return task.kind == "dead" and not task.loads.at_points and not named


def asked(machine: sm.Machine, task: Task, truth: Answer) -> Iterator[tuple[str, sm.Solution]]:
    """Solutions of the core by each method."""
    load: dict[str, Any] = {
        "load_type": task.kind,
        "wrenches": {n: [*f, 0, 0, 0] for n, f in task.loads.at_points.items()},
        "gravity": task.loads.gravity,
        "threads": 1,
    }
    wrench = [*task.loads.force, *task.loads.moment]
    drives = {n.removeprefix("platform."): v for n, v in truth.drives.items()}
    hung = any(isinstance(e, Cable) for e in task.description.platform)
    by_drives = drives and not hung and (task.drives is not None or truth.kind != "unreachable")
    for method in ("fast", "reference"):
        if task.by_pose or not by_drives:
            pose = task.pose or truth.pose
            yield f"{method} by pose", machine.solve(pose.p, wrench, rotation=pose.r, method=method, **load)
        if by_drives:
            command = [drives[n.removeprefix("platform.")] for n in machine.actuators]
            yield f"{method} by drives", machine.solve_joints(command, wrench, method=method, **load)


def against(
    truth: Answer, how: str, s: sm.Solution, machine: sm.Machine, task: Task, bodies: Machine
) -> Check:
    told = s.status == sm.Status.NOT_CONVERGED or bool(s.flags & sm.Flag.BRANCH_UNVERIFIED)
    gaps = differences(truth, s) if truth.found else {}
    if truth.found and truth.stable and vibrates(task) and "pose" in how and s.status == sm.Status.CONVERGED:
        gaps |= frequencies(truth, machine, task)
    status = sm.Status(int(s.status))
    # a pose that drives reached may be another configuration's too, and then says so
    elsewhere = told and task.drives is not None and "pose" in how
    wrong = "" if elsewhere else objection(truth, status, told, gaps, s)
    numbers = status in (sm.Status.CONVERGED, sm.Status.UNSTABLE)
    off = not truth.found or any(not v < limit(k, truth, gaps) for k, v in gaps.items())
    if (
        not wrong
        and numbers
        and truth.kind not in ("singular", "unreachable", "locked")
        and off
        and not elsewhere
    ):
        away, falling = bodies.judge(s.displacement, task.loads, task.pose, task.drives, task.kind)
        if np.isnan(away):
            return Check(how, status.name, told, f"{truth.kind}, undecided", gaps, "")
        open_way = not truth.found or leapt(truth) or told
        if not away < OFF and open_way and balanced(machine, s, task, truth, how):
            # the TCP alone does not say how slender springs are bent; which way a path goes on stays open
            return Check(how, status.name, told, f"{truth.kind}, balanced", gaps, "")
        if not away < OFF:
            wrong = f"not an equilibrium, {away:.0e} off"
        elif falling >= 0 and (falling == 0) != (status == sm.Status.CONVERGED):
            wrong = "status against the eigenvalues where it stands"
    return Check(how, status.name, told, truth.kind, gaps, wrong)


def balanced(machine: sm.Machine, s: sm.Solution, task: Task, truth: Answer, how: str) -> bool:
    """The core's own coordinates by free bodies (`verify`), where the bodies here lose the path."""
    wrench = np.r_[task.loads.force, task.loads.moment][None]
    load = {"wrench": wrench, "load_type": task.kind, "gravity": task.loads.gravity}
    load["wrenches"] = {n: [*f, 0, 0, 0] for n, f in task.loads.at_points.items()}
    pose = task.pose or truth.pose
    p, r = np.array(pose.p)[None], np.array(pose.r)[None]
    if by_drives := "drives" in how:
        drives = {n.removeprefix("platform."): v for n, v in truth.drives.items()}
        at = np.array([[drives[n.removeprefix("platform.")] for n in machine.actuators]])
        closed = sm.forward_kinematics(machine, at, threads=1)
    else:
        at, load["rotation"] = p, r
        closed = sm.inverse_kinematics(machine, p, r)
    size = max(float(np.abs(p).max()), METRE / 10)
    q = Question(machine, load, at, coordinates(s.coordinate_names, closed.coordinates), size, by_drives)
    verdict = verified(q, q.solve(method=how.split()[0]), np.array([0]))
    return not verdict.bad and not verdict.undecided


def leapt(truth: Answer) -> bool:
    """So strained by its own misfits that Newton's way from the command to the unloaded state is one of many."""
    return truth.released > FAR


def limit(kind: str, truth: Answer, gaps: dict[str, float]) -> float:
    """Of a difference. What a Hessian with a small eigenvalue gives is no better than its round-off and than the place where it is
    taken."""
    if kind in PLACE:
        return LIMIT
    off = max((gaps.get(k, 0.0) for k in PLACE), default=0.0)
    return max(LIMIT, (ROUND_OFF + min(off, LIMIT)) / max(abs(truth.lowest), 1e-300))


def objection(truth: Answer, status: sm.Status, told: bool, gaps: dict[str, float], s: sm.Solution) -> str:
    numbers = status in (sm.Status.CONVERGED, sm.Status.UNSTABLE)
    if truth.kind == "singular":
        return "" if status == sm.Status.SINGULAR else "singular, not said"
    if truth.kind == "unreachable":  # the oracle's steps of closing are no proof
        return ""
    if not truth.found or leapt(truth):  # any equilibrium will do: `against` looks whether it is one
        return ""
    far = truth.crossed or float(np.abs(truth.displacement).max()) > FAR
    off = {k: v for k, v in gaps.items() if not v < limit(k, truth, gaps)}
    if told and numbers and not off:  # right, and needlessly doubted: counted as flagged
        return ""
    if told:
        return "" if far else "not found, or not vouched for"
    if not numbers:
        return "no answer"
    if abs(truth.lowest) > CRITICAL and truth.stable != (status == sm.Status.CONVERGED):
        return "status against the eigenvalues"
    if s.flags & sm.Flag.FREE_SPIN or s.flags & sm.Flag.LEG_SINGULAR:
        off.pop("frequency", None)
    return f"another {', '.join(off)}" if off else ""


def differences(truth: Answer, s: sm.Solution) -> dict[str, float]:
    """Of what has a number in the core's answer; NaN where it should have one."""
    moved, size = truth.displacement, float(np.abs(truth.displacement[:3]).max())
    floor = max(
        1e-7, len(s.coordinate_names) * EPS / LIMIT
    )  # m, rad: one unit in the last place of each coordinate
    out = {
        "translation": float(np.abs(s.displacement[:3] - moved[:3]).max() / max(size, floor)),
        "rotation": float(
            np.abs(s.displacement[3:] - moved[3:]).max() / max(np.abs(moved[3:]).max(), size / METRE, floor)
        ),
    }
    if size < 1e-9 and np.abs(moved[3:]).max() < 1e-9:  # nothing to speak of
        out = {"displacement": float(np.abs(s.displacement - moved).max() > 1e-13)}
    scale = np.sqrt(np.abs(np.diag(truth.compliance)))
    scale = np.maximum(np.maximum(scale, 1e-7 * scale.max(initial=0.0)), 1e-7)  # below 1e-14 m/N: rigid
    out["compliance"] = float((np.abs(s.compliance - truth.compliance) / np.outer(scale, scale)).max())
    efforts = np.array(
        [truth.effort.get(n, truth.effort.get(n.removeprefix("platform."), np.nan)) for n in s.actuators]
    )
    wrenches = np.array([truth.leg_wrench[n] for n in s.legs]).reshape(-1, 6)
    largest = max(float(np.abs(efforts).max(initial=0.0)), float(np.abs(wrenches).max(initial=0.0)), 1.0)
    open_ones = bool(s.flags & sm.Flag.INTERNAL_WRENCH_UNDETERMINED)
    for name, mine, own in (("effort", efforts, s.actuator_effort), ("leg wrench", wrenches, s.leg_wrench)):
        gap = np.abs(np.asarray(own) - mine) / largest
        out[name] = float(np.nanmax(gap, initial=0.0) if open_ones else gap.max(initial=0.0))
    return out


def frequencies(truth: Answer, machine: sm.Machine, task: Task) -> dict[str, float]:
    pose = task.pose or truth.pose
    wrench = [*task.loads.force, *task.loads.moment]
    found = sm.natural_frequencies(
        machine, pose.p, wrench, rotation=pose.r, gravity=task.loads.gravity, modes=MODES
    )
    wanted = truth.frequencies
    both = np.isfinite(wanted)
    gap = np.abs(found.frequency[both] - wanted[both]) / wanted[both]
    return {"frequency": float(gap.max(initial=0.0))}
