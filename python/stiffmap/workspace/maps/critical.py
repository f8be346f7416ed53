"""Critical points of a load path: kind, load and mode, with the leg and the joint that move most."""

from __future__ import annotations

from typing import Any

import numpy as np

from stiffmap.common.broadcasting import Floats
from stiffmap.solve.compiled import Role
from stiffmap.solve.labels import meaning
from stiffmap.solve.machine import Machine


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
