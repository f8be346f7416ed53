"""Monte Carlo of the link identification under independent noise: the numbers behind docs/link.md §5.

python bench/link_monte_carlo.py [--runs 4000] [--scheduler tcp://HOST:8786]
"""

from __future__ import annotations

import argparse
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.stats import nct

from stiffmap.common.broadcasting import Floats
from stiffmap.common.tasks import workers
from stiffmap.model.link.identify import identify_link
from stiffmap.model.link.result import critical_multiple

L, EIZ, EIY, EA, GJ = 0.31, 43.0, 205.0, 6.8e6, 10.8
REFERENCE = np.array([L, 0.0, 0.0])
WRENCHES = np.diag([1000.0, 10.0, 10.0, 1.0, 1.0, 1.0])
TOGETHER = 20
"""Runs of one task."""


def miss_probability(
    true_entry: ArrayLike, error: ArrayLike, dof: Floats | float, level: float, tests: int
) -> Floats:
    """Probability that an entry of this true size is declared zero: noncentral t, link (9).

    At ``true_entry = 0`` it is ``1 - level / tests``.
    """
    k, shift = critical_multiple(level, tests, dof), np.asarray(true_entry) / np.asarray(error)
    # Beyond 1e6 degrees of freedom t is normal to 1e-6 and nct loses accuracy.
    nu = np.minimum(np.asarray(dof, dtype=float), 1e6)
    return np.asarray(nct.cdf(k, nu, shift) - nct.cdf(-k, nu, shift))


def main() -> None:
    """Print variance of the z-scores, coverage, and both error rates of the zero test."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=4000)
    parser.add_argument("--seed", type=int, default=2024)
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    parser.add_argument("--scheduler", help="address of a dask scheduler whose workers take the runs")
    arguments = parser.parse_args()
    runs = arguments.runs
    found = run(runs, arguments.seed, scheduler=arguments.scheduler, jobs=arguments.jobs)
    variance = np.var(found["z"], axis=0)[np.triu_indices(6)]
    coverage = np.mean(found["covered"], axis=0)[np.triu_indices(6)]
    predicted = float(miss_probability(3.0, 1.0, 6 * (3 * 24 - 6), 0.05, 21))
    wrong, missed = found["wrong"].mean(), found["missed"].mean()
    print(f"{runs} runs, 24 nodes, 6 cases")
    print(f"variance of the z-scores of 21 entries: {variance.min():.3f} to {variance.max():.3f} (1)")
    print(f"coverage of 95 %: {coverage.min():.4f} to {coverage.max():.4f}, mean {coverage.mean():.4f}")
    print(f"a true zero taken for non-zero, per matrix: {wrong:.4f} (at most 0.0286)")
    print(f"an entry of 3 standard errors called zero: {missed:.4f} (predicted {predicted:.4f})")


def run(runs: int, seed: int, *, scheduler: Any = None, jobs: int = 1) -> dict[str, np.ndarray]:
    """Of each run: z-scores (6, 6), entries within their intervals (6, 6), a zero taken for more, an entry missed."""
    rng = np.random.default_rng(seed)
    C = np.diag([L / EA, L**3 / (3 * EIZ), L**3 / (3 * EIY), L / GJ, L / EIY, L / EIZ])
    C[1, 5] = C[5, 1] = L**2 / (2 * EIZ)
    C[2, 4] = C[4, 2] = -(L**2) / (2 * EIY)
    points = np.array([0.3, 0, 0]) + rng.uniform(-1, 1, (24, 3)) * [0.01, 0.012, 0.02]
    noise = 2e-8
    error = identify_link(
        points, _field(C, points), WRENCHES, reference=REFERENCE, noise=noise
    ).standard_error
    small = C.copy()
    small[0, 1] = small[1, 0] = 3 * error[0, 1]  # one entry of three standard errors: how often is it missed
    clean = _field(small, points)
    counts = [min(TOGETHER, runs - k) for k in range(0, runs, TOGETHER)]
    noisy = (clean + noise * rng.standard_normal((n, *clean.shape)) for n in counts)
    with workers(identified, (points, small), scheduler=scheduler, processes=jobs) as hands:
        found = [one for some in hands.in_order(noisy) for one in some]
    names = ("z", "covered", "wrong", "missed")
    return {name: np.array(values) for name, values in zip(names, zip(*found, strict=True), strict=True)}


def identified(
    shared: tuple[np.ndarray, np.ndarray], fields: np.ndarray
) -> list[tuple[np.ndarray, np.ndarray, bool, bool]]:
    """Of each field (cases, n, 3) m: z-scores, entries within their intervals, a zero missed, an entry missed; as a task."""
    points, small = shared
    out = []
    for u in fields:
        link = identify_link(points, u, WRENCHES, reference=REFERENCE, noise="independent", outliers=False)
        interval = link.interval()
        out.append(
            (
                (link.compliance - small) / link.standard_error,
                (interval[..., 0] <= small) & (small <= interval[..., 1]),
                bool(np.any(~link.insignificant & (small == 0))),
                bool(link.insignificant[0, 1]),
            )
        )
    return out


def _field(C: np.ndarray, points: np.ndarray) -> np.ndarray:
    return np.array([x[:3] + np.cross(x[3:], points - REFERENCE) for x in WRENCHES @ C.T])


if __name__ == "__main__":
    main()
