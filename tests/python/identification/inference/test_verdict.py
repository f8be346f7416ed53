"""What keeps a name and what takes it away, by cases worked by hand."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.stats import chi2
from tests.python.identification.inference.synthetic import READINGS, columns

from stiffmap.experiment.channels import Channel
from stiffmap.identification.inference import amplitudes, verdict
from stiffmap.identification.inference.chosen import Chosen
from stiffmap.identification.inference.names import Search
from stiffmap.identification.inference.parts import Part, Parts
from stiffmap.identification.inference.places import Place, Shape
from stiffmap.identification.inference.world import Model
from stiffmap.identification.numbers.unknowns import Unknown

FLAT = np.ones(READINGS)


def flat(seed: int, strengths: np.ndarray, poses: int = 8) -> tuple[Any, Any, Any]:
    """Columns, the fit without and with one effect that adds `strengths` (N,) where its pattern is one everywhere."""
    rng = np.random.default_rng(seed)
    c = columns(rng)
    pose = np.arange(READINGS) * poses // READINGS
    experiment: Any = SimpleNamespace(groups=pose)
    residual = c.free.T @ (strengths + rng.normal(size=READINGS))
    c = replace(c, residual=residual, zero=np.zeros((len(c), len(c))), experiment=experiment)
    u = c.free.T @ FLAT
    variant: Any = SimpleNamespace(lines=lambda use: FLAT[None][:, use], most=np.inf)
    shape = Shape(variant, (u / np.linalg.norm(u))[:, None], 0)
    none: Any = None
    part = Part("effect", "effect", factor=shape.directions * np.sqrt(len(c)))
    chosen = Chosen(Place(none, (shape,)), 0, part, np.array([strengths.mean()]))
    return c, amplitudes.fitted(c, [part]), chosen


def test_one_strength_everywhere_passes_and_two_do_not():
    block = (np.arange(READINGS) // 20).astype(np.intp)
    c, fit, _ = flat(0, np.full(READINGS, 6.0))
    p, scatter = verdict.evenness(c, fit.without(["effect"]), FLAT, block)
    assert p > 1e-3 and scatter < 0.2
    c, fit, _ = flat(0, np.where(block == 0, 12.0, 0.0))
    p, scatter = verdict.evenness(c, fit.without(["effect"], noise=1.0), FLAT, block)
    assert p < 1e-10
    assert scatter == pytest.approx(
        np.sqrt(2.0), rel=0.15
    )  # strengths 2 and 0 of their mean: sd of two values √2


def test_the_homogeneity_test_is_that_of_weighted_means():
    """In white noise without frames: χ² of block means about their common mean."""
    c, _, _ = flat(3, np.full(READINGS, 2.0))
    c = replace(c, free=np.eye(READINGS), residual=c.free @ c.residual, zero=np.zeros((READINGS, READINGS)))
    plain = amplitudes.evaluated(c, (), np.zeros(1), np.ones(READINGS))
    block = (np.arange(READINGS) % 3).astype(np.intp)
    means = np.array([c.residual[block == b].mean() for b in range(3)])
    count = np.bincount(block)
    common = (count * means).sum() / count.sum()
    expected = chi2.sf(float((count * (means - common) ** 2).sum()), 2)
    assert verdict.evenness(c, plain, FLAT, block)[0] == pytest.approx(expected, rel=1e-9)


def test_an_effect_that_one_pose_alone_shows_has_no_name():
    c, fit, chosen = flat(1, np.full(READINGS, 5.0))
    assert verdict.without_a_pose(c, fit.without(["effect"]), chosen) > 100.0
    alone = np.where(np.arange(READINGS) < 5, 30.0, 0.0)
    c, fit, chosen = flat(1, alone)
    assert verdict.without_a_pose(c, fit.without(["effect"]), chosen) < np.log(20)
    assert verdict.refusal(c, fit, chosen)[1] == "it rests on the readings of one pose"


def test_repeats_of_a_pose_take_no_more_away_with_it_than_their_average():
    c, fit, chosen = flat(1, np.full(READINGS, 5.0))
    rest, twice = fit.without(["effect"]), {n: getattr(c, n).repeat(2) for n in ("rows", "channel", "use")}
    both = replace(c, free=c.free.repeat(2, axis=0) / 2**0.5, sigma=np.full(2 * READINGS, 2**0.5), **twice)
    assert verdict.without_a_pose(both, rest, chosen) == pytest.approx(
        verdict.without_a_pose(c, rest, chosen)
    )


@pytest.mark.parametrize(("slips", "rest"), [(False, "effect"), (True, "")])
def test_what_one_pose_shows_is_unexplained_unless_readings_slip(slips, rest):
    c, fit, chosen = flat(1, np.where(np.arange(READINGS) < 5, 30.0, 0.0))
    weights = np.where(np.arange(READINGS) == 7, 0.1 if slips else 1.0, 1.0)
    model = Model("exact", (chosen,), replace(fit, weights=weights), 0.0)
    found = verdict.judged(c, Search(model, model, (50.0,), ((),), (None,)))
    assert not found.named and [why for _, why in found.refused] == [verdict.ONE_POSE]
    assert found.rest == rest and found.word == ("none" if slips else "unattributed")


def test_an_effect_without_a_name_goes_before_noise_that_it_may_be_part_of():
    c, fit, chosen = flat(1, np.where(np.arange(READINGS) < 5, 30.0, 0.0))
    loud = replace(fit, t=np.array([6.0, *fit.t[1:]]), weights=np.ones(READINGS))
    model = Model("exact", (chosen,), loud, 0.0)
    assert verdict.left(loud)[0] == verdict.NOISIER
    assert verdict.judged(c, Search(model, model, (50.0,), ((),), (None,))).rest == "effect"


def test_thirds_keep_equal_values_together():
    assert len(set(verdict.thirds(np.array([0.0, 0, 0, 0, 1, 2]))[:4])) == 1
    assert np.ptp(np.bincount(verdict.thirds(np.arange(9.0)))) <= 2


def test_a_strength_is_compared_along_the_travel_of_each_drive_that_is_commanded():
    n = 9
    e: Any = SimpleNamespace(
        position=np.zeros((n, 3)), wrench=np.zeros((n, 6)), order=None, hours=None, runs=np.zeros(n, int)
    )
    e.command, e.command_of = np.arange(n)[:, None] * [1.0, 0.0], (Channel("q1", "rad"), Channel("q2", "rad"))
    ((name, block),) = verdict.partitions(e, np.arange(n))
    assert name == "drive q1" and list(np.unique(block)) == [0, 1, 2] and np.all(np.diff(block) >= 0)


def numbers(values: tuple[float, ...], seed: int = 0) -> Any:
    """Columns of numbers of one group, each determined to a tenth of its uncertainty, off by `values`."""
    rng = np.random.default_rng(seed)
    c = columns(rng)
    d = 10.0 * np.linalg.qr(rng.normal(size=(len(c), len(values))))[0]
    unknowns = tuple(Unknown(f"number {k}", "zeros", "m", 1e-4) for k in range(len(values)))
    residual = d @ np.array(values) + rng.normal(size=len(c))
    n, nothing = READINGS, np.zeros((READINGS, 6))
    e: Any = SimpleNamespace(
        position=np.arange(n)[:, None] * np.ones(3),
        wrench=nothing,
        order=None,
        hours=None,
        runs=np.zeros(n, int),
        command=None,
    )
    zero = np.zeros((len(c), len(c)))
    return replace(c, residual=residual, numbers=d, unknowns=unknowns, zero=zero, experiment=e)


def test_a_number_far_off_is_out_of_tolerance_and_others_are_not():
    c = numbers((0.5, -8.0, 0.3, 1.2, -0.7))
    fit = amplitudes.fitted(c, Parts(c).numbers)
    (one,) = verdict.out_of_tolerance(c, fit)
    assert one.unknown.name == "number 1" and one.value == pytest.approx(-8.0, abs=0.5) and one.sd < 0.2


@pytest.mark.parametrize(("value", "beyond"), [(2.8, 0), (-4.2, 1)])
def test_out_of_tolerance_is_what_one_machine_in_a_thousand_is(value, beyond):
    """Of one number: beyond 3.29 of its standard uncertainties."""
    c = numbers((value,))
    c = replace(c, numbers=20.0 * c.numbers, residual=20.0 * value * c.numbers[:, 0])
    fit = amplitudes.fitted(c, Parts(c).numbers)
    assert len(list(verdict.out_of_tolerance(c, fit))) == beyond


def test_a_number_that_only_a_part_of_the_experiment_shows_is_not_out_of_tolerance():
    c = numbers((0.5, -8.0, 0.3))
    shown = c.free @ c.numbers[:, 1]
    third = c.free.T @ np.where(np.arange(READINGS) < READINGS // 3, -24.0 * shown, 0.0)
    for residual, beyond in ((c.residual, 1), (c.residual + 8.0 * c.numbers[:, 1] + third, 0)):
        part = replace(c, residual=residual)
        fit = amplitudes.fitted(part, Parts(part).numbers)
        assert len(list(verdict.out_of_tolerance(part, fit))) == beyond


def test_the_largest_of_many_numbers_within_tolerance_is_not_out_of_it():
    for seed in range(5):
        rng = np.random.default_rng(100 + seed)
        c = numbers(tuple(rng.normal(size=20)), seed)
        assert not list(verdict.out_of_tolerance(c, amplitudes.fitted(c, Parts(c).numbers)))


def test_noise_far_beyond_its_declaration_is_a_rest():
    rng = np.random.default_rng(2)
    c = columns(rng)
    c = replace(c, residual=6.0 * rng.normal(size=len(c)), zero=np.zeros((len(c), len(c))))
    assert verdict.left(amplitudes.fitted(c, ()))[0] == "noise larger than declared"
    c = replace(c, residual=c.residual / 6.0)
    assert verdict.left(amplitudes.fitted(c, ()))[:2] == ("", "")


def beyond(factor: float, correlated: float) -> tuple[Any, Part]:
    """Noise `factor` times as large as stated, carried over to the next reading, and a gap that is as short."""
    rng = np.random.default_rng(5)
    away = np.abs(np.subtract.outer(np.arange(READINGS), np.arange(READINGS)))
    c = columns(rng)
    short = Part("short", "field", full=c.free.T @ np.exp(-away / 1.0) @ c.free)
    drawn = np.linalg.cholesky(np.where(away, correlated**away, 1.0)) @ rng.normal(size=READINGS)
    return replace(c, residual=c.free.T @ (factor * drawn), zero=np.zeros((len(c), len(c)))), short


@pytest.mark.parametrize("factor", [4.0, 10.0, 30.0])
def test_noise_far_beyond_its_declaration_is_no_short_gap(factor: float) -> None:
    c, short = beyond(factor, 0.0)
    assert verdict.left(amplitudes.fitted(c, [short]))[0] == "noise larger than declared"
    all_gap = amplitudes.evaluated(c, [short], np.array([0.0, 2 * np.log(factor)]), FLAT)
    assert verdict.left(all_gap)[0] == "noise larger than declared"


@pytest.mark.parametrize("kind", ["field", "pose", "time"])
@pytest.mark.parametrize("factor", [1.5, 1.8, 2.1])
def test_noise_that_a_short_part_has_taken_is_the_noise_of_the_readings(factor: float, kind: str) -> None:
    c, short = beyond(factor, 0.0)
    taken = 2.0 * np.log(0.95 * factor)  # nearly all of it
    fit = amplitudes.evaluated(c, [replace(short, kind=kind)], np.array([-1.0, taken]), FLAT)
    rest, time, noise = verdict.left(fit)
    assert not rest and not time
    assert noise == pytest.approx(factor, rel=0.25)
    assert noise > 1.5 * fit.noise


@pytest.mark.parametrize("factor", [4.0, 10.0, 30.0])
def test_a_gap_stays_one_that_noise_of_any_size_shows_badly(factor: float) -> None:
    c, short = beyond(factor, 0.8)
    assert verdict.left(amplitudes.fitted(c, [short]))[0] == "short"


@pytest.mark.parametrize(("width", "wave"), [(0.5, 1.0), (0.05, 1.0), (0.05, 60.0)])
def test_gaps_take_a_name_only_as_far_as_they_would_show_its_pattern_by_chance(width, wave):
    """Ten patterns, a gap of rms 4: along a wave its share is that of the spectrum of a Gaussian kernel."""
    c, _, chosen = flat(0, np.full(READINGS, 3.0))
    m = 400
    x = np.linspace(-1.0, 1.0, m)
    gap = Part("gap", "field", full=np.exp(-0.5 * ((x[:, None] - x) / width) ** 2))
    pattern = np.cos(wave * x)
    some = (chosen.place,) * 10
    c = replace(c, free=np.eye(m), residual=2.0 * pattern, zero=np.zeros((m, m)), places=some)
    part = replace(chosen.part, factor=pattern[:, None])
    fit = amplitudes.evaluated(c, [gap, part], 2.0 * np.log([1.0, 4.0, 2.0]), np.ones(m))
    share = width * np.sqrt(np.pi / 2.0) * np.exp(-0.5 * (wave * width) ** 2)
    expected = 4.0 * np.sqrt(min(1.0, 2.0 * np.log(200.0) * share))
    assert verdict.by_chance(c, fit, replace(chosen, part=part)) == pytest.approx(expected, rel=0.1)


def test_the_largest_share_of_the_readings_comes_first():
    c = numbers((-9.0, 7.0))
    c = replace(c, numbers=c.numbers * [1.0, 10.0], residual=c.numbers @ [-9.0, 70.0])
    found = list(verdict.out_of_tolerance(c, amplitudes.fitted(c, Parts(c).numbers)))
    assert [b.unknown.name for b in found] == ["number 1", "number 0"]
    assert found[0].share == pytest.approx(700.0 / np.sqrt(len(c)), rel=0.02)


@pytest.mark.parametrize(("many", "beyond"), [(1, 1), (25, 0)])
def test_one_of_many_weakly_determined_numbers_is_not_out_of_tolerance(many, beyond):
    """5 ± 1.2: beyond 2 by 2.5 sd, more than the error of one number, less than the largest error of 25."""
    c = numbers((0.0,) * many)
    d = c.numbers / 12.0
    c = replace(c, numbers=d, residual=5.0 * d[:, 0])
    t = np.array([0.0, 2 * np.log(50.0)])
    fit = amplitudes.evaluated(c, Parts(c).numbers, t, np.ones(READINGS))
    assert len(list(verdict.out_of_tolerance(c, fit))) == beyond


@pytest.mark.parametrize(
    ("unit", "value", "beyond"),
    [("ln", 4.2, 0), ("ln", 6.0, 1), ("ln", -3.0, 1), ("m", 4.2, 1), ("m", -3.0, 0)],
)
def test_of_a_compliance_its_logarithm_is_within_tolerance(unit, value, beyond):
    """u = 0.2, bound 3.29: readings 1.84 times as large are ln 1.84 / 0.2 = 3.05 off, those 0.4 times as large 4.6, 2.2 times 3.94."""
    c = numbers((value,))
    (one,) = c.unknowns
    c = replace(c, numbers=20.0 * c.numbers, residual=20.0 * value * c.numbers[:, 0])
    c = replace(c, unknowns=(replace(one, unit=unit, u=0.2),))
    assert len(list(verdict.out_of_tolerance(c, amplitudes.fitted(c, Parts(c).numbers)))) == beyond


@pytest.mark.parametrize(("ln_variance", "named"), [(3.0, "wander"), (0.7, "")])
def test_what_carries_over_in_time_far_beyond_the_noise_is_left_over(ln_variance: float, named: str) -> None:
    rng = np.random.default_rng(4)
    c = columns(rng)
    place = np.arange(len(c))
    wander = Part("wander", "time", full=np.exp(-np.abs(place[:, None] - place) / 8.0))
    v = np.eye(len(c)) + np.exp(ln_variance) * wander.full
    c = replace(c, residual=np.linalg.cholesky(v) @ rng.normal(size=len(c)), zero=np.zeros_like(v))
    fit = amplitudes.evaluated(c, [wander], np.array([0.0, ln_variance]), np.ones(READINGS))
    assert verdict.left(fit)[:2] == (named, "wander")
