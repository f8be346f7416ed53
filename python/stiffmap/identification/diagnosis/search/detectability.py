"""What the data could not see: the smallest effect that this experiment would have revealed."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy.optimize import brentq
from scipy.stats import chi2, ncx2

from stiffmap.identification.diagnosis.candidates.candidates import Candidate
from stiffmap.identification.diagnosis.search.screen import Screen

POWER = 0.95


@dataclass(frozen=True)
class Detectable:
    """Smallest size of each parameter (SI) that is found with 95 % power; None: not observable."""

    candidate: Candidate
    sizes: dict[str, float | None]


def detectable(screen: Screen, threshold: float) -> list[Detectable]:
    """One entry per candidate; `threshold` is the -ln p that the whole search demands."""
    out: dict[int, list[dict[str, float | None]]] = {}
    place: dict[int, Candidate] = {}
    for i, v in enumerate(screen.variants):
        rank = max(1, int(screen.rank[i]))
        length = _needed(threshold, rank)
        columns = screen.lengths(i)
        sizes = {
            p.name: _size(float(columns[k]), length, p.scale, p.upper - float(p.null or 0.0))
            for k, p in enumerate(v.candidate.linear)
        }
        place[id(v.candidate)] = v.candidate
        out.setdefault(id(v.candidate), []).append(sizes)
    return [Detectable(place[c], _middle(sizes)) for c, sizes in out.items()]


@cache
def _needed(threshold: float, freedom: int) -> float:
    """Length of the whitened effect that passes the threshold with 95 % power."""
    critical = float(chi2.isf(np.exp(-threshold), freedom))

    def short(nc: float) -> float:
        return float(ncx2.sf(critical, freedom, nc)) - POWER

    return float(np.sqrt(brentq(short, 1e-6, 10 * critical + 100)))


def _size(norm: float, length: float, scale: float, most: float) -> float | None:
    size = length / norm * scale if norm > 0 else np.inf
    return float(size) if size < most else None


def _middle(sizes: list[dict[str, float | None]]) -> dict[str, float | None]:
    """The median over shapes (periods)."""
    out: dict[str, float | None] = {}
    for name in sizes[0]:
        found = [s[name] for s in sizes if s[name] is not None]
        out[name] = float(np.median(np.array(found, dtype=float))) if found else None
    return out
