"""What maps share: how every pose is solved, what a result says of that, sums that do not depend on the batch, bars of progress."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import replace
from typing import TypeVar, Unpack

import numpy as np
from numpy.typing import NDArray

from stiffmap.common.broadcasting import Floats
from stiffmap.common.fingerprints import code, digest
from stiffmap.common.version import __version__
from stiffmap.model.files.save import dump_effect
from stiffmap.solve.labels import COMPONENTS, TWIST_UNITS, flag_attrs, meaning, status_attrs
from stiffmap.solve.machine import Machine, solve_with
from stiffmap.solve.options import LoadingKeywords, options_of
from stiffmap.solve.solution import Solution
from stiffmap.solve.solving import Call, solve_varied
from stiffmap.solve.status import Status
from stiffmap.workspace.maps.inputs import plane_axes


class Loading:
    """A machine and the options that a whole map shares."""

    def __init__(self, machine: Machine, **given: Unpack[LoadingKeywords]) -> None:
        self.machine = machine
        self.options = options_of(given)

    def solve(self, position: Floats, wrench: Floats, *, stiffness: bool = True) -> Solution:
        """Equilibria at positions (..., 3) under wrenches (..., 6), broadcast together; without the 6x6 if not asked."""
        return solve_with(self.machine, position, wrench, replace(self.options, stiffness=stiffness))

    def solve_varied(
        self, position: Floats, wrench: Floats, variants: tuple[Machine, ...]
    ) -> tuple[Solution, Floats]:
        """Also the displacements (..., variants, 6) of machines near this one, exact to first order."""
        call = Call(position, wrench, replace(self.options, stiffness=False))
        return solve_varied(self.machine.compiled, call, [m.compiled for m in variants])

    def acting_gravity(self) -> list[float]:
        """Gravity that acts (m/s², base axes)."""
        return [float(g) for g in self.machine.compiled.gravity(self.options.gravity)]


def without_failed(values: Floats, status: NDArray[np.uint8], keep_unstable: bool = False) -> Floats:
    """Values (..., *tail) with NaN where the pose of `status` (...) failed."""
    kept = status == Status.CONVERGED
    kept |= status == Status.SINGULAR  # what is undetermined there is NaN already
    if keep_unstable:
        kept |= status == Status.UNSTABLE
    tail = (1,) * (values.ndim - status.ndim)
    return np.where(kept.reshape(status.shape + tail), values, np.nan)


def deflections(d: Floats, plane: str) -> dict[str, Floats]:
    """Displacements (..., 6) by the names of maps, with the norms of their translations, whole and in a plane."""
    return {
        "displacement": d,
        "deflection": norm(d[..., :3]),
        f"deflection_{plane}": norm(d[..., plane_axes(plane)]),
    }


def meanings(plane: str, of: str) -> dict[str, dict[str, object]]:
    """Attributes of `deflections`, of the status of an equilibrium or pose (`of`) and of its flags."""
    return {
        "displacement": meaning(TWIST_UNITS, "displacement of the reference point"),
        "deflection": meaning("m", "norm of the translation"),
        f"deflection_{plane}": meaning("m", f"norm of the translation in the {plane} plane"),
        "status": status_attrs(of),
        "flags": flag_attrs(),
    }


def displaced(
    dim: str, d: Floats, status: NDArray[np.uint8], flags: NDArray[np.uint32], plane: str
) -> dict[str, object]:
    """Variables of equilibria along one dimension, displaced by d (n, 6)."""
    values: dict[str, np.ndarray] = {**deflections(d, plane), "status": status, "flags": flags}
    attrs = meanings(plane, "the equilibrium")
    return {n: ((dim, "component") if v.ndim == 2 else dim, v, attrs[n]) for n, v in values.items()}


def at_place(position: Floats) -> dict[str, object]:
    """Coordinates of a Dataset of equilibria at one commanded position (3,) m."""
    return {
        "component": ("component", np.array(COMPONENTS)),
        "axis": ("axis", np.array(["x", "y", "z"])),
        "position": ("axis", position, meaning("m", "commanded tcp")),
    }


def describe(loading: Loading, title: str, call: dict[str, object]) -> dict[str, object]:
    """Attributes of a Dataset: conventions, machine, version and the call that made it.

    The call leaves out what cannot change the numbers: threads, chunks, output path, time of day.
    """
    machine = loading.machine
    return {
        "title": f"{title}: {machine.name}",
        "machine": machine.name,
        "machine_title": machine.description.title,
        "machine_digest": machine_digest(machine),
        "effects": json.dumps([dump_effect(e) for e in machine.description.effects]),
        "stiffmap_version": __version__,
        "call": json.dumps(call | loading.options.as_plain(), ensure_ascii=False, default=np.ndarray.tolist),
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


def dot(a: Floats, b: Floats) -> Floats:
    """Scalar product over the last axis, leading axes broadcast; summed in a fixed order, whatever batch a number is in."""
    out = a[..., 0] * b[..., 0]
    for k in range(1, max(a.shape[-1], b.shape[-1])):
        out = out + a[..., k] * b[..., k]
    return np.asarray(out)


def apply(matrix: Floats, vector: Floats) -> Floats:
    """Matrix (..., m, n) times vector (..., n)."""
    return dot(matrix, vector[..., None, :])


def norm(vector: Floats) -> Floats:
    """Euclidean norm over the last axis."""
    return np.asarray(np.sqrt(dot(vector, vector)))


T = TypeVar("T")


def track(items: Iterable[T], total: int, what: str, show: bool | None) -> Iterable[T]:
    """The items, with a bar on standard error where wanted; None: where that is a terminal."""
    if show is False:
        return items
    from rich import progress
    from rich.console import Console

    console = Console(stderr=True)
    hidden = show is None and not console.is_terminal
    return progress.track(items, what, total, console=console, transient=True, disable=hidden)
