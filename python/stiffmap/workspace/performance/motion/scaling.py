"""What makes a Jacobian a matrix of one unit: the characteristic length, and the drives' own limits."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from stiffmap.common.broadcasting import Floats, real_array
from stiffmap.common.errors import StiffmapError
from stiffmap.model.description import Drive
from stiffmap.model.description.tree import joints
from stiffmap.solve.machine import Machine
from stiffmap.workspace.maps.inputs import magnitude

PARTS = {"all": slice(0, 6), "translation": slice(0, 3), "rotation": slice(3, 6)}


def drive_table(machine: Machine) -> list[Drive]:
    """What each actuator's motor declares, in the order of `Machine.actuators`."""
    found = joints(machine.description)
    return [found[name].drive or Drive() for name in machine.actuators]


def declared(machine: Machine, field: str, otherwise: float) -> Floats:
    """(drives,) of one number of the drives; where the file declares none, this one."""
    given = [getattr(d, field) for d in drive_table(machine)]
    return np.array([otherwise if v is None else v for v in given], dtype=float)


def drive_values(machine: Machine, field: str, given: ArrayLike | None, unit: str) -> Floats:
    """(drives,) of one number of the drives: as given (one, or one each), else what the file declares.

    StiffmapError names the actuators without one.
    """
    n = len(machine.actuators)
    if given is not None:
        out = real_array(given, field)
        if out.shape not in ((), (n,)) or not (np.isfinite(out).all() and (out >= 0).all()):
            raise StiffmapError(
                f"{field}: expected one number or {n} (drives {', '.join(machine.actuators)}), finite and "
                f"not negative, {unit}; got {given!r}"
            )
        return np.broadcast_to(out, (n,)).copy()
    values = declared(machine, field, np.nan)
    missing = [a for a, v in zip(machine.actuators, values, strict=True) if np.isnan(v)]
    if missing:
        raise StiffmapError(
            f"{machine.name}: no {field} declared for {', '.join(missing)}; add it to the machine file or "
            f"give {field}= ({unit})"
        )
    return values


def drive_limits(machine: Machine, field: str, limits: ArrayLike | str, unit: str) -> Floats:
    """(drives,) limits: ``unit``, ``declared`` in the machine file, or numbers."""
    word = limits if isinstance(limits, str) else ""
    return drive_values(machine, field, {"unit": 1.0, "declared": None}.get(word, limits), unit)


def revolute_drives(machine: Machine) -> np.ndarray:
    """(drives,) bool: which actuators turn."""
    compiled = machine.compiled
    return np.array([not compiled.names.prismatic[i] for i in compiled.drives])


def characteristic_length(machine: Machine, length: float | None) -> float:
    """m: turns angles into lengths; the machine's own (mean distance of its joints) where none is given."""
    if length is None:
        return float(machine.compiled.length)
    return magnitude(length, "length", "m")


def weighted(machine: Machine, jacobian: Floats, length: float, part: str) -> Floats:
    """Rows of `part` with rotations times the length, columns of revolute drives per that length."""
    if not isinstance(part, str) or part not in PARTS:
        raise StiffmapError(f"part: expected one of {', '.join(PARTS)}, got {part!r}")
    out = jacobian.copy()
    out[..., 3:, :] *= length
    out[..., revolute_drives(machine)] /= length
    return out[..., PARTS[part], :]
