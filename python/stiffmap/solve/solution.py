"""Answer of `Machine.solve`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from stiffmap.common.broadcasting import Floats
from stiffmap.common.json_text import plain
from stiffmap.solve.closing import Kinematics
from stiffmap.solve.compiled import Answer, Flag, Names, Status, counted
from stiffmap.solve.labels import OverPoses, solution_dataset
from stiffmap.solve.status import status_of_one

if TYPE_CHECKING:
    import xarray as xr

Slopes = Mapping[str, Mapping[str, Floats]]  # quantity -> name of the variable -> derivative
FIELDS = (
    "displacement",
    "stiffness",
    "compliance",
    "status",
    "flags",
    "free_twists",
    "iterations",
    "actuator_effort",
    "leg_wrench",
    "coordinates",
    "indeterminate",
)


class Solution(OverPoses):
    """Equilibria of a batch of poses; SI, base axes, linear part first, leading batch axes (...).

    Poses that failed hold NaN and their status; UNSTABLE ones keep the numbers of their equilibrium, which is no minimum of the
    energy. Arrays are made when they are first asked for.
    """

    __slots__ = ("_answer", "_made", "_names", "_order", "_shape", "_slopes", "point", "unloaded")

    point: str
    """Point where the wrench acts and displacement, stiffness and compliance are."""
    unloaded: Kinematics | None
    """TCP pose and coordinates before any load, of `Machine.solve_joints` and `Machine.solve(start=...)`."""

    def __init__(
        self,
        answer: Answer,
        shape: tuple[int, ...],
        names: Names,
        point: str,
        order: tuple[int, ...] = (0,),
        slopes: Slopes | None = None,
        unloaded: Kinematics | None = None,
    ) -> None:
        self._answer = answer
        self._shape = shape
        self._names = names
        self._order = order
        self._made: dict[str, NDArray[Any]] | None = None
        self.point = point
        self._slopes: Slopes = slopes or {}
        self.unloaded = unloaded

    def _array(self, name: str) -> NDArray[Any]:
        if self._made is None:
            self._made = {}
        if name not in self._made:
            a: NDArray[Any] = getattr(self._answer, name)
            shape = self._shape + a.shape[1:]
            if a.shape[0] == self._answer.status.shape[0]:
                self._made[name] = a.reshape(shape)
            else:  # not asked for
                self._made[name] = np.broadcast_to(
                    np.asarray(np.nan if a.dtype.kind == "f" else 0, a.dtype), shape
                )
        return self._made[name]

    def _with_derivatives(self, slopes: Slopes) -> Solution:
        return Solution(
            self._answer, self._shape, self._names, self.point, self._order, slopes, self.unloaded
        )

    def __reduce__(self) -> tuple[Any, ...]:
        arrays = SimpleNamespace(**{name: getattr(self._answer, name) for name in FIELDS})
        told = (self._shape, self._names, self.point, self._order, self._slopes, self.unloaded)
        return Solution, (arrays, *told)

    @property
    def readings(self) -> Floats:
        """(..., read points, 6) m, rad: displacement of every point asked for, `point` first."""
        read: Floats = self._array("displacement")
        return read if self._order == tuple(range(read.shape[-2])) else read[..., self._order, :]

    @property
    def displacement(self) -> Floats:
        """(..., 6) m, rad: of `point` against the commanded pose, rotation as a rotation vector."""
        return np.ascontiguousarray(self._array("displacement")[..., 0, :])

    @property
    def stiffness(self) -> Floats:
        """(..., 6, 6) N/m, N·m/rad: small extra twist to small extra dead wrench, both at `point`."""
        return self._array("stiffness")

    @property
    def compliance(self) -> Floats:
        """(..., 6, 6) m/N, rad/(N·m): small extra dead wrench to small extra twist, both at `point`."""
        return self._array("compliance")

    @property
    def status(self) -> NDArray[np.uint8]:
        """(...) of `Status`."""
        return self._array("status")

    @property
    def flags(self) -> NDArray[np.uint32]:
        """(...) bits of `Flag`."""
        return self._array("flags")

    @property
    def free_twists(self) -> Floats:
        """(..., 6, 6) m, rad; columns: twists without stiffness where the platform is singular, else NaN."""
        return self._array("free_twists")

    @property
    def iterations(self) -> NDArray[np.int32]:
        """(...) number of Newton iterations."""
        return self._array("iterations")

    @property
    def actuator_effort(self) -> Floats:
        """(..., actuators) N or N·m: drive on the leg, positive along the coordinate."""
        return self._array("actuator_effort")

    @property
    def tension(self) -> Floats:
        """(..., cables) N: of each cable, 0 where it is slack, in the order of `cables`."""
        columns = [self._names.actuators.index(n) for n in self._names.cables]
        return -self.actuator_effort[..., columns] + 0.0

    @property
    def leg_wrench(self) -> Floats:
        """(..., legs, 6) N, N·m: leg on platform at `point`."""
        return self._array("leg_wrench")

    @property
    def coordinates(self) -> Floats:
        """(..., coordinates) m or rad: all coordinates, in the order of `coordinate_names`."""
        return self._array("coordinates")

    @property
    def indeterminate_mask(self) -> NDArray[np.uint8]:
        """(..., coordinates) 1 where a pose leaves the coordinate open."""
        return self._array("indeterminate")

    @property
    def actuators(self) -> tuple[str, ...]:
        """Names along the last axis of `actuator_effort`."""
        return self._names.actuators

    @property
    def cables(self) -> tuple[str, ...]:
        """Names along the last axis of `tension`."""
        return self._names.cables

    @property
    def legs(self) -> tuple[str, ...]:
        """Names along the legs' axis of `leg_wrench`."""
        return self._names.legs

    @property
    def coordinate_names(self) -> tuple[str, ...]:
        """Names along the last axis of `coordinates`."""
        return self._names.coordinates

    @property
    def spring_index(self) -> Mapping[str, int]:
        """Full name of each link spring -> its first of six coordinates."""
        return self._names.springs

    @property
    def joint_index(self) -> Mapping[str, int]:
        """Full name of each actuator and passive joint -> its coordinate."""
        return self._names.joints

    @property
    def spring_deflection(self) -> dict[str, Floats]:
        """Full name of each link spring -> (..., 6) m, rad in its own coordinates (t, phi)."""
        return {n: self.coordinates[..., i : i + 6] for n, i in self.spring_index.items()}

    @property
    def joint_coordinates(self) -> dict[str, Floats]:
        """Full name of each actuator and passive joint -> (...) m or rad."""
        return {n: self.coordinates[..., i] for n, i in self.joint_index.items()}

    @property
    def indeterminate(self) -> dict[str, NDArray[np.bool_]]:
        """Passive joints that some pose leaves open (free spin, singular leg) -> (...) where."""
        mask = self.indeterminate_mask.astype(bool)
        return {n: mask[..., i] for n, i in self.joint_index.items() if mask[..., i].any()}

    @property
    def derivatives(self) -> Mapping[str, Floats]:
        """Name of each variable of `Machine.solve(derivatives=...)` -> (..., 6) slope of `displacement`, m and rad per SI unit."""
        return self._slopes.get("displacement", {})

    @property
    def stiffness_derivatives(self) -> Mapping[str, Floats]:
        """The same of `stiffness` (..., 6, 6) N/m, N·m/rad per SI unit, where `derivatives_of` names it."""
        return self._slopes.get("stiffness", {})

    @property
    def compliance_derivatives(self) -> Mapping[str, Floats]:
        """The same of `compliance` (..., 6, 6) m/N, rad/(N·m) per SI unit, where `derivatives_of` names it."""
        return self._slopes.get("compliance", {})

    @property
    def ok(self) -> NDArray[np.bool_]:
        """(...) where the status is CONVERGED."""
        return np.asarray(self.status == Status.CONVERGED)

    @property
    def reference_share(self) -> float:
        """Share of poses that the fast path left to the reference path: as good, a thousand times dearer."""
        return float(np.mean(self.flags & Flag.REFERENCE_PATH != 0)) if self.flags.size else 0.0

    def to_xarray(
        self, dims: Sequence[str] | None = None, coords: Mapping[str, Any] | None = None
    ) -> xr.Dataset:
        """The answer as a labelled Dataset (SI).

        `dims` names the batch axes (...), one name each; None: ``pose`` for one axis, ``pose_0``, ``pose_1``, … for several.
        `coords` are coordinates of the Dataset, such as the positions along an axis. Variables: displacement (…, component),
        deflection (norm of the translation, m), stiffness (…, wrench_component, component), compliance (…, component,
        wrench_component), status, flags, iterations, actuator_effort (…, actuator; N or N·m), leg_wrench (…, leg,
        wrench_component), tension (…, cable; N) where there are cables, and coordinates (…, coordinate; m or rad).
        StiffmapError where the number of names is not that of the axes.
        """
        return solution_dataset(self, dims, coords)

    def as_plain(self) -> dict[str, Any]:
        """Data of JSON of one pose, SI; StiffmapError for several."""
        data = {
            "point": self.point,
            "status": status_of_one(self.status).name,
            "flags": [f.name for f in Flag(int(self.flags))],
            "displacement": self.displacement,
            "stiffness": self.stiffness,
            "compliance": self.compliance,
            "actuator_effort": dict(zip(self.actuators, self.actuator_effort, strict=True)),
            "leg_wrench": dict(zip(self.legs, self.leg_wrench, strict=True)),
            "joint_coordinates": self.joint_coordinates,
            "spring_deflection": self.spring_deflection,
            "indeterminate": list(self.indeterminate),
        }
        return dict(plain(data))

    def count(self) -> dict[str, int]:
        """Number of poses per status."""
        return counted(self.status)

    def _repr_html_(self) -> str:
        rows = "".join(f"<tr><td>{n}</td><td>{c}</td></tr>" for n, c in self.count().items())
        worst = np.where(self.ok, np.linalg.norm(self.displacement[..., :3], axis=-1), np.nan)
        top = f"{1e3 * np.nanmax(worst):.4f} mm" if np.isfinite(worst).any() else "none"
        return (
            f"<b>stiffmap solution</b>: {self.status.size} poses at point {self.point}, "
            f"largest displacement {top}<table>{rows}</table>"
        )

    def __repr__(self) -> str:
        flags = int(np.bitwise_or.reduce(self.flags.ravel())) if self.flags.size else 0
        states = ", ".join(f"{c} {n}" for n, c in self.count().items()) or "no poses"
        names = [f.name or "" for f in Flag if f & flags]
        return f"<Solution at {self.point}: {states}{'; ' if names else ''}{', '.join(names)}>"
