"""What every candidate would add to the evidence, against determinants of the whole covariance."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.stats import multivariate_normal
from tests.python.identification.inference.synthetic import READINGS, columns, parts
from tests.python.identification.inference.test_amplitudes import dense

from stiffmap.identification.inference import amplitudes, chosen as candidates
from stiffmap.identification.inference.constants import SIZES
from stiffmap.identification.inference.places import Place, Shape, possible
from stiffmap.model.effects import get

AT = np.array([0.1, -1.0, -0.5])


def setting(seed: int, ranks: tuple[int, ...]) -> tuple[Any, ...]:
    rng = np.random.default_rng(seed)
    c = columns(rng)
    some = parts(rng)[:2]
    none: Any = None
    shapes = tuple(Shape(none, np.linalg.qr(rng.normal(size=(len(c), r)))[0], 0) for r in ranks)
    fit = amplitudes.evaluated(c, some, AT, np.ones(READINGS))
    return c, fit, shapes, dense(c, some, AT, np.ones(READINGS))


def likelihood(c, v, effects):
    """ln N of the residual with effects (directions, size) added."""
    for u, b in effects:
        v = v + b**2 * (len(c) / u.shape[1]) * u @ u.T
    return multivariate_normal(cov=v).logpdf(c.residual)


@pytest.mark.parametrize("inside", [None, 6])
@pytest.mark.parametrize("ranks", [(1, 1, 1), (2, 2, 2), (5, 5, 5), (1, 2, 5), (5, *(4,) * (READINGS // 3))])
def test_one_effect_is_worth_the_mean_over_its_sizes(ranks, inside):
    """Few or more directions than readings, in all of their space or in a small part of it."""
    c, fit, shapes, v = setting(ranks[0], ranks)
    if inside:
        rng = np.random.default_rng(inside)
        part = np.linalg.qr(rng.normal(size=(len(c), inside)))[0]
        across = [np.linalg.qr(rng.normal(size=(inside, r)))[0] for r in ranks]
        shapes = tuple(replace(s, directions=part @ a) for s, a in zip(shapes, across, strict=True))
        assert Place(None, shapes).span[0].shape[1] == min(inside, sum(ranks))  # type: ignore[arg-type]
    found = candidates.evidence(fit, (Place(None, shapes[:1]), Place(None, shapes[1:])))  # type: ignore[arg-type]
    each = np.concatenate(found)
    for s, gain in zip(shapes, each, strict=True):
        sizes = [likelihood(c, v, [(s.directions, b)]) for b in SIZES]
        expected = np.logaddexp.reduce(sizes) - np.log(len(SIZES)) - likelihood(c, v, [])
        assert gain == pytest.approx(expected, abs=1e-8)


def test_what_can_only_grow_is_worth_twice_as_much_one_way_and_little_the_other():
    _, fit, shapes, _ = setting(7, (1,))
    u = shapes[0].directions
    both = tuple(Shape(shapes[0].variant, u, s) for s in (0, 1, -1))
    free, up, down = np.exp(candidates.evidence(fit, (Place(None, both),))[0])  # type: ignore[arg-type]
    assert up + down == pytest.approx(2.0 * free, rel=1e-9)
    assert (up > down) == (float(u[:, 0] @ fit.solved) > 0.0)


def test_two_effects_together_are_worth_the_mean_over_both_sizes():
    c, fit, shapes, v = setting(11, (1, 3, 2))
    found = candidates.of_pairs(fit, shapes)
    some = SIZES[:: candidates.PAIR_STRIDE]
    for i, j in ((0, 1), (1, 2)):
        sizes = [
            likelihood(c, v, [(shapes[i].directions, a), (shapes[j].directions, b)])
            for a in some
            for b in some
        ]
        expected = np.logaddexp.reduce(sizes) - np.log(len(sizes)) - likelihood(c, v, [])
        assert found[i, j] == found[j, i] == pytest.approx(expected, abs=1e-7)
    assert np.all(np.isneginf(np.diag(found)))


def test_a_width_is_as_large_as_a_file_allows_and_an_error_no_larger_than_what_is_seen() -> None:
    """A printed gear plays by a tenth of a radian; a zero that is off by as much was seen when the machine was built."""
    play, zero = (get(kind).parameters[0].turning for kind in ("dead_zone", "zero_offset"))
    assert possible(play) == (0.0, play.upper) == (0.0, 0.5)
    assert possible(zero) == (-0.05, 0.05) and zero.upper == 0.1
