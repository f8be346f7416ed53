"""What a search over effects may say: which names stand, which numbers are out of tolerance, what is left."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import orth
from scipy.special import chdtrc, ndtri

from stiffmap.experiment.experiment import WRENCH, Experiment, Floats, Integers
from stiffmap.identification.inference.amplitudes import OFF, Fit, declared_noise, noise_prior
from stiffmap.identification.inference.chosen import Chosen
from stiffmap.identification.inference.columns import Columns
from stiffmap.identification.inference.constants import ALIKE, EQUAL_SHARE, NOISE_SD, ODDS, RARE, TOLERANCES
from stiffmap.identification.inference.names import Search
from stiffmap.identification.inference.parts import GAPS, Part
from stiffmap.identification.inference.places import Place
from stiffmap.identification.inference.shares import of_numbers
from stiffmap.identification.numbers.unknowns import Unknown

DETERMINED = 0.5
"""Posterior standard deviation, in standard uncertainties, of a number that the readings determine."""
TOLERABLE = "declared numbers within their tolerances show the same"
NOISIER = "noise larger than declared"
ONE_POSE = "it rests on the readings of one pose"
CLEARLY = 1.15
"""Noise over what is stated, or under it, from which it is said."""
LEAST_SCALE = 0.01
"""Of a compliance or a mass that a straight line would make negative."""
NOISIER_BY = (1.0, 1.1, 1.2, 1.35, 1.5, 2.0, 3.0, 5.0, 8.0, 12.0, 20.0, 30.0)
"""Factors of the noise that are tried in place of gaps."""
KAPPA_SDS = 4.0
"""Prior standard deviations of ln κ beyond which the noise is no noise."""
LARGEST_TIME = 2.0 * KAPPA_SDS * NOISE_SD
"""ln variance, in the declared noise, beyond which what carries over in time is no noise either."""


@dataclass(frozen=True, eq=False)
class Named:
    """An effect that stands: its place, what would do in its stead, how sure, how alike everywhere."""

    chosen: Chosen
    equivalents: tuple[Place, ...]
    log_odds: float
    scatter: float
    """Of its strength from block to block, relative; 0: the same everywhere."""
    share: float
    """rms of what it adds to the readings, in noise."""
    numbers: tuple[Beyond, ...] = ()
    """Declared numbers that would do in its stead, but out of tolerance."""
    against_numbers: float = np.inf
    """Its ln odds against declared numbers that are off in its stead."""


@dataclass(frozen=True, eq=False)
class Beyond:
    """A declared number out of tolerance, in its standard uncertainties."""

    unknown: Unknown
    value: float
    sd: float
    share: float
    """rms of what it adds to the readings, in noise."""


@dataclass(frozen=True, eq=False)
class Verdict:
    """The answer of the inference, before it is put into words."""

    named: tuple[Named, ...]
    refused: tuple[tuple[Chosen, str], ...]
    """Effects of the model without a name, and why."""
    gone: tuple[tuple[Chosen, str], ...]
    """Effects that a search named and that are nothing at the optimum, and why."""
    beyond: tuple[Beyond, ...]
    """As the names, the largest share of the readings first."""
    rest: str
    """What is left that nobody can name, or the effect that has no name; empty: nothing."""
    time: str
    """Correlation of the noise in time; empty: none."""
    noise: float
    """Of the readings over what is stated, with what could be more than noise but is not demanded."""
    as_effects: tuple[Unknown, ...] = ()
    """Numbers out of tolerance that are named as the effect that shows the same."""

    @property
    def out_of_tolerance(self) -> tuple[Unknown, ...]:
        """All numbers that no tolerance allows, also those that are named as effects."""
        return *(b.unknown for b in self.beyond), *self.as_effects

    @property
    def word(self) -> str:
        """``none``, ``effects``, ``ambiguous``, ``unattributed``."""
        if self.named:
            return "ambiguous" if any(n.equivalents or n.numbers for n in self.named) else "effects"
        return "unattributed" if self.rest else "effects" if self.beyond else "none"


def judged(columns: Columns, search: Search, gone: tuple[tuple[Chosen, str], ...] = ()) -> Verdict:
    """Names that stand, numbers out of tolerance, and the rest; `gone`: effects that may not be named any more, and why."""
    model = search.best
    named, refused = [], []
    beyond = tuple(out_of_tolerance(columns, model.fit))
    each = zip(model.chosen, search.gain, search.equivalents, search.instead, strict=True)
    for c, odds, near, other in each:
        scatter, why = refusal(columns, model.fit, c)
        numbers: tuple[Beyond, ...] = ()
        instead, against = other or (None, np.inf)
        if instead and against < np.log(ODDS):
            known = [b.unknown.name for b in beyond]
            numbers = tuple(b for b in out_of_tolerance(columns, instead.fit) if b.unknown.name not in known)
            if any((e := effect_of(columns, b, ())) and e.place is c.place for b in numbers):
                numbers, against = (), np.inf  # the effect by another name
            why = why if numbers or against > 0.0 else TOLERABLE
        if why:
            refused.append((c, why))
        else:
            share = float(np.linalg.norm(model.fit.mean(c.part)) / np.sqrt(len(columns)))
            named.append(Named(c, tuple(p for p, _ in near), odds, scatter, share, numbers, against))
    called = {id(b): effect_of(columns, b, (*model.chosen, *(c for c, _ in gone))) for b in beyond}
    for b in beyond:
        effect = called[id(b)]
        if effect is not None and effect.place not in [n.chosen.place for n in named]:
            named.append(Named(effect, (), 0.5 * (b.value / b.sd) ** 2, 0.0, b.share))
    as_effects = tuple(b.unknown for b in beyond if called[id(b)] is not None)
    beyond = tuple(b for b in beyond if called[id(b)] is None)
    rest, time, noise = left(model.fit)
    # readings of one pose alone may be slips where there are others
    explained = {TOLERABLE, ONE_POSE} if model.fit.heavy else {TOLERABLE}
    unexplained = [c.part.name for c, why in refused if why not in explained]
    if rest in ("", NOISIER):  # part of which an effect without a name may be
        rest = next(iter(unexplained), rest) or (gone[-1][0].part.name if gone and not named else "")
    named.sort(key=lambda n: -n.share)
    return Verdict(tuple(named), tuple(refused), gone, beyond, rest, time, noise, as_effects)


def effect_of(columns: Columns, b: Beyond, taken: Sequence[Chosen]) -> Chosen | None:
    """The effect of fewest directions in whose span a number out of tolerance lies; None where there is none, or it is taken, or an
    effect that is taken lies in its span."""
    within = [id(a) for c in taken for a in (*c.place.aliases, *c.place.wider)]
    d = columns.numbers[:, columns.unknowns.index(b.unknown)]
    for place in sorted(columns.places, key=lambda p: p.shapes[0].directions.shape[1]):
        q = place.shapes[0].directions
        if len(place.shapes) > 1 or float(np.sum((q.T @ d) ** 2)) < ALIKE * float(d @ d):
            continue
        if any(c.place is place for c in taken) or id(place.candidate) in within:
            return None
        bare = Chosen.at(place, 0)
        values = np.linalg.lstsq(bare.rotated(columns), b.value * d, rcond=1e-9)[0]
        found = replace(bare, values=np.asarray(values, dtype=float))
        return found if found.is_possible else None
    return None


def refusal(columns: Columns, fit: Fit, c: Chosen) -> tuple[float, str]:
    """Scatter of an effect's strength over the experiment, and why it has no name; empty where it may have one."""
    if fit.amplitude(c.part.name) < by_chance(columns, fit, c):
        return 0.0, "smaller than what nobody can name"
    rest = fit.without([c.part.name])
    if without_a_pose(columns, rest, c) < np.log(ODDS):
        return 0.0, ONE_POSE
    scatter, worst = unevenness(columns, rest, columns.lines(c.variant) @ c.values / columns.sigma)
    return scatter, f"its strength differs along {worst}" if worst else ""


def unevenness(columns: Columns, rest: Fit, pattern: Floats) -> tuple[float, str]:
    """Largest scatter, relative, of the strength of a pattern (N,) over the experiment beyond chance, and along what it is larger
    than `EQUAL_SHARE`; empty: nowhere."""
    blocks = list(partitions(columns.experiment, columns.rows))
    worst, scatter = "", 0.0
    for name, block in blocks:
        p, share = evenness(columns, rest, pattern, block)
        if p < RARE / len(blocks) and share > scatter:
            scatter, worst = share, name
    return scatter, worst if scatter > EQUAL_SHARE else ""


def by_chance(columns: Columns, fit: Fit, c: Chosen) -> float:
    """rms, in noise, of the largest effect that the gaps would show by chance: as large as all of them together where they
    are as smooth as its pattern, less where they spread over many directions (a short wave in a rough field).

    Of S patterns the largest squared coefficient, in variances of the gaps along the pattern, is less than 2 ln(S odds).
    """
    parts = [(p, np.exp(t)) for p, t in zip(fit.parts, fit.t[1:], strict=True) if p.kind in GAPS]
    pattern = fit.mean(c.part)
    along = sum(v * float(pattern @ p.times(pattern)) for p, v in parts) / float(pattern @ pattern)
    along = max(along, 0.0)  # round-off of a pattern at right angles to all gaps
    shapes = sum(len(p.shapes) for p in columns.places)
    largest = 2.0 * np.log(ODDS * max(1, shapes)) * along / len(pattern)
    return float(np.sqrt(min(sum(v for _, v in parts), largest)))


def without_a_pose(columns: Columns, rest: Fit, c: Chosen) -> float:
    """Gain of ln likelihood by an effect of one strength, at its least over all poses left out in turn; infinite where all
    readings are of one."""
    raw = columns.lines(c.variant) @ c.values / columns.sigma
    pattern, r = rest.white(columns.free.T @ raw), rest.white(rest.columns.residual)
    pose = columns.experiment.groups[columns.rows]
    out: list[float] = []
    for k in np.unique(pose) if np.ptp(pose) > 0 else ():
        gone = orth(rest.white(columns.free[pose == k].T))  # averages of repeats are one direction
        a, b = pattern - gone @ (gone.T @ pattern), r - gone @ (gone.T @ r)
        out.append(0.5 * float(a @ b) ** 2 / max(float(a @ a), 1e-12))
    return min(out, default=np.inf)


def evenness(columns: Columns, rest: Fit, raw: Floats, block: Integers) -> tuple[float, float]:
    """p-value of one strength of a pattern (N,) in all blocks (N,), and the scatter of strengths beyond chance, relative to their
    mean.

    DerSimonian, Laird, Controlled Clinical Trials 7 (1986) 177.
    """
    pattern = np.stack([columns.free.T @ np.where(block == b, raw, 0.0) for b in np.unique(block)], axis=1)
    white, r = rest.white(pattern), rest.white(rest.columns.residual)
    gram = white.T @ white
    seen = np.diag(gram) > 1e-6 * np.diag(gram).max()
    white, gram = white[:, seen], gram[np.ix_(seen, seen)]
    if len(gram) < 2:
        return 1.0, 0.0
    together = white.sum(axis=1)
    one = float(together @ r) ** 2 / float(together @ together)
    strength, *_ = np.linalg.lstsq(white, r, rcond=1e-9)
    drop = float(r @ (white @ strength)) - one
    freedom = len(gram) - 1
    precision = np.diag(gram)
    spread = precision.sum() - float((precision**2).sum()) / precision.sum()
    mean = float(together @ r) / float(together @ together)
    scatter = np.sqrt(max(0.0, drop - freedom) / max(spread, 1e-12)) / max(abs(mean), 1e-12)
    return float(chdtrc(freedom, max(drop, 0.0))), float(scatter)


def partitions(e: Experiment, rows: Integers) -> Iterator[tuple[str, Integers]]:
    """Name and (N,) block of each reading, of every way to cut the experiment into parts."""
    over: list[tuple[str, Floats | None]] = [(f"{a}", e.position[:, k]) for k, a in enumerate("xyz")]
    over += [(f"the load's {a}", e.wrench[:, k]) for k, a in enumerate(WRENCH)]
    if e.command is not None:
        over += [(f"drive {c.joint or c.name}", e.command[:, k]) for k, c in enumerate(e.command_of)]
    over += [
        ("the size of the load", np.linalg.norm(e.wrench[:, :3], axis=1)),
        ("time", e.order),
        ("hours", e.hours),
    ]
    for name, value in over:
        if value is not None and np.ptp(value) > 0.0:
            yield name, thirds(value)[rows]
    if len(np.unique(e.runs)) > 1:
        yield "set-ups", e.runs[rows].astype(np.intp)


def thirds(value: Floats) -> Integers:
    """(n,) 0, 1 or 2: the third of the rows, by size, that each belongs to; equal values stay together."""
    low, high = np.quantile(value, [1 / 3, 2 / 3], method="nearest")
    return np.asarray((value > low).astype(np.intp) + (value > high))


def out_of_tolerance(columns: Columns, fit: Fit) -> Iterator[Beyond]:
    """Declared numbers beyond tolerance whatever their error, beyond what the largest of so many is once in a thousand machines, and
    the same over all of the experiment."""
    size = np.linalg.norm(columns.numbers, axis=0) / np.sqrt(len(columns))
    said = zip(columns.unknowns, of_numbers(columns, fit), size, strict=True)
    found = [Beyond(u, value, sd, float(abs(value) * s)) for u, (value, sd, _), s in said]
    number = {id(b): k for k, b in enumerate(found)}
    determined = sum(b.sd < DETERMINED for b in found)
    largest = float(-ndtri(RARE / (2.0 * max(1, determined))))
    doubt = float(-ndtri(1.0 / (2.0 * ODDS * max(1, len(found)))))
    for b in sorted(found, key=lambda b: -b.share):
        value, sd = _of_logarithm(b) if b.unknown.unit == "ln" else (b.value, b.sd)
        far = abs(value) - doubt * sd > TOLERANCES and abs(value) > largest
        if far and not unevenness(columns, fit, columns.free @ columns.numbers[:, number[id(b)]])[1]:
            yield b


def _of_logarithm(b: Beyond) -> tuple[float, float]:
    """Mean and standard deviation of a compliance's logarithm, in standard uncertainties: readings follow the compliance itself."""
    scale = max(1.0 + b.unknown.u * b.value, LEAST_SCALE)
    return float(np.log(scale)) / b.unknown.u, b.sd / scale


def left(fit: Fit) -> tuple[str, str, float]:
    """What is left unexplained by names and numbers, and the correlation of the noise in time, empty where there is none; the noise
    over what is stated."""
    on = {p: t for p, t in zip(fit.parts, fit.t[1:], strict=True) if t > OFF + 1.0}
    gaps, over = [p for p in on if p.kind in GAPS], [p for p in on if p.kind == "time"]

    def largest(some: list[Part], freedom: int = 0) -> tuple[str, float]:
        """The largest of some, and ln κ² of the noise: where they are not demanded, of one that stands for them."""
        noise = float(fit.t[0])
        if not some:
            return "", noise
        found, instead = _significant(fit, [p.name for p in some], freedom)
        return (max(some, key=lambda p: on[p]).name, noise) if found else ("", max(noise, instead))

    (rest, noise), (time, noisier) = largest(gaps), largest(over)
    noise = max(noise, noisier)
    centre, sd = declared_noise(fit.columns)
    if noise - centre > KAPPA_SDS * sd:
        rest = rest or NOISIER
    rest = rest or largest([p for p in over if on[p] > LARGEST_TIME])[0]
    if not rest and not time and gaps and over:
        rest, noise = largest([*gaps, *over], len(gaps) + len(over))  # either may be the noise, not both
    return rest, time, float(np.exp(0.5 * noise))


def not_as_stated(noise: float, source: str = "is stated") -> list[str]:
    """What must be said of noise that is so many times what is stated, or what another `source` has; nothing where that is near enough."""
    if 1.0 / CLEARLY < noise < CLEARLY:
        return []
    return [f"the noise is {noise:.2g} times what {source}, and is taken so"]


def _significant(fit: Fit, names: Sequence[str], freedom: int = 0) -> tuple[bool, float]:
    """Likelihood ratio of some parts against none of them and noise of any size that its prior allows, at `RARE`, half of it
    at the boundary, and ln κ² of that noise; `freedom`: other degrees of freedom than one for two parts."""
    bare = fit.without(names)
    instead = max((bare.without([], bare.noise * factor) for factor in NOISIER_BY), key=_supported)
    gain = 2.0 * (_supported(fit) - _supported(instead))
    chance = float(0.5 * chdtrc(freedom or max(1, len(names) // 2), max(gain, 0.0)))
    return chance < RARE, float(instead.t[0])


def _supported(fit: Fit) -> float:
    """ln likelihood, with the prior of the noise: what repeats say of it."""
    return fit.likelihood + noise_prior(fit.columns, float(fit.t[0]))
