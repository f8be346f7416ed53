"""A machine tried over its box: without load, and under a small one."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import ArrayLike

from stiffmap.common.broadcasting import Floats
from stiffmap.solve.compiled import Status
from stiffmap.solve.machine import Machine
from stiffmap.solve.mobility import free_motions

INSIDE = (0.05, 0.5, 0.95)
"""Of the box, where it is tried: its very border may be the machine's own."""
TINY = 1e-5
"""Of the machine's length: what the trial load is to move the tool."""
SOFT, STIFF = 1e3, 1e10
"""N/m: a tool on a rubber band, and ten thousand newtons for a micrometre."""
WORDS = {
    Status.UNSTABLE: "unstable",
    Status.NOT_CONVERGED: "without an equilibrium that was found",
    Status.SINGULAR: "singular",
}


@dataclass(frozen=True)
class Trial:
    """What came out."""

    stiffness: tuple[float, float] | None
    """Lowest and highest stiffness (N/m) of the softest direction over the box; None where nothing could be solved."""
    force: float
    """N, of the trial load."""
    findings: list[str]


def tried(machine: Machine) -> Trial:
    """Home and 27 positions inside the box (fewer where fewer coordinates are commanded), free and under a load."""
    at = positions(machine)
    free = machine.solve(at, np.zeros(6))
    findings = _failed(machine, at, free.status, free.free_twists, "")
    good = np.asarray(free.ok)
    soft = np.full(len(at), np.nan)
    if good.any():
        part = free.compliance[good][:, :3, :3]
        soft[good] = np.linalg.eigvalsh((part + part.swapaxes(1, 2)) / 2)[:, -1]
    if not (np.nan_to_num(soft) > 0).any():
        return Trial(None, 0.0, findings)
    ends = (float(1 / np.nanmax(soft)), float(1 / np.nanmin(soft[soft > 0])))
    if ends[0] < SOFT:
        findings.append(
            f"very soft: {1e-3 * ends[0]:.2g} N move the tool by 1 mm; are compliances and lengths in the file's units?"
        )
    if ends[1] > STIFF:
        findings.append(
            f"very stiff: the tool moves by 1 µm under {1e-6 * ends[1]:.2g} N; are compliances in the file's units?"
        )
    force = TINY * machine.compiled.length / float(np.nanmax(soft))
    for axis, load in zip("xyz", force * np.eye(3, 6), strict=True):
        under = machine.solve(at[good], load)
        load_words = f"under {force:.2g} N along {axis} "
        findings += _failed(machine, at[good], under.status, under.free_twists, load_words)
    return Trial(ends, force, findings)


def positions(machine: Machine) -> Floats:
    """(n, 3) m: home, then the box in the commanded coordinates."""
    home = machine.description.home.p
    if machine.description.workspace is None:
        return np.asarray(home)[None]
    low, high = machine.workspace
    task = machine.description.task
    axes = [
        low[i] + np.array(INSIDE) * (high[i] - low[i]) if "xyz"[i] in task else np.array([home[i]])
        for i in range(3)
    ]
    return np.vstack([home, np.array(list(product(*axes)))])


def _failed(machine: Machine, at: Floats, status: ArrayLike, twists: Floats, load: str) -> list[str]:
    out = []
    for kind, word in WORDS.items():
        hit = np.flatnonzero(np.asarray(status) == kind)
        if not hit.size or (hit[0] == 0 and not load and kind == Status.SINGULAR):
            continue  # a singular home is said for itself
        where = ", ".join(f"{1e3 * v:g}" for v in np.round(at[hit[0]], 6))
        ways = free_motions(machine, twists[hit[0]]) if kind == Status.SINGULAR else []
        how = f": the platform can {'; '.join(ways)}" if ways else ""
        out.append(f"{load}{len(hit)} of {len(at)} positions tried are {word}, such as ({where}) mm{how}")
    return out
