"""A machine that can be solved."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from os import PathLike
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from stiffmap._core import FastPlan, Mechanism
from stiffmap.broadcasting import Floats, batch, rows, thread_count, trailing, wrench_array
from stiffmap.derivatives import Request, base_and_variations, combine
from stiffmap.description import MachineDescription
from stiffmap.errors import StiffmapError
from stiffmap.lowering import build_mechanism
from stiffmap.names import Names, names_of
from stiffmap.solution import Solution

if TYPE_CHECKING:
    from stiffmap.inverse import HeldMachine

LOAD_TYPES = {"dead": 0, "follower": 1, "semitangential": 2}


class Machine:
    """An immutable machine; `load_machine` makes one from a shipped name or a file.

    Pickles, compares by its description, and may be shared by threads.
    """

    def __init__(self, description: MachineDescription) -> None:
        self._description = description
        self._core  # noqa: B018 - refuse an impossible machine when it is made, not when it is used

    @property
    def description(self) -> MachineDescription:
        """What the machine is made of."""
        return self._description

    @property
    def name(self) -> str:
        """Name of the machine."""
        return self._description.name

    @cached_property
    def _core(self) -> Mechanism:
        return build_mechanism(self._description)

    @cached_property
    def _names(self) -> Names:
        return names_of(self._core)

    @cached_property
    def _home_rotation(self) -> Floats:
        return self._description.home.r

    @cached_property
    def _plan(self) -> FastPlan:
        box = self._description.workspace
        low, high = box if box else ((1.0, 1.0, 1.0), (-1.0, -1.0, -1.0))
        return FastPlan(self._core, np.array(low), np.array(high))

    @property
    def fast(self) -> str:
        """Empty if the fast path takes this machine, else what it lacks for it."""
        return self._plan.missing

    @property
    def actuators(self) -> tuple[str, ...]:
        """Full names of the actuators."""
        return self._names.actuators

    @property
    def legs(self) -> tuple[str, ...]:
        """Names of the legs."""
        return self._names.legs

    @property
    def points(self) -> tuple[str, ...]:
        """Names of the points that wrenches and readings may refer to."""
        return self._names.points

    @property
    def free_spins(self) -> tuple[str, ...]:
        """Passive coordinates that turn without any effect, held at their home value."""
        return self._names.free_spins

    @property
    def workspace(self) -> Floats:
        """(2, 3) m: lowest and highest corner of the workspace box."""
        if self._description.workspace is None:
            raise StiffmapError(f"{self.name}: the machine file declares no workspace box")
        return np.array(self._description.workspace)

    def solve(
        self,
        position: ArrayLike,
        wrench: ArrayLike | None = None,
        *,
        rotation: ArrayLike | None = None,
        point: str = "tcp",
        wrenches: Mapping[str, ArrayLike] | None = None,
        load_type: str | Mapping[str, str] = "dead",
        read_points: Sequence[str] = (),
        gravity: ArrayLike | None = None,
        method: str = "fast",
        load_steps: int | str = "auto",
        stiffness: bool = True,
        derivatives: Sequence[Request] = (),
        threads: int | None = None,
    ) -> Solution:
        """Equilibrium, stiffness and compliance at commanded poses under external wrenches.

        Parameters
        ----------
        position
            (..., 3) m, commanded TCP, base axes.
        wrench
            (..., 6) N, N·m, acting on the machine at `point`, base axes, moment about the point.
            None: no external wrench.
        rotation
            (..., 3, 3), commanded orientation; None: as at home.
        point
            Named point where `wrench` acts and `displacement`, `stiffness` and `compliance` are.
        wrenches
            More wrenches: point name -> (..., 6).
        load_type
            How `wrench` follows its body: ``dead``, ``follower`` or ``semitangential``
            (docs/conventions.md). A mapping says it for each loaded point; the others are dead.
        read_points
            Further points whose displacement is wanted: `Solution.readings` holds `point` first.
        gravity
            (3,) m/s², base axes; None: what the machine file says.
        method
            ``fast`` or ``reference``.
        load_steps
            ``auto`` (adaptive continuation) or the number of equal steps.
        stiffness
            False: displacements, status, flags and iterations only; everything else is NaN. Quicker,
            above all under gravity.
        derivatives
            Effects ``(kind, {"element": ..., "legs": [...], parameter: value, ...})``: the machine is
            solved with all of them, and `Solution.derivatives` maps each parameter's name to the
            derivative of `displacement` (..., 6) at its value (docs/fast_path.md F10). A null value
            (`stiffmap effects`) differentiates at the machine as it is.
        threads
            None: all cores that this process may use.

        Notes
        -----
        Poses never raise: see `Solution.status`. Raises StiffmapError for bad input.
        """
        if derivatives:
            return self._differentiated(
                derivatives,
                position=position,
                wrench=wrench,
                rotation=rotation,
                point=point,
                wrenches=wrenches,
                load_type=load_type,
                read_points=read_points,
                gravity=gravity,
                method=method,
                load_steps=load_steps,
                stiffness=stiffness,
                threads=threads,
            )
        return self._solve(
            (),
            position,
            wrench,
            rotation,
            point,
            wrenches,
            load_type,
            read_points,
            gravity,
            method,
            load_steps,
            stiffness,
            threads,
        )[0]

    def _differentiated(self, requests: Sequence[Request], **call: Any) -> Solution:
        base, variations = base_and_variations(self._description, requests)
        machine = Machine(base)
        moved = [Machine(d) for v in variations for d in v.descriptions]
        solution, varied = machine._solve(tuple(moved), **call)
        self._fill(varied, solution, moved, call)
        out, i = {}, 0
        for v in variations:
            n = len(v.descriptions)
            out[v.name] = combine(v, solution.displacement, varied[..., i : i + n, :])
            i += n
        return replace(solution, derivatives=out)

    @staticmethod
    def _fill(varied: Floats, solution: Solution, moved: Sequence[Machine], call: dict[str, Any]) -> None:
        """Poses of the reference path: solve each variant in full."""
        if not np.isnan(varied[solution.ok]).any():
            return
        for i, m in enumerate(moved):
            full = m._solve((), **{**call, "stiffness": False})[0].displacement
            hole = np.isnan(varied[..., i, :])
            varied[..., i, :][hole] = full[hole]

    def _solve(
        self,
        variants: tuple[Machine, ...],
        position: ArrayLike,
        wrench: ArrayLike | None,
        rotation: ArrayLike | None,
        point: str,
        wrenches: Mapping[str, ArrayLike] | None,
        load_type: str | Mapping[str, str],
        read_points: Sequence[str],
        gravity: ArrayLike | None,
        method: str,
        load_steps: int | str,
        stiffness: bool,
        threads: int | None,
    ) -> tuple[Solution, Floats]:
        p = trailing(position, (3,), "position", "positions (m)")
        w = wrench_array(wrench)
        r = self._home_rotation
        if rotation is not None:
            r = trailing(rotation, (3, 3), "rotation", "rotation matrices")
            self._check_rotation(r)
        extra = {n: wrench_array(v, f"wrenches[{n!r}]") for n, v in (wrenches or {}).items()}
        shape = batch(p.shape[:-1], w.shape[:-1], r.shape[:-2], *(v.shape[:-1] for v in extra.values()))
        types = {point: load_type} if isinstance(load_type, str) else dict(load_type)
        for name, kind in types.items():
            if kind not in LOAD_TYPES:
                raise StiffmapError(f"load_type: expected one of {', '.join(LOAD_TYPES)}, got {kind!r}")
            if name not in (point, *extra):
                loaded = ", ".join((point, *extra))
                raise StiffmapError(f"load_type: no wrench acts at {name!r}, only at {loaded}")
        if method not in ("fast", "reference"):
            raise StiffmapError(f"method: expected 'fast' or 'reference', got {method!r}")
        for name in (point, *extra, *read_points):
            if name not in self.points:
                raise StiffmapError(f"point: expected one of {', '.join(self.points)}, got {name!r}")
        read = [point, *dict.fromkeys(r for r in read_points if r != point)]
        loads = rows(w, shape, (6,))[:, None]
        if extra:
            loads = np.stack([rows(v, shape, (6,)) for v in (w, *extra.values())], axis=1)
        answer = self._core.solve(
            self._plan if method == "fast" else None,  # type: ignore[arg-type]  # None: reference path
            rows(p, shape, (3,)),
            rows(r, shape, (3, 3)),
            np.ascontiguousarray(loads),
            [point, *extra],
            [LOAD_TYPES[types.get(name, "dead")] for name in (point, *extra)],
            read,
            self._gravity(gravity),
            self._steps(load_steps),
            thread_count(threads),
            stiffness,
            [m._plan for m in variants],
        )
        if read_points:
            order = [0, *(read.index(r) for r in read_points)]
            answer["displacement"] = answer["displacement"][:, order]
        varied = answer.pop("variants")
        return self._solution(answer, shape, point), varied.reshape(
            (*shape, -1, 6) if len(variants) else (0,)
        )

    @staticmethod
    def _check_rotation(r: Floats) -> None:
        finite = np.asarray(np.isfinite(r).all(axis=(-2, -1)))
        off = np.abs(np.swapaxes(r, -1, -2) @ r - np.eye(3)).max(axis=(-2, -1), initial=0)
        mirrored = np.linalg.det(np.where(finite[..., None, None], r, np.eye(3))) < 0
        bad = np.where(finite & ((off > 1e-9) | mirrored), np.maximum(off, 1e-300), 0.0)
        if np.any(bad):
            raise StiffmapError(
                f"rotation: expected rotation matrices, got one with |R^T R - I| = {np.max(bad):.1e}"
                f"{' and det < 0' if np.any(mirrored) else ''}"
            )

    def _gravity(self, gravity: ArrayLike | None) -> Floats:
        if gravity is None:
            return np.array(self._description.gravity or (0.0, 0.0, 0.0))
        g = np.asarray(gravity, dtype=float)
        if g.shape != (3,) or not np.isfinite(g).all():
            raise StiffmapError(f"gravity: expected 3 finite numbers (m/s², base axes), got {gravity!r}")
        return g

    @staticmethod
    def _steps(load_steps: int | str) -> int:
        if load_steps == "auto":
            return 0
        if isinstance(load_steps, bool) or not isinstance(load_steps, int) or load_steps < 1:
            raise StiffmapError(f"load_steps: expected 'auto' or a positive number, got {load_steps!r}")
        return load_steps

    def _solution(self, a: dict[str, Any], shape: tuple[int, ...], point: str) -> Solution:
        count = a["status"].shape[0]

        def out(key: str) -> Any:
            value = a[key]
            if value.shape[0] != count:  # not asked for
                fill = np.nan if value.dtype.kind == "f" else 0
                return np.broadcast_to(np.asarray(fill, value.dtype), shape + value.shape[1:])
            return value.reshape(shape + value.shape[1:])

        names = self._names
        readings = out("displacement")
        return Solution(
            displacement=np.ascontiguousarray(readings[..., 0, :]),
            stiffness=out("stiffness"),
            compliance=out("compliance"),
            status=out("status"),
            flags=out("flags"),
            free_twists=out("free_twists"),
            iterations=out("iterations"),
            actuator_effort=out("actuator_effort"),
            leg_wrench=out("leg_wrench"),
            readings=readings,
            point=point,
            actuators=names.actuators,
            legs=names.legs,
            coordinates=out("coordinates"),
            coordinate_names=names.coordinates,
            spring_index=names.springs,
            joint_index=names.joints,
            indeterminate_mask=out("indeterminate"),
        )

    def wrench(self, position: ArrayLike, displacement: ArrayLike, **options: Any) -> HeldMachine:
        """Wrenches that hold the machine at a `displacement` (..., 6) from the commanded pose, eq. (10).

        Options: rotation, point, gravity, threads, as in `stiffmap.inverse.imposed_displacement`.
        """
        from stiffmap.inverse import imposed_displacement

        return imposed_displacement(self, position, displacement, **options)

    def with_effect(
        self, kind: str, *, element: str | None = None, legs: Sequence[str] | None = None, **parameters: Any
    ) -> Machine:
        """A new machine with an effect added; see `stiffmap.effects`."""
        from stiffmap.effects import add_effect

        return Machine(add_effect(self._description, kind, element=element, legs=legs, **parameters))

    def save(self, path: str | PathLike[str]) -> None:
        """Write a machine file that loads back equal."""
        from stiffmap.files import save_description

        save_description(self._description, path)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Machine) and other._description == self._description

    def __hash__(self) -> int:
        return hash((self.name, len(self._description.legs)))

    def __reduce__(self) -> tuple[type[Machine], tuple[MachineDescription]]:
        return (Machine, (self._description,))

    def __repr__(self) -> str:
        return f"Machine({self.name!r}: legs {', '.join(self.legs)}; actuators {', '.join(self.actuators)})"


def load_machine(name_or_path: str | PathLike[str]) -> Machine:
    """Machine from a shipped name (`stiffmap machines` lists them) or a YAML file.

    Raises StiffmapError naming file, key, what was expected and what was found.
    """
    from stiffmap.files import load_description

    return Machine(load_description(name_or_path))
