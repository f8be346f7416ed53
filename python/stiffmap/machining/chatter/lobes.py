"""Stability lobes of a cut on a machine at one pose: what depth is stable at which speed (docs/vibration.md)."""

from __future__ import annotations

from collections.abc import Iterable
from math import pi
from os import PathLike
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from stiffmap.common.broadcasting import Floats, one_of, real_array, whole_number
from stiffmap.common.errors import StiffmapError
from stiffmap.common.rotations import as_rotations
from stiffmap.common.tasks import workers
from stiffmap.machining.chatter.cut import (
    ToolModes,
    cut_axes,
    milling_process,
    mode_rows,
    modes_of_machine,
    multiplier_map,
)
from stiffmap.machining.chatter.zero_order import (
    TOOL,
    at_periods,
    coupling_depth,
    frequencies_of,
    least_depth,
    limits,
)
from stiffmap.machining.process.description import Process
from stiffmap.machining.process.load import GivenProcess
from stiffmap.solve.machine import Machine, as_machine
from stiffmap.solve.options import keywords_of
from stiffmap.workspace.maps.inputs import rising, unit
from stiffmap.workspace.vibration.modes import tip_modes

METHODS = ("semi-discretization", "zero order")
SPEEDS, DEPTHS = 120, 80
PER_WAVE = 16
"""Intervals of a tooth period for each oscillation of the fastest mode in it."""
LEAST, MOST = 40, 320
LOOKS, CLOSE = 640, 4096
"""Depths of a diagram at which a limit is looked for, and parts of the step between two to which it is then found."""
PER_TASK = 8
"""Speeds of one task on a cluster."""
HIGHEST = 4.0
"""Top of a diagram, as a multiple of the least limit."""


@keywords_of(tip_modes)
def stability_lobes(
    machine: Machine | str | PathLike[str] | ToolModes | Iterable[object],
    process: GivenProcess,
    position: ArrayLike | None = None,
    *,
    speeds: ArrayLike | None = None,
    depths: ArrayLike | None = None,
    diagram: tuple[int, int] = (SPEEDS, DEPTHS),
    feed: ArrayLike | None = None,
    tool: ArrayLike | None = None,
    also: Iterable[object] = (),
    method: str = "semi-discretization",
    intervals: int | None = None,
    threads: int | None = None,
    scheduler: object = None,
    **pose: Any,
) -> xr.Dataset:
    """Stability of a cut over speeds of the spindle and depths.

    Parameters
    ----------
    machine
        Machine, name or file, whose modes at `position` are taken; or modes as of `floquet_multiplier`.
    process
        Tool, law and cut: a `Process`, a name, a file or a mapping.
    position
        (3,) m, base axes; None: the machine's home.
    speeds, depths
        (speed,) rad/s and (depth,) m, rising; None: around the process's speed, up to four times the least limit.
    diagram
        How many speeds and depths there are where they are not given.
    feed, tool
        (3,) directions of the feed, and from the tool's tip to its holder, base axes. None: the tool stands along the flange's
        axis (z of the machine's tool frame), and feeds along the first of x, y that goes across it.
    also
        Further modes in series with the machine's, of spindle and tool, in the axes of the cut.
    method
        ``semi-discretization``, or ``zero order`` (no multipliers).
    intervals
        Parts of a tooth period; None: enough for the fastest mode, 40 to 320.
    scheduler
        Address of a dask scheduler, or a `distributed.Client`: its workers take the speeds, with the same answer.
    **pose
        wrench, rotation, gravity, point, damping, modes, symmetrise: as of `frequency_response`.

    Returns
    -------
    Dataset
        `limit` (speed) m: least unstable depth, infinite where none on the diagram; `limit_zero_order` (speed) m;
        `multiplier` (speed, depth); attributes: `least` m and `frequency` Hz of zero order, `at_process` the
        multiplier at the speed and depth of the process, `limit_at_process` m up to which it is stable at that speed,
        `tool` and `feed` base axes, `coupling` m where modes couple
        without regeneration, `damping`, `stable_speeds` [rad/s, m]: where the limit has its largest values. Limits are the
        deepest that are known to be stable, never between two depths.

    Raises StiffmapError for bad input. Source: docs/theory.md, V4 to V6.
    """
    one_of(method, METHODS, "method")
    if np.shape(diagram) != (2,):
        raise StiffmapError(f"diagram: expected numbers of speeds and of depths, got {diagram!r}")
    if intervals is not None:
        whole_number(intervals, "intervals", 2, 10_000)
    for count in diagram:
        whole_number(count, "diagram", 2, what="numbers of speeds and of depths, 2 or more")
    if isinstance(machine, str | PathLike):
        machine = as_machine(machine)
    p = milling_process(process)
    along = flange(machine, pose.get("rotation")) if tool is None else unit(tool, "tool")
    ahead = np.eye(3)[int(abs(along[0]) >= np.sqrt(0.5))] if feed is None else unit(feed, "feed")
    modes, said = _modes(machine, position, cut_axes(ahead, along), pose)
    if extra := list(also):
        modes = modes.and_also(mode_rows(extra))
    modes = modes.below(np.inf)
    frequency = frequencies_of(modes.frequency)
    depth0, angle = limits(modes.receptance(frequency), p)
    least = least_depth(frequency, modes.receptance, p)
    speeds = p.spindle * np.linspace(0.25, 1.5, diagram[0]) if speeds is None else speeds
    s = rising(speeds, "speeds", "rising numbers above zero (rad/s)", above=0.0)
    top = HIGHEST * least if np.isfinite(least) else p.cut.axial
    usual = np.linspace(0, max(top, 1e-9), diagram[1] + 1)[1:]
    d = rising(usual if depths is None else depths, "depths", "rising numbers above zero (m)", above=0.0)
    zero = at_periods(frequency, depth0, angle, 2 * pi / (p.tool.teeth * s))
    own = np.array([p.spindle])
    ds = xr.Dataset(
        {"limit_zero_order": ("speed", zero, {"units": "m"})},
        coords={"speed": ("speed", s, {"units": "rad/s"}), "depth": ("depth", d, {"units": "m"})},
        attrs={
            "process": p.name, "method": method, "least": least, "damping": said, "modes": len(modes),
            "frequency": float(frequency[int(np.argmin(depth0.min(axis=-1)))]),
            "coupling": coupling_depth(modes, p),
            "at_process": float(multipliers_at(modes, p, own, np.array([p.cut.axial]), intervals, 1)[0, 0]),
            "limit_at_process": float(_limits_at(modes, p, own, d, multipliers_at(modes, p, own, d, intervals, 1), intervals)[0]),
            "tool": along.tolist(), "feed": ahead.tolist(),
            "helix": "left out: the tooth is straight" if p.tool.helix else "none",
        },
    )  # fmt: skip
    if method == "zero order":
        ds["limit"] = ds.limit_zero_order
    else:
        mu = multipliers_at(modes, p, s, d, intervals, threads, scheduler)
        ds["multiplier"] = (("speed", "depth"), mu)
        ds["limit"] = ("speed", _limits_at(modes, p, s, d, mu, intervals), {"units": "m"})
    ds.attrs["stable_speeds"] = pockets(s, ds.limit.values, d[-1])
    return ds


def flange(machine: object, rotation: ArrayLike | None) -> Floats:
    """(3,) from a tool's tip to its holder, base axes, the tool along z of the machine's tool frame: z points out of an arm's flange,
    and up, to the spindle, where at home it points up."""
    if not isinstance(machine, Machine):
        return np.array(TOOL)
    home = machine.description.home.r
    r = home if rotation is None else as_rotations(real_array(rotation, "rotation"))
    return np.asarray((1.0 if home[2, 2] > np.sqrt(0.5) else -1.0) * r[..., :, 2].reshape(-1, 3)[0])


def _limits_at(
    modes: ToolModes, p: Process, speed: Floats, depth: Floats, multiplier: Floats, intervals: int | None
) -> Floats:
    """(speeds,) m: `border`, found anew between its depth and the next, by parts and then by secants; itself stable."""
    out = border(depth, multiplier)
    ends = max(2, -(-LOOKS // len(depth))) + 1
    for i in np.flatnonzero(np.isfinite(out)):
        j = int(np.argmax(multiplier[i] >= 1))
        at, mu = np.r_[0.0, depth][j : j + 2], np.r_[0.0, multiplier[i]][j : j + 2]
        close, tried = (at[1] - at[0]) / CLOSE, np.linspace(at[0], at[1], ends)
        while at[1] - at[0] > close:
            tried = np.sort(tried[(tried > at[0]) & (tried < at[1])])
            found = multipliers_at(modes, p, speed[i : i + 1], tried, intervals, 1)[0]
            at, mu = np.r_[at[0], tried, at[1]], np.r_[mu[0], found, mu[1]]
            j = int(np.argmax(mu >= 1))
            at, mu = at[j - 1 : j + 1], mu[j - 1 : j + 1]
            root = at[0] + (1 - mu[0]) / (mu[1] - mu[0]) * (at[1] - at[0])
            tried = np.array([root - 0.4 * close, root + 0.4 * close, at.mean()])
        out[i] = at[0]
    return out


def _modes(
    machine: Machine | ToolModes | Iterable[object],
    position: ArrayLike | None,
    axes: Floats,
    pose: dict[str, Any],
) -> tuple[ToolModes, str]:
    if not isinstance(machine, Machine):
        if pose or position is not None:
            raise StiffmapError(
                "modes: a list of modes has no pose; position and its options are for a machine"
            )
        return mode_rows(machine), "of the modes as given"
    found = tip_modes(machine, machine.description.home.p if position is None else position, **pose)
    if len(found.square) != 1:
        raise StiffmapError(f"position: expected one pose for a diagram, got {len(found.square)}")
    return modes_of_machine(found).turned(axes), found.damping.said


def multipliers_at(
    modes: ToolModes,
    p: Process,
    speed: Floats,
    depth: Floats,
    intervals: int | None,
    threads: int | None,
    scheduler: object = None,
) -> Floats:
    """(speeds, depths) multipliers; parts of a tooth period: `intervals`, or as many as the fastest mode needs, 40, 80, 160 or 320."""
    waves = modes.frequency.max() * 2 * pi / (p.tool.teeth * speed)
    needed = 2 ** np.ceil(np.log2(np.clip(PER_WAVE * waves, LEAST, MOST) / LEAST)) * LEAST
    k = needed.astype(int) if intervals is None else np.full(len(speed), intervals)
    together = [np.flatnonzero(k == count) for count in np.unique(k)]
    if scheduler is not None:
        together = [rows[i : i + PER_TASK] for rows in together for i in range(0, len(rows), PER_TASK)]
    out = np.empty((len(speed), len(depth)))
    with workers(_some_speeds, (modes, p, depth, threads), scheduler=scheduler) as hands:
        for i, found in hands.as_done((speed[rows], int(k[rows[0]])) for rows in together):
            out[together[i]] = found
    return out


def _some_speeds(shared: tuple[ToolModes, Process, Floats, int | None], item: tuple[Floats, int]) -> Floats:
    """(speeds, depths) multipliers, as a task."""
    modes, p, depth, threads = shared
    return multiplier_map(modes, p, item[0], depth, item[1], threads)


def border(depth: Floats, multiplier: Floats) -> Floats:
    """(speeds,) m: deepest of the depths below the first that chatters, 0 where all do; infinite where none does."""
    over = multiplier >= 1
    safe = np.r_[0.0, depth][np.argmax(over, axis=1)]
    return np.where(over.any(axis=1), safe, np.inf)


def pockets(speed: Floats, limit: Floats, top: float) -> list[list[float]]:
    """[rad/s, m] of the five largest limits that are higher than their neighbours, the deepest first."""
    v = np.minimum(limit, top)
    peak = np.flatnonzero((v[1:-1] >= v[:-2]) & (v[1:-1] > v[2:])) + 1
    found = peak[np.argsort(-v[peak], kind="stable")][:5]
    return np.stack([speed[found], v[found]], axis=1).tolist()  # type: ignore[no-any-return]
