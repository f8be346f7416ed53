"""Whether a cut along a path chatters, and at which speeds of the spindle it does not (docs/vibration.md)."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi

import numpy as np

from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import StiffmapError
from stiffmap.machining.chatter.cut import milling_process
from stiffmap.machining.chatter.lobes import multipliers_at
from stiffmap.machining.chatter.modes import modes_of_machine
from stiffmap.machining.milling.setting import Setting
from stiffmap.machining.process import EndMill, Kienzle
from stiffmap.workspace.vibration.modes import tip_modes

PLACES, SPEEDS = 24, 61
SPAN = (0.5, 1.5)
"""Speeds that are tried, as multiples of the process's."""
CLEAR = 0.97
"""Multipliers of the speeds that are offered are below this."""


@dataclass(frozen=True, eq=False)
class PathStability:
    """Multipliers of the cut at places along a path, at the depth of the process."""

    way: Floats
    """(places,) m along the path."""
    multiplier: Floats
    """(places,) at the process's speed; above 1 the cut chatters."""
    speed: Floats
    """(speeds,) rad/s that were tried."""
    worst: Floats
    """(speeds,) largest multiplier along the path."""
    damping: str

    @property
    def unstable(self) -> int:
        """Number of places where the cut chatters."""
        return int((self.multiplier > 1).sum())

    @property
    def offered(self) -> Floats:
        """(k,) rad/s: up to five tried speeds that are stable all along the path, nearest to the process's first."""
        good = self.speed[self.worst < CLEAR]
        middle = self.speed[len(self.speed) // 2]
        return good[np.argsort(np.abs(good - middle), kind="stable")][:5]

    def sentence(self, spindle: float) -> str:
        """What it means, in words."""
        rpm = 60 / (2 * pi)
        if not self.unstable:
            return (
                f"The cut is stable at {len(self.way)} places along the path (largest multiplier "
                f"{self.multiplier.max():.3f}; damping {self.damping})."
            )
        text = (
            f"The cut chatters at {self.unstable} of {len(self.way)} places along the path (multiplier up to "
            f"{self.multiplier.max():.3f} at {spindle * rpm:.0f} rpm; damping {self.damping})."
        )
        if not self.offered.size:
            low, high = self.speed[[0, -1]] * rpm
            return f"{text} No speed from {low:.0f} to {high:.0f} rpm is stable everywhere: take less depth."
        return f"{text} Stable everywhere: {', '.join(f'{s * rpm:.0f}' for s in self.offered)} rpm."


def path_stability(job: Setting) -> PathStability | str:
    """Stability along a job's path; a sentence where it cannot be judged (no teeth, no masses)."""
    p = job.process
    if not isinstance(p.law, EndMill | Kienzle) or not p.tool.teeth:
        return "Stability is not judged: a coated tool has no teeth whose passes a chip could remember."
    p = milling_process(p)
    places = np.unique(np.linspace(0, len(job) - 1, PLACES).round().astype(int))
    try:
        turned = job.rotation[places]
        modes = tip_modes(job.machine, job.position[places], rotation=turned, threads=job.threads)
    except StiffmapError as problem:
        return f"Stability is not judged: {problem}"
    speed = p.spindle * np.linspace(*SPAN, SPEEDS)
    depth = np.array([p.cut.axial])
    kept, table = [], []
    for k, i in enumerate(places):
        if not np.isfinite(modes.rest[k, 0, 0]):
            continue
        own = modes_of_machine(modes, k).turned(job.axes[i]).below(np.inf)
        kept.append(i)
        table.append(multipliers_at(own, p, speed, depth, None, job.threads)[:, 0])
    if not table:
        return "Stability is not judged: no place along the path has an equilibrium."
    mu_all = np.array(table)
    at = SPEEDS // 2
    return PathStability(job.points.way[kept], mu_all[:, at], speed, mu_all.max(axis=0), modes.damping.said)
