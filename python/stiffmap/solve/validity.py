"""Region of validity of a calibrated machine: what its readings covered; beyond it nothing vouches for its numbers."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from stiffmap.common.broadcasting import Floats, Mask
from stiffmap.common.errors import StiffmapError
from stiffmap.model.description.tree import joints
from stiffmap.solve.labels import WRENCH
from stiffmap.solve.machine import Machine

KEY = "validity"
"""In `extra` of a machine file."""

SLACK = 0.05
"""Share of a range beyond its ends that still belongs to it."""

Range = tuple[float, float]


@dataclass(frozen=True)
class Validity:
    """Ranges that the readings covered and the error that held-out readings showed there, SI."""

    poses: int
    drives: Mapping[str, Range] = field(default_factory=dict)
    """Commanded coordinate of each drive, m or rad."""
    turning: frozenset[str] = frozenset()
    """Drives whose coordinate is an angle."""
    loads: Mapping[str, Range] = field(default_factory=dict)
    """Forces and moments that acted, N and N·m; none where no load acted."""
    temperature: Range | None = None
    """K, where it was recorded."""
    error: float | None = None
    """rms of readings that no fit saw, in `unit`; None where there were too few to say."""
    error_u: float = 0.0
    unit: str = "m"

    @staticmethod
    def of_machine(machine: Machine) -> Validity | None:
        """What the machine's file says; None where it was not calibrated.

        Raises:
            StiffmapError: `extra: validity` of the file is something else.
        """
        entry = dict(machine.description.extra).get(KEY)
        if entry is None:
            return None
        try:
            e = dict(entry)
            at = e.get("temperature")
            turns = frozenset(n for n, kind in kinds(machine).items() if kind != "prismatic")
            drives = {str(k): _pair(v) for k, v in dict(e.get("drives", ())).items()}
            loads = {str(k): _pair(v) for k, v in dict(e.get("loads", ())).items()}
            if not set(loads) <= set(WRENCH):
                raise ValueError
            error = e.get("error")
            return Validity(
                int(e["poses"]),
                drives,
                turns,
                loads,
                None if at is None else _pair(at),
                None if error is None else float(error),
                float(e.get("error_u", 0.0)),
                str(e.get("unit", "m")),
            )
        except (TypeError, ValueError, KeyError):
            raise StiffmapError(
                f"{machine.name}: extra: {KEY}: expected poses, and ranges [low, high] under drives (by name), loads "
                f"({', '.join(WRENCH)}) and temperature; found {entry!r}"
            ) from None

    def kept_by(self, machine: Machine) -> Machine:
        """The machine with this region in its file."""
        d = machine.description
        ranges = {"drives": tuple(self.drives.items()), "loads": tuple(self.loads.items())}
        entry: tuple[tuple[str, Any], ...] = (
            ("poses", self.poses),
            *((k, v) for k, v in ranges.items() if v),
        )
        if self.temperature is not None:
            entry += (("temperature", self.temperature),)
        if self.error is not None:
            entry += (("error", self.error), ("error_u", self.error_u), ("unit", self.unit))
        extra = (*(e for e in d.extra if e[0] != KEY), (KEY, entry))
        declared = None if d.declared is None else replace(d.declared, extra=extra)
        return Machine(replace(d, extra=extra, declared=declared), like=machine)

    def outside(
        self, machine: Machine, coordinates: Floats, wrench: Floats, temperature: Floats | None = None
    ) -> Mask:
        """(n,) rows beyond what was covered, each range by `SLACK` of its width.

        Coordinates (n, coordinates) are those of `machine`, m and rad, wrenches (n, 6) act at the tool. Rows without
        coordinates (NaN) are not beyond.
        """
        out = np.zeros(len(coordinates), bool)
        for name, v in drive_coordinates(machine, coordinates).items():
            out |= _beyond(v, self.drives.get(name))
        for i, name in enumerate(WRENCH):
            out |= _beyond(wrench[:, i], self.loads.get(name, (0.0, 0.0)))
        if self.temperature is not None and temperature is not None:
            out |= _beyond(temperature, self.temperature)
        return out

    def __str__(self) -> str:
        parts = []
        for name, (low, high) in self.drives.items():
            factor, unit = (180.0 / math.pi, "deg") if name in self.turning else (1e3, "mm")
            parts.append(f"{name} {_span(factor * low, factor * high)} {unit}")
        for name, (low, high) in self.loads.items():
            parts.append(f"{name} {_span(low, high)} {'N' if name[0] == 'f' else 'N·m'}")
        if not self.loads:
            parts.append("no load")
        if self.temperature is not None:
            parts.append(f"{self.temperature[0]:.4g} to {self.temperature[1]:.4g} K")
        return f"{self.poses} poses, {', '.join(parts)}"


def drive_coordinates(machine: Machine, coordinates: Floats) -> dict[str, Floats]:
    """(n,) of each drive, by its name, of coordinates (n, coordinates)."""
    names = machine.compiled.names.joints
    return {a: coordinates[:, names[a]] for a in machine.actuators if a in names}


def kinds(machine: Machine) -> dict[str, str]:
    """Kind of joint of each drive."""
    known = joints(machine.description)
    return {a: known[a].kind for a in machine.actuators if a in known}


def range_of(values: Floats) -> Range:
    """Least and largest finite value."""
    good = values[np.isfinite(values)]
    return (float(good.min()), float(good.max())) if good.size else (0.0, 0.0)


def _span(low: float, high: float) -> str:
    low, high = round(low, 9) + 0.0, round(high, 9) + 0.0
    return f"{low:.4g}" if low == high else f"{low:.4g} to {high:.4g}"


def _pair(values: Any) -> Range:
    low, high = values
    if not float(low) <= float(high):
        raise ValueError
    return float(low), float(high)


def _beyond(values: Floats, covered: Range | None) -> Mask:
    if covered is None:
        return np.zeros(len(values), bool)
    low, high = covered
    slack = SLACK * (high - low) + 1e-12
    return np.asarray((values < low - slack) | (values > high + slack))
