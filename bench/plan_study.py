"""What planned rows are worth beside random ones, on every shipped machine.

    python bench/plan_study.py [--machine NAME ...] [--twins 20]

Numbers: stiffness of every drive from deflections, zeros of every drive from positions in an unknown frame, 8 rows chosen
(D-optimal) against random plans of as many. As many random rows: the least number whose median plan is as certain (of 12, 16, 24, 32, 48). Scatter:
of fits to simulated readings of the chosen rows, over what the plan expects (root mean square of all numbers; 1 is right).
Rivals: 6 rows that tell play of the first drive from a softer one (T-optimal). Map: 6 rows for the deflection at the
middle of the workspace (I-optimal), the stiffnesses unknown. Sequential: rows until every stiffness is known to `--until` of its
scale, planned at what has been found, on a twin whose first drive is softer by 0.4; the true error is said in standard uncertainties.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from itertools import count
from typing import Any

import numpy as np

import stiffmap as sm
from stiffmap.experiment import simulate
from stiffmap.experiment.calls import placed
from stiffmap.identification.planning import estimate, follow, plan as design

MORE = (12, 16, 24, 32, 48)
POSES = 40


def main() -> None:
    """One line per machine and quantity, then one per machine."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--machine", action="append", choices=sm.machine_names())
    parser.add_argument("--twins", type=int, default=20)
    parser.add_argument("--until", type=float, default=0.2)
    o = parser.parse_args()
    names = o.machine or sm.machine_names()
    print(
        "| machine | numbers | of them told | chosen / random, u | random rows for 8 chosen | scatter / expected |"
    )
    print("|---|---|---|---|---|---|")
    for name in names:
        machine = sm.load_machine(name)
        for kind, values, options in (
            ("compliance", ("scale=1",), {"quantity": "deflection"}),
            ("zero_offset", ("error=0um", "error=0mrad"), {"quantity": "position", "frame": "unknown"}),
        ):
            terms = of_drives(machine, kind, *values)
            if terms:
                print(
                    f"| {name} | {kind} × {len(terms)} | {numbers(machine, terms, o.twins, options)} |",
                    flush=True,
                )
    print(
        "\n| machine | rivals: chosen, random (standard deviations apart) | map: chosen, random (µm) | sequential |"
    )
    print("|---|---|---|---|")
    for name in names:
        machine = sm.load_machine(name)
        print(
            f"| {name} | {rivals(machine)} | {of_map(machine)} | {campaign(machine, o.until)} |", flush=True
        )


def of_drives(machine: sm.Machine, kind: str, *values: str) -> list[Any]:
    """The effect on each drive that takes it, with the first of the values that has its unit."""
    out = []
    for drive in machine.actuators:
        leg, _, element = drive.rpartition(".")
        for value in values:
            try:
                out.append(placed(machine, f"{kind} {element} {leg} {value}"))
            except sm.StiffmapError:
                continue
            break
    return out


def numbers(machine: sm.Machine, terms: Sequence[Any], twins: int, options: dict[str, Any]) -> str:
    """Uncertainties of 8 chosen rows, and what fits to twins scatter by."""
    best = design(machine, terms, rows=8, poses=POSES, **options)
    told = np.isfinite(best.sigma)
    if not told.any():
        return "0 | – | – | –"
    ratio = float(np.median(best.sigma[told] / best.random_sigma[told]))
    size = float(np.sum(np.log(best.sigma[told])))
    equal = next(
        (
            str(n)
            for n in MORE
            if float(
                np.sum(np.log(design(machine, terms, rows=n, poses=POSES, **options).random_sigma[told]))
            )
            <= size
        ),
        f"> {MORE[-1]}",
    )
    off = []
    for seed in range(twins):
        found = estimate(machine, simulate(machine, best.experiment, terms, seed=seed), terms)
        off.append(((found.values - truth_of(terms)) / best.sigma)[told])
    return f"{told.sum()} | {ratio:.2f} | {equal} | {float(np.sqrt(np.mean(np.square(off)))):.2f}"


def truth_of(terms: Sequence[Any]) -> np.ndarray:
    """The values of `terms` in the order of their fit."""
    return np.array([value for t in terms for _, value in t.parameters])


def rivals(machine: sm.Machine) -> str:
    """Play of the first drive against a softer one."""
    play, soft = (
        of_drives(machine, "dead_zone", "half_width=10um"),
        of_drives(machine, "compliance", "scale=1.2"),
    )
    if not play or not soft:
        return "–"
    d = design(machine, play[:1], rival=soft[:1], aim="separate", rows=6, poses=POSES)
    return f"{d.value:.0f}, {d.random_value:.0f}"


def of_map(machine: sm.Machine) -> str:
    """Deflection at the middle of the workspace."""
    terms = of_drives(machine, "compliance", "scale=1")
    if not terms:
        return "–"
    low, high = machine.workspace
    d = design(machine, terms, aim="map", rows=6, poses=POSES, position=np.array([(low + high) / 2]))
    return f"{1e6 * d.value:.3g}, {1e6 * d.random_value:.3g}"


def campaign(machine: sm.Machine, until: float) -> str:
    """Rows that a twin needs, and how far the numbers are then from the truth."""
    start = of_drives(machine, "compliance", "scale=1")
    if start:
        known = design(machine, start, rows=POSES, poses=POSES // 2).sigma
        start = [t for t, u in zip(start, known, strict=True) if np.isfinite(u)]
    if not start:
        return "–"
    truth = [*of_drives(machine, "compliance", "scale=1.4")[:1], *start[1:]]
    seeds = count()
    steps = follow(
        machine,
        start,
        lambda e: simulate(machine, e, truth, seed=next(seeds)),
        until=until,
        batch=4,
        poses=POSES // 2,
    )
    rows, last = steps[-1]
    worst = float(np.max(np.abs(last.values - truth_of(truth)) / last.sigma))
    return f"{rows} rows, worst {worst:.1f} u"


if __name__ == "__main__":
    main()
