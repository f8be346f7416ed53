"""Drive Jacobian and joint coordinates over arrays of poses, springs at rest (docs/theory.md D1-D3); what makes a Jacobian a matrix of
one unit: the characteristic length, and the drives' own limits; motions that cannot be are refused with place and time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from stiffmap.common.broadcasting import Floats, batch, one_of, real_array, rows, thread_count, trailing
from stiffmap.common.errors import StiffmapError
from stiffmap.common.number_text import place_text
from stiffmap.model.description import Drive
from stiffmap.model.description.machine import TASK
from stiffmap.model.description.tree import joints
from stiffmap.solve.closing import commanded
from stiffmap.solve.machine import Machine
from stiffmap.solve.status import Status
from stiffmap.workspace.maps.inputs import magnitude, plane_axes
from stiffmap.workspace.performance.motion.many_drives import FLAT, drive_weights, of_motions

PARTS = {"all": slice(0, 6), "translation": slice(0, 3), "rotation": slice(3, 6)}


def drive_table(machine: Machine) -> list[Drive]:
    """What each actuator's motor declares, in the order of `Machine.actuators`."""
    found = joints(machine.description)
    return [found[name].drive or Drive() for name in machine.actuators]


def declared(machine: Machine, field: str, otherwise: float) -> Floats:
    """(drives,) of one number of the drives; where the file declares none, this one."""
    given = [getattr(d, field) for d in drive_table(machine)]
    return np.array([otherwise if v is None else v for v in given], dtype=float)


def drive_values(machine: Machine, field: str, given: ArrayLike | None, unit: str, name: str = "") -> Floats:
    """(drives,) of one number of the drives: as given (one, or one each), else what the file declares.

    StiffmapError names the actuators without one, and the argument: `name`, or the field.
    """
    name = name or field
    n = len(machine.actuators)
    if given is not None:
        out = real_array(given, name)
        if out.shape not in ((), (n,)) or not (np.isfinite(out).all() and (out >= 0).all()):
            raise StiffmapError(
                f"{name}: expected one number or {n} (drives {', '.join(machine.actuators)}), finite and "
                f"not negative, {unit}; got {given!r}"
            )
        return np.broadcast_to(out, (n,)).copy()
    values = declared(machine, field, np.nan)
    missing = [a for a, v in zip(machine.actuators, values, strict=True) if np.isnan(v)]
    if missing:
        raise StiffmapError(
            f"{machine.name}: no {field} declared for {', '.join(missing)}; add it to the machine file or "
            f"give {name}= ({unit})"
        )
    return values


def drive_limits(machine: Machine, field: str, limits: ArrayLike | str, unit: str) -> Floats:
    """(drives,) limits: ``unit``, ``declared`` in the machine file, or numbers."""
    word = limits if isinstance(limits, str) else ""
    return drive_values(machine, field, {"unit": 1.0, "declared": None}.get(word, limits), unit, "limits")


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
    one_of(part, PARTS, "part")
    out = jacobian.copy()
    out[..., 3:, :] *= length
    out[..., revolute_drives(machine)] /= length
    return out[..., PARTS[part], :]


def commanded_jacobian(machine: Machine, k: DriveKinematics) -> Floats:
    """(..., 6, drives) Jacobian without the motions that the closure decides: their rows are zero. Rotations about the axes of the tcp."""
    out = k.jacobian.copy()
    out[..., 3:, :] = np.swapaxes(k.rotation, -1, -2) @ out[..., 3:, :]
    out[..., [name not in machine.description.task for name in TASK], :] *= 0.0
    return out


def commanded_axes(machine: Machine, plane: str) -> list[int]:
    """Indices of the axes of a plane; StiffmapError where one of them is not commanded."""
    axes, task = list(plane_axes(plane)), machine.description.task
    if any(TASK[i] not in task for i in axes):
        raise StiffmapError(
            f"{machine.name}: plane: expected commanded axes ({', '.join(task)}), got {plane}"
        )
    return axes


CHUNK = 16_384  # poses that are solved at once


@dataclass(frozen=True, eq=False)
class DriveKinematics:
    """First-order kinematics of the rigid machine; NaN where the pose is UNREACHABLE or SINGULAR."""

    jacobian: Floats  # (..., 6, drives): TCP twist (base axes) per unit rate of each drive
    coordinates: Floats  # (..., coordinates) all coordinates, springs at zero
    actuators: Floats  # (..., drives) m or rad
    position: Floats  # (..., 3) m, TCP; where the task leaves a component open, the closure's answer
    rotation: Floats  # (..., 3, 3)
    free_twist: Floats
    """(..., 6) with all drives held, the motion of the platform at a SINGULAR pose; else NaN."""
    sharing: Floats
    """(..., drives, drives) takes any rates to the nearest that go together, transposed the efforts that a motion needs
    to the drives' shares; the identity unless drives outnumber the freedoms."""
    together: NDArray[np.int32]  # (...) dimension of the rates of drives that go together
    pivot: Floats
    """(...) smallest relative pivot of the loops' elimination: 0 at a pose where passive joints lose rank."""
    status: NDArray[np.uint8]
    flags: NDArray[np.uint32]


def drive_kinematics(
    machine: Machine,
    position: ArrayLike,
    rotation: ArrayLike | None = None,
    *,
    start: ArrayLike | None = None,
    patient: bool = True,
    only_start: bool = False,
    sharing: str = "least_norm",
    threads: int | None = None,
) -> DriveKinematics:
    """Jacobian from the drives to the TCP at commanded poses (..., 3) m, rotation (..., 3, 3).

    Any machine: passive rates follow from all loops by rank-revealing elimination. `start`
    (..., coordinates): coordinates near the answer; None: continued from the pose before. `patient`: False
    takes a pose that straight continuation from home does not reach as UNREACHABLE, without the slow
    second attempt. `only_start`: coordinates of a neighbouring pose, which each pose continues; one that
    they do not lead to is UNREACHABLE. `sharing`: see `drive_weights`. Raises StiffmapError for bad input, never for a pose.
    """
    p, r = commanded(machine.compiled, position, rotation)
    if not machine.actuators:
        raise StiffmapError(f"{machine.name}: no actuator, so there are no drive rates")
    shape = batch(p.shape[:-1], r.shape[:-2])
    flat_p, flat_r = rows(p, shape, (3,)), rows(r, shape, (3, 3))
    compiled, size = machine.compiled, len(machine.compiled.names.coordinates)
    begin = None if start is None else rows(trailing(start, (size,), "start", "coordinates"), shape, (size,))
    if only_start and begin is None:
        raise StiffmapError("only_start: needs start, coordinates of neighbouring poses")
    out = compiled.core.kinematics(
        flat_p, flat_r, begin, weights=drive_weights(machine, sharing), patient=patient, only=only_start,
        threads=thread_count(threads),
    )  # fmt: skip
    shaped = {k: v.reshape(shape + v.shape[1:]) for k, v in out.items()}
    return DriveKinematics(actuators=shaped["coordinates"][..., list(compiled.drives)], **shaped)


def kernel_starts(
    machine: Machine, position: Floats, rotation: ArrayLike | None, threads: int | None
) -> Floats | None:
    """(n, coordinates) of the unloaded equilibria at (n, 3) m as starts on home's branch, NaN: none.

    Several times as quick as closing without a start. None: not for this machine.
    """
    if machine.fast:
        return None
    out = np.empty((len(position), len(machine.compiled.names.coordinates)))
    for begin in range(0, len(position), CHUNK):
        part = slice(begin, begin + CHUNK)
        out[part] = machine.solve(
            position[part], rotation=rotation, gravity=np.zeros(3), threads=threads
        ).coordinates
    return out


STEPS = 24  # halvings between two samples, to say where and when


def refuse_failed(machine: Machine, k: DriveKinematics, time: Floats | None, position: Floats) -> None:
    """StiffmapError with place and time of the first pose of a motion that cannot be; between two samples it is
    sought by halving."""
    failed = (k.status != Status.CONVERGED) | _crossed(machine, k.jacobian, k.together)
    if not failed.any():
        return
    i = int(np.argmax(failed))
    share, p, status = 0.0, position[i], Status(int(k.status[i]))
    if i > 0:
        share, p = _between(machine, k, position, i)
    word = {Status.UNREACHABLE: "leaves the reach", Status.SINGULAR: "meets a singularity"}
    what = word.get(status, "passes a singularity")
    when = "" if time is None else f", t = {time[i] - share * (time[i] - time[max(i - 1, 0)]):.4g} s"
    raise StiffmapError(f"{machine.name}: the trajectory {what} at {place_text(p, '.1f')}{when}")


def _between(machine: Machine, k: DriveKinematics, position: Floats, i: int) -> tuple[float, Floats]:
    """Share of the step back from sample `i`, and the place, of what happens between `i - 1` and `i`."""
    a, b = position[i - 1], position[i]
    low, high, start = 0.0, 1.0, k.coordinates[i - 1]
    for _ in range(STEPS):
        middle = (low + high) / 2
        there = drive_kinematics(machine, a + middle * (b - a), k.rotation[i - 1], start=start)
        jacobian = np.stack([k.jacobian[i - 1], there.jacobian])
        together = np.stack([k.together[i - 1], there.together])
        if there.status != Status.CONVERGED or _crossed(machine, jacobian, together)[1]:
            high = middle
        else:
            low, start = middle, there.coordinates
    return 1 - high, a + high * (b - a)


def _crossed(machine: Machine, jacobian: Floats, together: NDArray[np.int32]) -> NDArray[np.bool_]:
    """(n,) where the drive Jacobian loses rank, or changes its orientation since the pose before; False where it is
    NaN."""
    redundancy = machine.compiled.core.redundancy
    ok = np.isfinite(jacobian).all(axis=(1, 2))
    out = np.zeros(len(jacobian), dtype=bool)
    if not ok.any():
        return out
    j = jacobian[ok]
    if redundancy or (together[ok] < j.shape[-1]).any():
        values = np.asarray(np.linalg.svd(j, compute_uv=False), dtype=float)
        out[ok] = of_motions(together[ok], values, redundancy)[1] < FLAT * values[:, 0]
        return out
    # a smooth change of sign is a drive that stops moving the tool; a jump is one that runs away
    turn = np.linalg.det(np.swapaxes(j[:-1], 1, 2) @ j[1:])
    flipped = np.concatenate([[False], turn <= 0])
    scale = np.linalg.norm(j, axis=(-2, -1)) ** (2 * j.shape[-1])
    gram = np.linalg.det(np.swapaxes(j, 1, 2) @ j)
    out[ok] = flipped | (gram < 1e-18 * scale)
    return out
