"""What a result says about itself."""

from __future__ import annotations

import json
from typing import Any

import numpy as np

from stiffmap.common.fingerprints import code, digest
from stiffmap.common.version import __version__
from stiffmap.solve.machine import Machine
from stiffmap.workspace.maps.loading import Loading


def describe(loading: Loading, title: str, call: dict[str, Any]) -> dict[str, Any]:
    """Attributes of a Dataset: conventions, machine, version and the call that made it.

    The call leaves out what cannot change the numbers: threads, chunks, output path, time of day.
    """
    machine = loading.machine
    return {
        "title": f"{title}: {machine.name}",
        "machine": machine.name,
        "machine_title": machine.description.title,
        "machine_digest": machine_digest(machine),
        "effects": json.dumps([plain_effect(e) for e in machine.description.effects]),
        "stiffmap_version": __version__,
        "call": json.dumps(plain(call) | loading.options.as_plain(), ensure_ascii=False),
        "units": "SI: m, rad, N, N m",
        "axes": "base axes of the machine, right-handed; positions are those of the commanded tcp",
        "reference_point": loading.options.point,
        "wrench_order": "fx fy fz mx my mz, acting on the machine at the reference point",
        "displacement_order": "dx dy dz rx ry rz, against the commanded pose; rotation vector, base axes",
        "load_type": loading.options.load_type,
        "gravity": json.dumps(loading.acting_gravity()),
        "failed_poses": "NaN, with their status",
    }


def machine_digest(machine: Machine) -> str:
    """Fingerprint of everything that a machine is made of, link files and users' kinds of effects among it."""
    return digest(machine.description, code()[1:] if machine.description.effects else [])[:16]


def plain(call: dict[str, Any]) -> dict[str, Any]:
    """Arguments as plain data."""
    return {k: v.tolist() if isinstance(v, np.ndarray) else v for k, v in call.items()}


def plain_effect(effect: Any) -> dict[str, Any]:
    """An applied effect as plain data."""
    return {
        "kind": effect.kind,
        "element": effect.element,
        "legs": list(effect.legs),
        "parameters": dict(effect.parameters),
        "options": dict(effect.options),
    }
