"""Intervals and verdicts of `stiffmap process` over simulated dynamometers: python -m bench.force_laws --count 400

Forces come from a sum over angles that shares no code with stiffmap. Prints, per law, cut, number of feeds and noise (share of the
mean force), how often the 95 % intervals hold the truth and, with --verdicts, how often the true law is refused or the only one left.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from typing import Any

import numpy as np

from stiffmap.machining.process import identify_process
from stiffmap.machining.process.identify.models import KIENZLE, STRAIGHT, fit
from stiffmap.machining.process.identify.table import read_table

FEEDS = (0.025, 0.05, 0.075, 0.1, 0.125)
MILL = {"Ktc": 958.8, "Kte": 15.75, "Krc": 251.1, "Kre": 19.42, "Kac": 146.4, "Kae": 18.21}
POWER = {"Kt": 624.0, "Kr": 108.6, "Ka": 58.0, "mt": 0.25, "mr": 0.45, "ma": 0.5}
TRUTH = {"straight": MILL, "Kienzle": POWER}
TEETH, DEPTH, WIDTH, RADIUS = 2, 3.0, 8.0, 12.5


def forces(law: str, h: Any) -> list[Any]:
    """N/mm of edge, tangential, radial, axial, at chips h (mm)."""
    k = list(TRUTH[law].values())
    if law == "straight":
        return [np.where(h > 0, k[2 * i] * h + k[2 * i + 1], 0.0) for i in range(3)]
    return [k[i] * h ** (1 - k[3 + i]) for i in range(3)]


def mean(law: str, side: str, feed: float, steps: int = 4000) -> Any:
    """(3,) N, mean force of a cut: a sum over the engaged arc."""
    arc = np.arccos(1 - WIDTH / RADIUS)
    first, last = {"slot": (0, np.pi), "climb": (np.pi - arc, np.pi), "conventional": (0, arc)}[side]
    phi = first + (last - first) * (np.arange(steps) + 0.5) / steps
    t, r, a = forces(law, feed * np.sin(phi))
    each = [-t * np.cos(phi) - r * np.sin(phi), t * np.sin(phi) - r * np.cos(phi), a]
    return np.sum(each, axis=1) * DEPTH * TEETH * (last - first) / steps / (2 * np.pi)


def signals(feed: float, offset: float, steps: int, turns: int) -> Any:
    """(steps * turns, 3) N over time: a slot, two straight teeth, one `offset` (mm) further out than the axis, one less."""
    out = np.zeros((steps, 3))
    for sign, start in ((1, 0.0), (-1, np.pi)):
        for k in range(steps):
            sub = 2 * np.pi * (k + (np.arange(20) + 0.5) / 20) / steps - start
            h = np.minimum(feed * np.sin(sub) + 2 * sign * offset, 2 * feed * np.sin(sub))
            h = np.where(np.sin(sub) > 0, np.maximum(h, 0.0), 0.0)
            t, r, a = forces("straight", h)
            force = [-t * np.cos(sub) - r * np.sin(sub), t * np.sin(sub) - r * np.cos(sub), a]
            out[k] += DEPTH * np.mean(force, axis=1)
    return np.tile(out, (turns, 1))


def table(force: Any, feeds: Any, side: str) -> dict[str, Any]:
    """Columns of means."""
    cut = {"teeth": TEETH, "axial_mm": DEPTH, "side": side, "radial_mm": WIDTH, "diameter_mm": 2 * RADIUS}
    return {"feed_per_tooth_mm": feeds, **dict(zip(("Fx_N", "Fy_N", "Fz_N"), force.T, strict=True)), **cut}


def noisy(law: str, side: str, feeds: Any, noise: float, count: int, seed: int) -> Iterator[dict[str, Any]]:
    """Tables with noise as a share of each axis' mean force."""
    rng = np.random.default_rng(seed)
    clean = np.array([mean(law, side, c) for c in feeds])
    scale = noise * np.abs(clean).mean(axis=0)
    for _ in range(count):
        yield table(clean + rng.normal(size=clean.shape) * scale, feeds, side)


def si(name: str) -> float:
    """Size of the unit of a number of the truth."""
    return 1.0 if name[0] == "m" else 1e3 if name[-1] == "e" else 1e6


def coverage(law: str, tables: Iterator[dict[str, Any]]) -> tuple[float, int]:
    """Share of intervals that hold the truth, and their number."""
    model, hits = {"straight": STRAIGHT, "Kienzle": KIENZLE}[law], []
    for t in tables:
        found = fit(model, read_table(t)).numbers
        hits += [found[n][2] <= v * si(n) <= found[n][3] for n, v in TRUTH[law].items()]
    return float(np.mean(hits)), len(hits)


def verdicts(law: str, tables: Iterator[dict[str, Any]]) -> tuple[float, float]:
    """How often the true law is refused, and how often it alone is left."""
    names = [[e.model.name for e in identify_process(t).alike] for t in tables]
    return float(np.mean([law not in n for n in names])), float(np.mean([n == [law] for n in names]))


def runout_coverage(offset: float, noise: float, count: int, seed: int) -> float:
    """Share of intervals of the run-out (mm) that hold the truth; noise in N of a sample."""
    rng, steps, turns, hits = np.random.default_rng(seed), 100, 6, 0
    clean = [(c, signals(c, offset, steps, turns)) for c in FEEDS[1:]]
    for _ in range(count):
        force = np.concatenate([f + rng.normal(0, noise, f.shape) for _, f in clean])
        feed = np.repeat([c for c, _ in clean], steps * turns)
        time = np.tile(np.arange(steps * turns) / steps / 100, len(clean))
        found = identify_process({**table(force, feed, "slot"), "time_s": time, "spindle_rpm": 6000}).runout
        assert found is not None
        hits += found.interval[0] <= 1e-3 * offset <= found.interval[1]
    return hits / count


def main() -> None:
    """All cases."""
    ask = argparse.ArgumentParser()
    ask.add_argument("--count", type=int, default=400)
    ask.add_argument("--seed", type=int, default=1)
    ask.add_argument("--verdicts", action="store_true")
    ask.add_argument("--laws", default="straight,Kienzle,run-out")
    a = ask.parse_args()
    laws = a.laws.split(",")
    for law, side, feeds, noise in [
        (law, side, feeds, noise)
        for law in TRUTH
        if law in laws
        for side in ("slot", "climb", "conventional")
        for feeds in (FEEDS, FEEDS * 2)
        for noise in (0.02, 0.15)
    ]:
        made = noisy(law, side, list(feeds), noise, a.count, a.seed)
        what = f"{law}, {side}, {len(feeds)} cuts, noise {noise:.0%}"
        if a.verdicts:
            refused, alone = verdicts(law, made)
            print(f"{what}: refused {refused:.3f}, alone {alone:.3f}", flush=True)
        else:
            share, many = coverage(law, made)
            print(f"{what}: {share:.4f} of {many}", flush=True)
    for offset, noise in [(o, n) for o in (0.0, 0.004, 0.012) for n in (2.0, 40.0) if "run-out" in laws]:
        share = runout_coverage(offset, noise, a.count, a.seed)
        print(f"run-out {1e3 * offset:g} um, noise {noise:g} N: {share:.4f} of {a.count}", flush=True)


if __name__ == "__main__":
    main()
