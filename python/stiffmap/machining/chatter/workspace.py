"""Vibration over many poses: lowest frequency, dynamic stiffness, softest direction, limiting depth (docs/vibration.md)."""

from __future__ import annotations

from os import PathLike
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from stiffmap.common.broadcasting import Floats, trailing
from stiffmap.common.tasks import workers
from stiffmap.machining.chatter.cut import cut_axes, milling_process
from stiffmap.machining.chatter.zero_order import FEED, TOOL, frequencies_of, least_depth
from stiffmap.machining.process.description import Process
from stiffmap.machining.process.load import GivenProcess
from stiffmap.solve.labels import batch_dims
from stiffmap.solve.machine import Machine, as_machine
from stiffmap.solve.options import keywords_of
from stiffmap.workspace.vibration.modes import TipModes, tip_modes
from stiffmap.workspace.vibration.response import frequency_axis, receptance

POINTS, BLOCK = 300, 256
LOW, HIGH, LOOKED = 0.3, 2.0, 6
"""The default frequencies reach from the lowest mode to the highest of the first six, with these factors."""


@keywords_of(tip_modes)
def vibration_map(
    machine: Machine | str | PathLike[str],
    position: ArrayLike,
    process: GivenProcess | None = None,
    *,
    frequencies: ArrayLike | None = None,
    feed: ArrayLike = FEED,
    tool: ArrayLike = TOOL,
    modes: int = 24,
    scheduler: object = None,
    **pose: Any,
) -> xr.Dataset:
    """How the machine vibrates over its workspace.

    Parameters
    ----------
    position
        (..., 3) m, commanded TCP, base axes.
    process
        Tool, law and cut, for the limiting depth; None: that is left out.
    frequencies
        (frequency,) Hz at which it is looked at; None: around the first six modes of all poses.
    feed, tool
        (3,) directions of the feed and from the tool's tip to its holder, base axes.
    modes
        Modes that are kept at each pose.
    scheduler
        Address of a dask scheduler, or a `distributed.Client`: its workers take the poses, with the same answer.
    **pose
        wrench, rotation, gravity, point, damping, symmetrise, threads: as of `frequency_response`.

    Returns
    -------
    Dataset
        Over the batch axes of `position`: `lowest_frequency` Hz; `dynamic_stiffness` N/m, least over frequencies and
        directions; `at_frequency` Hz of it; `softest_direction` (..., axis) of that force, base axes; `limiting_depth` m over all
        speeds, zero order; `status`. NaN where a pose failed.

    Raises StiffmapError for bad input, never for a pose. Source: docs/theory.md, V1 to V4.
    """
    machine = as_machine(machine)
    p = trailing(position, (3,), "position", "positions (m)")
    cut = None if process is None else milling_process(process)
    axes = cut_axes(feed, tool)
    found = tip_modes(machine, p, modes=modes, **pose)
    f = _around(found) if frequencies is None else frequency_axis(frequencies)
    n = len(found.square)
    stiffness, at, depth = np.full(n, np.nan), np.full(n, np.nan), np.full(n, np.nan)
    way = np.full((n, 3), np.nan)
    blocks = [np.arange(k, min(n, k + BLOCK)) for k in range(0, n, BLOCK)]
    blocks = [rows[np.isfinite(found.rest[rows, 0, 0])] for rows in blocks]
    blocks = [rows for rows in blocks if rows.size]
    with workers(_block, (f, axes, cut), scheduler=scheduler) as hands:
        for i, some in hands.as_done(found.only(rows) for rows in blocks):
            rows = blocks[i]
            stiffness[rows], at[rows], way[rows], depth[rows] = some
    shape = p.shape[:-1]
    dims = batch_dims(len(shape))
    lowest = np.where(np.isfinite(found.rest[:, 0, 0]), found.frequency.min(axis=1, initial=np.inf), np.nan)
    values = {
        "lowest_frequency": (lowest, "Hz"),
        "dynamic_stiffness": (stiffness, "N/m"),
        "at_frequency": (at, "Hz"),
    }
    if cut is not None:
        values["limiting_depth"] = (depth, "m")
    ds = xr.Dataset(
        {k: (dims, v.reshape(shape), {"units": u}) for k, (v, u) in values.items()},
        coords={"position": ((*dims, "axis"), p), "axis": ["x", "y", "z"]},
        attrs={"machine": machine.name, "damping": found.damping.said},
    )
    ds["softest_direction"] = ((*dims, "axis"), way.reshape(*shape, 3))
    ds["status"] = (dims, found.status.reshape(shape))
    if cut is not None:
        ds.attrs["process"] = cut.name
    return ds


def _block(
    shared: tuple[Floats, Floats, Process | None], some: TipModes
) -> tuple[Floats, Floats, Floats, Floats | float]:
    """Dynamic stiffness, its frequency and direction, and the limiting depth of some poses, as a task."""
    f, axes, cut = shared
    H = receptance(some, f)[:, :, :3, :3]
    largest = np.linalg.eigvalsh(H.conj().transpose(0, 1, 3, 2) @ H)[..., -1]
    peak = np.argmax(largest, axis=1)
    here = np.arange(len(H))
    at_peak = H[here, peak]
    way = _real(np.linalg.eigh(at_peak.conj().transpose(0, 2, 1) @ at_peak)[1][:, :, -1])
    depth: Floats | float = np.nan
    if cut is not None:
        depth = np.array([_limit(some.only(here[i : i + 1]), axes, cut) for i in here])
    return 1 / np.sqrt(largest[here, peak]), f[peak], way, depth


def _limit(one: TipModes, axes: Floats, cut: Process) -> float:
    """m: limiting depth of one pose."""
    f = frequencies_of(one.frequency[np.isfinite(one.frequency)])
    return least_depth(f, lambda x: axes @ receptance(one, x)[0, :, :3, :3] @ axes.T, cut)


def _around(found: TipModes) -> Floats:
    """Hz: from below the lowest mode to above the sixth, at all poses."""
    each = found.frequency[:, :LOOKED]
    each = each[np.isfinite(each)]
    if not each.size:
        return np.array([1.0, 10.0, 100.0])
    return np.geomspace(LOW * each.min(), HIGH * each.max(), POINTS)


def _real(v: np.ndarray) -> Floats:
    """(n, 3) the real direction nearest to complex ones, its largest component positive."""
    size = (v**2).sum(axis=1, keepdims=True)
    turned = (v * np.exp(-0.5j * np.angle(size))).real
    turned /= np.linalg.norm(turned, axis=1, keepdims=True)
    first = np.take_along_axis(turned, np.abs(turned).argmax(axis=1)[:, None], axis=1)
    return np.asarray(turned * np.sign(first))
