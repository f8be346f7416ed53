"""Common factors that are a unit, a lever or a gauge."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial

import numpy as np

from stiffmap.common.broadcasting import Mask
from stiffmap.experiment.experiment import Experiment, Floats
from stiffmap.experiment.noise.whitening import LinearProblem
from stiffmap.identification.diagnosis.slips.axes import Hypothesis, in_setup, of_setup, times

LENGTHS = (
    (1000.0, "µm and mm, or mm and m, mixed up"),
    (25.4, "inch and mm, or mil (thou) and µm, mixed up"),
    (1.0 / 0.0254, "mil (thou) and mm mixed up"),
    (2.54, "mil (thou) and 1/100 mm mixed up"),
    (100.0, "1/100 mm and mm mixed up"),
    (10.0, "1/100 mm and µm, or 1/1000 mm and 1/100 mm, mixed up"),
    (2.0, "a lever at the gauge, or one that shows twice or half the way"),
)
FORCES = (
    (9.80665, "kgf (kp) and N mixed up"),
    (4.4482216152605, "lbf and N mixed up"),
    (9.80665 / 4.4482216152605, "lbf and kgf mixed up"),
    (1000.0, "kN and N mixed up"),
    (10.0, "daN and N mixed up"),
    (2.0, "a lever or a pulley in the load"),
)
TURNS = (
    (180.0 / np.pi, "degrees and radians mixed up"),
    (1000.0, "mrad and rad, or µrad and mrad, mixed up"),
    (1000.0 * np.pi / 180.0, "degrees and mrad mixed up"),
    (60.0, "degrees and arc minutes mixed up"),
    (3600.0, "degrees and arc seconds mixed up"),
)
NEAR = 0.03
"""Relative distance within which a factor is a known one, if its own uncertainty is less."""
BESIDE, CLEAR = 0.35, 0.5
"""ln of what one part of the machine may add to a known factor; share of the next best explanation that it may leave."""
PHYSICAL = 4.0
"""Factors below may be a soft part; no machine is softer than its file by more, everywhere and alike."""


Left = Callable[[Floats], float]
"""Chi-square that the best part of the machine leaves next to a prediction (n, c)."""


def factors(e: Experiment, problem: LinearProblem, base: Floats, left: Left) -> Iterator[Hypothesis]:
    """One factor of all readings, of one gauge, of all rotations; each of all set-ups or of one."""
    linear = [int(a) for a in np.flatnonzero(e.axis_read[:3])]
    angular = [i for i in range(3, 6) if e.axis_read[i]]
    sets: list[tuple[tuple[int, ...], str, str]] = []
    if linear and angular:
        sets.append(((*linear, *angular), "all readings are", "both"))
    if linear:
        sets.append((tuple(linear), "all readings of lengths are" if angular else "all readings are",
                     "length" if angular else "both"))  # fmt: skip
    if angular:
        sets.append((tuple(angular), "all readings of rotations are", "turn"))
    if len(linear) > 1:
        sets += [((a,), f"the readings of {e.channels[a].name[1:]} are", "length") for a in linear]
    names = sorted(set(e.setup or ()))
    for axes, what, quantity in sets:
        for setup in (None, *(names if len(names) > 1 else ())):
            here = in_setup(e, axes, setup)
            found = _factor(problem, np.where(here, base, 0.0))
            said = what if setup is None else f"{what.rsplit(' ', 1)[0]} of set-up {setup} are"
            if found is not None:
                h = _hypothesis(base, here, axes, setup, said, quantity, *found, left)
                yield from () if h is None else (h,)


def _factor(problem: LinearProblem, base: Floats) -> tuple[float, float] | None:
    """Reading over prediction by least squares where a prediction (n, c) is not zero, and its standard uncertainty."""
    column = problem.white(base)
    size = float(column @ column)
    if size <= 0.0:
        return None
    target = problem.residual(base) + column
    value = float(column @ target) / size
    left = target - value * column
    spread = max(1.0, float(left @ left) / max(problem.freedom - 1, 1))
    return value, float(np.sqrt(spread / size))


def _hypothesis(
    base: Floats, here: Mask, axes: tuple[int, ...], setup: str | None,
    what: str, quantity: str, value: float, u: float, left: Left,
) -> Hypothesis | None:  # fmt: skip
    known = _known(value, u, quantity) or _beside_a_part(
        value, quantity, lambda f: left(np.where(here, f * base, base))
    )
    small = 1 / PHYSICAL < abs(value) < PHYSICAL
    if not known and small:
        return None
    prediction = np.where(here, value * base, base)
    sign = "; check the sign as well" if value < 0 else ""
    seen = f"{what} {abs(value):.4g} times what the file predicts{', with the opposite sign' if value < 0 else ''}"
    if not known:
        check = f"check the units of force and gauge, and any lever{sign}"
        return Hypothesis("factor", seen, check, 2, prediction, None, factor=value, setup=setup)
    factor, name, of_load = known[0]
    whole = float(np.sign(value)) * factor
    undo = partial(pushed, factor=whole, setup=setup)
    if not of_load:
        undo = partial(times, factor=whole, axes=axes, setup=setup)
    others = "".join(f", or {n}" for _, n, _ in known[1:])
    near = f"near {factor:.4g}" if factor >= 1 else f"near 1/{1 / factor:.4g}"
    return Hypothesis("factor", f"{seen} ({near})", f"check first: {name}{others}{sign}", 1 + (value < 0) + (setup is not None),
                      prediction, undo, factor=value, physical=small, setup=setup)  # fmt: skip


def _named(quantity: str) -> list[tuple[float, str, bool]]:
    """Known factors of a quantity and their inverses: factor, its cause, whether it is one of the load."""
    tables = {
        "both": ((LENGTHS, False), (FORCES, True)),
        "length": ((LENGTHS, False),),
        "turn": ((TURNS, False),),
    }
    return [
        (f, name, load)
        for table, load in tables[quantity]
        for factor, name in table
        for f in (factor, 1 / factor)
    ]


def named_within(low: float, high: float) -> list[str]:
    """What to check first, of known factors of all readings between two ends (a gain of the load or of all gauges)."""
    found = [n for n in _named("both") if min(low, high) <= n[0] <= max(low, high)]
    return list(dict.fromkeys(name for _, name, _ in sorted(found, key=lambda n: not n[2])))


def _known(value: float, u: float, quantity: str) -> list[tuple[float, str, bool]]:
    """Known factors that a value is, within its uncertainty, the nearest first."""
    spread = min(NEAR, max(3.0 * u / max(abs(value), 1e-300), 0.01))
    off = [(abs(float(np.log(abs(value) / n[0]))), n) for n in _named(quantity)]
    near = sorted((o for o in off if o[0] < spread), key=lambda o: (round(o[0], 3), not o[1][2]))
    return [n for _, n in near]


def _beside_a_part(
    value: float, quantity: str, left: Callable[[float], float]
) -> list[tuple[float, str, bool]]:
    """The known factor near a value together with which one part of the machine explains the readings best, if it does so well."""
    near = [n for n in _named(quantity) if abs(float(np.log(abs(value) / n[0]))) < BESIDE]
    if 1 / PHYSICAL < abs(value) < PHYSICAL or not near:
        return []
    misfits = {f: left(float(np.sign(value)) * f) for f in {n[0] for n in near}}
    best = min(misfits, key=lambda f: misfits[f])
    others = [m for f, m in misfits.items() if abs(np.log(f / best)) > 1e-6]
    if misfits[best] > CLEAR * left(value) or (others and misfits[best] > CLEAR * min(others)):
        return []
    return [n for n in near if abs(np.log(n[0] / best)) < 1e-6]


def pushed(e: Experiment, factor: float, setup: str | None = None) -> Experiment:
    """The wrenches times a factor, of one set-up or of all."""
    by = np.where(of_setup(e, setup), factor, 1.0)[:, None]
    return replace(e, wrench=e.wrench * by, asked=None if e.asked is None else e.asked * by)
