"""The one Dataset of sweeps: single forces, and paths with their critical points."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from stiffmap.common.broadcasting import Floats
from stiffmap.solve.compiled import Role
from stiffmap.solve.labels import COMPONENTS, meaning
from stiffmap.solve.machine import Machine
from stiffmap.workspace.maps.loading import Loading, describe, displaced

BRANCH = meaning("1", "0: from the unloaded machine; 1: the branch that crosses it")


@dataclass(frozen=True, eq=False)
class Equilibria:
    """What a sweep found, n steps; SI."""

    force: Floats
    """(n,) N along the direction."""
    displacement: Floats
    """(n, 6)."""
    along: Floats
    """(n,) m, translation along the force."""
    compliance_along: Floats
    """(n,) m/N; NaN where it was not computed."""
    unstable_modes: Floats
    """(n,); NaN where they were not counted."""
    status: NDArray[Any]
    flags: NDArray[Any]
    branch: NDArray[np.intp]

    def variables(self) -> dict[str, Any]:
        """Variables over ``step``."""
        return displaced("step", self.displacement, self.status, self.flags, "xy") | {
            "deflection_along": ("step", self.along, meaning("m", "translation along the force")),
            "compliance_along": (
                "step",
                self.compliance_along,
                meaning("m/N", "loaded compliance along the force; NaN on a path"),
            ),
            "unstable_modes": (
                "step",
                self.unstable_modes,
                meaning("1", "directions in which the energy falls; NaN for single forces"),
            ),
            "branch": ("step", self.branch, BRANCH),
        }


@dataclass(frozen=True, eq=False)
class Followed:
    """What is said of a path and of the branch that crosses it; nothing for single forces."""

    end: str = ""
    crossing_end: str = ""
    critical: tuple[dict[str, Any], ...] = ()
    crossing_critical: tuple[dict[str, Any], ...] = ()


def sweep_dataset(
    loading: Loading, title: str, call: dict[str, Any], found: Equilibria, followed: Followed
) -> xr.Dataset:
    """The Dataset that `sweep` describes; `call` holds position and direction."""
    every = [*followed.critical, *followed.crossing_critical]
    modes, coordinate = critical_variables(loading.machine, every)
    number = np.repeat([0, 1], [len(followed.critical), len(followed.crossing_critical)])
    modes["critical_branch"] = ("critical", number, BRANCH)
    coords = coordinate | {
        "force": ("step", found.force, meaning("N", "force along the direction")),
        "component": ("component", np.array(COMPONENTS)),
        "axis": ("axis", np.array(["x", "y", "z"])),
        "position": ("axis", call["position"], meaning("m", "commanded tcp")),
        "direction": ("axis", call["direction"], meaning("1", "direction of the force, base axes")),
    }
    attrs = describe(loading, title, {"function": "sweep", **call}) | {
        "failed_poses": "NaN, with their status; unstable ones kept",
        "end": followed.end,
        "crossing_end": followed.crossing_end,
        "critical_points": json.dumps([_summary(c) for c in followed.critical]),
    }
    return xr.Dataset(found.variables() | modes, coords, attrs)


def _summary(c: dict[str, Any]) -> dict[str, Any]:
    kind = "limit" if c["limit"] else "bifurcation"
    return {"kind": kind, "force": c["load"], "deflection_along": c["along"]}


def critical_variables(
    machine: Machine, critical: list[dict[str, Any]]
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Variables and coordinates over the dimensions ``critical`` and ``coordinate``."""
    names = list(machine.compiled.names.coordinates)
    modes = np.array([c["mode"] for c in critical]).reshape(len(critical), len(names))
    sizes = np.abs(modes) * _units(machine)
    over = {
        "critical_force": _floats(critical, "load", "N", "force at the critical point"),
        "critical_deflection": _floats(critical, "along", "m", "translation along the force there"),
        "critical_kind": (
            "critical",
            np.array(["limit" if c["limit"] else "bifurcation" for c in critical], dtype=object).astype(str),
            meaning("", "limit: the force has an extremum; bifurcation: branches cross"),
        ),
        "unstable_before": ("critical", np.array([c["before"] for c in critical], dtype=int)),
        "unstable_after": ("critical", np.array([c["after"] for c in critical], dtype=int)),
        "mode_leg": ("critical", np.array([_leg(machine, names, s) for s in sizes]).astype(str)),
        "mode_joint": ("critical", np.array([_joint(machine, names, s) for s in sizes]).astype(str)),
        "mode": (
            ("critical", "coordinate"),
            modes,
            meaning("m or rad", "buckling mode; the largest motion, angles as arcs, is 1"),
        ),
        "critical_coordinates": (
            ("critical", "coordinate"),
            np.array([c["coordinates"] for c in critical]).reshape(len(critical), len(names)),
            meaning("m or rad", "coordinates at the critical point"),
        ),
    }
    return over, {"coordinate": ("coordinate", np.array(names))}


def _floats(critical: list[dict[str, Any]], key: str, units: str, what: str) -> tuple[Any, ...]:
    return ("critical", np.array([c[key] for c in critical], dtype=float), meaning(units, what))


def _units(machine: Machine) -> Floats:
    """Length that a unit of each coordinate stands for."""
    prismatic = np.array(machine.compiled.names.prismatic)
    return np.where(prismatic, 1.0, machine.compiled.length)


def _leg(machine: Machine, names: list[str], sizes: Floats) -> str:
    """Leg of the joint that moves most; '' where that belongs to the base or the platform."""
    leg = _joint(machine, names, sizes).split(".")[0]
    return leg if leg in machine.legs else ""


def _joint(machine: Machine, names: list[str], sizes: Floats) -> str:
    """Joint, drive or spring coordinate that moves most; joints go before springs."""
    roles = np.array(machine.compiled.names.roles)
    joints = np.where(roles != Role.SPRING, sizes, 0.0)
    pick = joints if joints.max(initial=0.0) > 0.1 * sizes.max() else sizes
    return names[int(np.argmax(pick))]
