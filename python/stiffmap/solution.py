"""Answer of `Machine.solve`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stiffmap.status import Flag, Status

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Solution:
    """Equilibria of a batch of poses; SI, base axes, linear part first, leading batch axes (...).

    Failed poses hold NaN and their status.
    """

    displacement: Floats
    """(..., 6) m, rad: of `point` against the commanded pose, rotation as a rotation vector."""
    stiffness: Floats
    """(..., 6, 6) small extra twist to small extra dead wrench, both at `point`."""
    compliance: Floats
    """(..., 6, 6) small extra dead wrench to small extra twist, both at `point`."""
    status: NDArray[np.uint8]
    """(...) of `Status`."""
    flags: NDArray[np.uint32]
    """(...) bits of `Flag`."""
    free_twists: Floats
    """(..., 6, 6) columns: twists without stiffness where the platform is singular, else NaN."""
    iterations: NDArray[np.int32]
    """(...) Newton iterations."""
    actuator_effort: Floats
    """(..., actuators) N or N·m: drive on the leg, positive along the coordinate."""
    leg_wrench: Floats
    """(..., legs, 6) leg on platform at `point`."""
    readings: Floats
    """(..., read points, 6) displacement of every point asked for."""
    point: str
    actuators: tuple[str, ...]
    legs: tuple[str, ...]
    coordinates: Floats = field(repr=False)
    """(..., coordinates) all coordinates, in the order of `coordinate_names`."""
    coordinate_names: tuple[str, ...] = field(repr=False)
    spring_index: Mapping[str, int] = field(repr=False)
    joint_index: Mapping[str, int] = field(repr=False)
    indeterminate_mask: NDArray[np.uint8] = field(repr=False)
    derivatives: Mapping[str, Any] = field(default_factory=dict, repr=False)

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
    def ok(self) -> NDArray[np.bool_]:
        """(...) where the status is CONVERGED."""
        return np.asarray(self.status == Status.CONVERGED)

    def count(self) -> dict[str, int]:
        """Number of poses per status."""
        return {s.name: int((self.status == s).sum()) for s in Status if (self.status == s).any()}

    def _repr_html_(self) -> str:
        rows = "".join(f"<tr><td>{n}</td><td>{c}</td></tr>" for n, c in self.count().items())
        worst = np.linalg.norm(self.displacement[..., :3], axis=-1)
        top = f"{1e3 * np.nanmax(worst):.4f} mm" if np.isfinite(worst).any() else "none"
        return (
            f"<b>stiffmap solution</b>: {self.status.size} poses at point {self.point}, "
            f"largest displacement {top}<table>{rows}</table>"
        )

    def __str__(self) -> str:
        flags = int(np.bitwise_or.reduce(self.flags.ravel())) if self.flags.size else 0
        states = ", ".join(f"{n} {c}" for n, c in self.count().items()) or "no poses"
        return f"Solution of {self.status.size} poses at {self.point}: {states}; flags {Flag(flags)!r}"
