"""What vibrates at the tool at many poses: modes of unit stiffness, and the flexibility of all others (docs/theory.md V1); their
damping, declared or assumed (V2)."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from stiffmap.common.broadcasting import Floats, real_array, refused, thread_count, whole_number
from stiffmap.common.errors import StiffmapError
from stiffmap.model.description import Cable, Joint, Spring
from stiffmap.model.description.tree import all_elements, core_name
from stiffmap.solve.closing import loaded_poses
from stiffmap.solve.machine import Machine
from stiffmap.workspace.performance.motion.inertia import inertias, need_masses

ASSUMED = 0.02  # damping ratio of every mode of a machine that declares none


@dataclass(frozen=True, eq=False)
class Damping:
    """Damping by coordinate, and of the modes."""

    viscous: Floats  # (coordinates,) N·s/m, N·m·s/rad
    loss: Floats  # (coordinates,) structural loss factor of the spring or law of each
    ratios: tuple[float, ...]  # of the modes, lowest first, the last for all further ones; empty: none
    said: str  # where it comes from, in words
    assumed: bool = False  # whether the machine file declares none

    def of_modes(self, count: int) -> Floats:
        """(count,) damping ratios."""
        if not self.ratios:
            return np.zeros(count)
        return np.array(self.ratios)[np.minimum(np.arange(count), len(self.ratios) - 1)]


def damping_of(machine: Machine, given: ArrayLike | None = None) -> Damping:
    """The machine's own damping, or the modal ratios that are given in place of its modal ratios.

    Raises StiffmapError for ratios below 0, or 1 and above (per cent were meant).
    """
    viscous, loss = coordinate_damping(machine)
    counts = {"dampers": np.count_nonzero(viscous), "loss factors": np.count_nonzero(loss)}
    parts = [f"{what} at {n} coordinates" for what, n in counts.items() if n]
    ratios = machine.description.modal_damping if given is None else _ratios(given)
    if not (ratios or parts):
        said = f"assumed: {100 * ASSUMED:g} % of every mode, since the machine file declares none"
        return Damping(viscous, loss, (ASSUMED,), said, assumed=True)
    if ratios:
        listed = ", ".join(f"{100 * r:.3g} %" for r in ratios)
        parts.insert(0, f"modal ratios {listed}, {'declared' if given is None else 'as given'}")
    else:
        parts.append("declared; no modal ratios")
    return Damping(viscous, loss, ratios, "; ".join(parts))


def coordinate_damping(machine: Machine) -> tuple[Floats, Floats]:
    """(coordinates,) and (coordinates,): viscous damping (N·s/m, N·m·s/rad) and loss factors that are declared."""
    names = machine.compiled.names
    index = {n: i for i, n in enumerate(names.coordinates)}
    viscous, loss = np.zeros(len(index)), np.zeros(len(index))
    for full, e in all_elements(machine.description):
        core = core_name(full)
        if isinstance(e, Spring) and e.loss_factor:
            first = names.springs.get(core)
            if first is not None:
                loss[first : first + 6] = e.loss_factor
        elif isinstance(e, Joint) and not isinstance(e, Cable) and (e.damping or e.loss_factor):
            own = [core] if len(e.axes) == 1 else [f"{core}.{i + 1}" for i in range(len(e.axes))]
            for name in own:
                viscous[index[name]] = e.damping or 0.0
                loss[index[name]] = e.loss_factor or 0.0
    return viscous, loss


def _ratios(given: ArrayLike) -> tuple[float, ...]:
    out = np.atleast_1d(real_array(given, "damping", "damping ratios, 0.02 for 2 %"))
    if out.ndim != 1 or not out.size or not ((out >= 0) & (out < 1)).all():
        what = "one damping ratio or a list of them, from 0 to below 1 (0.02 is 2 %)"
        raise refused("damping", what, repr(given))
    return tuple(float(v) for v in out)


SYMMETRIC = 1e-9  # part of a tangent that is not symmetric, relative, up to which it is round-off


@dataclass(frozen=True, eq=False)
class TipModes:
    """Modes at a point of the machine, poses (n), lowest frequency first; NaN where the pose failed."""

    shape: tuple[int, ...]
    """Batch axes of the poses."""
    square: Floats
    """(n, modes) s²: 1/w² of each; 0 of a damper without mass."""
    tip: Floats
    """(n, 6, modes) motion of the point, modes scaled to unit stiffness (1 N m of twice the energy)."""
    viscous: Floats
    """(n, modes, modes) s."""
    loss: Floats
    """(n, modes, modes)."""
    rest: Floats
    """(n, 6, 6) m/N and the like: static flexibility of all that has no mass or is not kept."""
    unsymmetric: Floats
    """(n,) of the tangent, relative."""
    status: NDArray[np.uint8]
    flags: NDArray[np.uint32]
    damping: Damping

    @property
    def frequency(self) -> Floats:
        """(n, modes) Hz, undamped; infinite without mass."""
        with np.errstate(divide="ignore"):
            return np.asarray(1 / (2 * np.pi * np.sqrt(self.square)))

    def only(self, rows: NDArray[np.intp]) -> TipModes:
        """The modes at some of the poses."""
        arrays = ("square", "tip", "viscous", "loss", "rest", "unsymmetric", "status", "flags")
        return replace(self, shape=(len(rows),), **{n: getattr(self, n)[rows] for n in arrays})

    @property
    def proportional(self) -> bool:
        """Whether no damping couples two modes: the modes are then real."""
        far = ~np.eye(self.square.shape[1], dtype=bool)
        return not (np.nan_to_num(self.viscous)[:, far].any() or np.nan_to_num(self.loss).any())

    @property
    def ratio(self) -> Floats:
        """(n, modes) damping ratio of each mode alone, the loss factor by half."""
        c = np.einsum("nkk->nk", self.viscous)
        eta = np.einsum("nkk->nk", self.loss)
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(np.where(self.square > 0, c / (2 * np.sqrt(self.square)), 0.0) + eta / 2)


def tip_modes(
    machine: Machine,
    position: ArrayLike,
    wrench: ArrayLike | None = None,
    *,
    rotation: ArrayLike | None = None,
    gravity: ArrayLike | None = None,
    point: str = "tcp",
    damping: ArrayLike | None = None,
    modes: int | None = None,
    symmetrise: bool = False,
    threads: int | None = None,
) -> TipModes:
    """Modes at commanded poses about the loaded equilibrium; arguments as of `frequency_response`."""
    need_masses(machine, "a frequency response")
    compiled = machine.compiled
    if point not in machine.points:
        raise StiffmapError(
            f"point: no point '{point}' on {machine.name}; there are: {', '.join(machine.points)}"
        )
    declared = damping_of(machine, damping)
    shape, poses, turns, loads = loaded_poses(compiled, position, wrench, rotation)
    cores = thread_count(threads)
    out = compiled.core.modes(
        list(inertias(machine)), declared.viscous, declared.loss, poses, turns, loads, compiled.gravity(gravity),
        closed=compiled.close_poses(poses, turns, cores)[0], point=point, count=_count(machine, declared, modes), whole=False,
        threads=cores,
    )  # fmt: skip
    worst = float(np.nanmax(out["unsymmetric"], initial=0.0))
    if worst > SYMMETRIC and not symmetrise:
        raise StiffmapError(
            f"{machine.name}: a dead moment makes the tangent unsymmetric (by {worst:.2g} of its size), and a "
            "frequency response by modes needs a symmetric one; give symmetrise=True to take its symmetric part, "
            "or leave the moment out"
        )
    static = machine.solve(poses, loads, rotation=turns, point=point, gravity=gravity, threads=threads)
    _statically(out, np.where(static.ok[:, None, None], static.compliance, np.nan))
    most = int(np.isfinite(out["square"]).sum(axis=1).max(initial=0))
    square = out["square"][:, :most]
    viscous = out["viscous"][:, :most, :most].copy()
    kept = np.arange(most)
    viscous[:, kept, kept] += 2 * declared.of_modes(most) * np.sqrt(square)
    found = TipModes(
        shape, square, out["tip"][:, :, :most], viscous, out["loss"][:, :most, :most], out["rest"],
        out["unsymmetric"], out["status"], out["flags"], declared,
    )  # fmt: skip
    return _padded(found)


def _count(machine: Machine, damping: Damping, modes: int | None) -> int:
    """Modes to keep: all that have mass or a damper, or the number that is asked for."""
    size = len(machine.compiled.names.coordinates)
    if modes is not None:
        return min(size, whole_number(modes, "modes", 1))
    damped = int(np.count_nonzero((damping.viscous > 0) | (damping.loss > 0)))
    return max(1, min(size, 6 * len(machine.compiled.core.bodies) + damped))


def _statically(out: dict[str, Floats], compliance: Floats) -> None:
    """What is not in the modes is the loaded compliance without theirs: the same number at 0 Hz as in statics."""
    b = np.nan_to_num(out["tip"])
    rest = compliance - b @ b.transpose(0, 2, 1)
    take = np.isfinite(rest).all(axis=(1, 2)) & (out["unsymmetric"] <= SYMMETRIC)
    out["rest"][take] = rest[take]


def _padded(found: TipModes) -> TipModes:
    """Modes beyond a pose's own are nothing, not unknown, so that sums over modes hold at every pose that has an answer."""
    ok = np.isfinite(found.rest[:, 0, 0])
    for a in (found.square, found.tip, found.viscous, found.loss):
        part = a[ok]
        part[~np.isfinite(part)] = 0.0
        a[ok] = part
    return found
