"""Which gaps the readings of an experiment can hold."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import stiffmap as sm
from stiffmap.experiment import Experiment, Predictor, random_plan
from stiffmap.identification.inference import kernels
from stiffmap.identification.inference.kernels import covariance


@pytest.mark.parametrize(
    ("pose", "condition", "expected"),
    [
        ([0, 1, 2], [0, 1, 2], []),  # one row a pose: what its readings share is their noise
        ([0, 0, 1], [0, 0, 1], ["condition"]),
        ([0, 0, 1], [0, 1, 2], ["pose"]),
        ([0, 0, 0], [0, 0, 1], ["condition", "pose"]),
    ],
)
def test_what_readings_share_is_asked_for_once_and_where_it_is_not_the_noise(pose, condition, expected):
    e: Any = SimpleNamespace(groups=np.array(pose), conditions=np.array(condition), channels=(0, 0, 0))
    points = kernels.ReadingPoints(np.repeat(np.arange(3), 3), np.tile(np.arange(3), 3), np.ones(9))
    found = list(kernels.shared(e, points))
    assert [k.name for k in found] == expected
    apart = points.channel[:, None] != points.channel
    assert all(np.all(k.between(points, points)[apart] == 0.0) for k in found)


@pytest.fixture(scope="module")
def read() -> tuple[sm.Machine, Experiment, kernels.ReadingPoints]:
    machine = sm.load_machine("linear-delta")
    plan = random_plan(machine, "deflection", poses=8, loads=4, repeats=2, seed=1)
    e = Predictor(machine, replace(plan, order=np.arange(len(plan), dtype=float))).experiment
    rows, channel = np.nonzero(e.read)
    return machine, e, kernels.ReadingPoints(rows, channel, 1e-5 * (1.0 + 0.1 * channel))


def test_variances_of_kernels_are_their_diagonals(
    read: tuple[sm.Machine, Experiment, kernels.ReadingPoints],
) -> None:
    machine, e, points = read
    found = list(kernels.gaps(machine, e, points))
    assert {k.kind for k in found} == {"field", "pose", "time"}
    for k in found:
        whole = k.between(points, points)
        assert k.own(points) == pytest.approx(np.diag(whole))
        assert np.linalg.eigvalsh(whole).min() > -1e-9 * np.trace(whole)
        if k.label is not None:
            label = k.label(points)
            assert np.array_equal(whole, label[:, None] == label)


def test_a_covariance_of_low_rank_is_the_whole_one(
    read: tuple[sm.Machine, Experiment, kernels.ReadingPoints],
) -> None:
    """Known by all readings it is exact; by some, smooth parts and blocks nearly, and each reading's own variance exactly."""
    machine, e, points = read
    size = {"field": 1e-11, "pose": 0.3, "time": 0.7}
    kinds = [(k, size[k.kind]) for k in kernels.gaps(machine, e, points)]
    n = len(points)
    rng = np.random.default_rng(0)
    noise, more = rng.uniform(0.5, 2.0, n), rng.normal(size=(n, 2))
    exact = np.diag(noise) + more @ more.T + sum(v * k.between(points, points) for k, v in kinds)
    found = covariance(points, points, kinds, noise, more)
    whole = np.diag(found.noise) + found.factor @ found.factor.T
    assert whole == pytest.approx(exact, rel=1e-6, abs=1e-6)
    white = found.white(np.eye(n))
    assert white @ whole @ white.T == pytest.approx(np.eye(n), abs=1e-8)
    assert found.coloured(white) == pytest.approx(np.eye(n), abs=1e-8)
    r = rng.normal(size=n)
    assert found.noise_part(found.white(r)) == pytest.approx(found.noise * np.linalg.solve(whole, r))
    keep = rng.random(n) < 0.5
    part = found.only(keep)
    assert np.diag(part.noise) + part.factor @ part.factor.T == pytest.approx(whole[np.ix_(keep, keep)])
    half = rng.permutation(n)[: n // 2]
    few = kernels.ReadingPoints(points.rows[half], points.channel[half], points.sigma[half])
    smooth = [(k, v) for k, v in kinds if k.kind == "field"]
    near = covariance(points, few, smooth, noise, more)
    made = np.diag(near.noise) + near.factor @ near.factor.T
    true = np.diag(noise) + more @ more.T + sum(v * k.between(points, points) for k, v in smooth)
    assert np.diag(made) == pytest.approx(np.diag(true))
    assert np.linalg.norm(made - true) < 0.1 * np.linalg.norm(true - np.diag(noise) - more @ more.T)
