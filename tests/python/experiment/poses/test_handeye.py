"""Frames of instruments and targets: slopes of the fit, and frames that were made known."""

from __future__ import annotations

from copy import deepcopy

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from stiffmap.experiment.poses.handeye import Frames, Sighting, _linear, _move, find_frames

COUNT = 30
SETUP, TARGET = np.arange(COUNT) % 2, np.arange(COUNT) % 3


def turns(seed: int, count: int) -> np.ndarray:
    return Rotation.random(count, random_state=seed).as_matrix()


def sighting(turned: bool, noise: float = 0.0) -> tuple[Sighting, Frames]:
    """Two instruments see three targets, with or without their orientation; in m and rad of noise. The frames are the true ones."""
    rng = np.random.default_rng(5)
    p, r = rng.uniform(-0.5, 0.5, (COUNT, 3)), turns(1, COUNT)
    f = Frames(turns(2, 2), rng.uniform(-2, 2, (2, 3)), turns(3, 3), rng.uniform(-0.1, 0.1, (3, 3)))
    at = p + np.einsum("nij,nj->ni", r, f.tool_p[TARGET])
    q = f.base_p[SETUP] + np.einsum("nij,nj->ni", f.base_r[SETUP], at) + noise * rng.normal(size=(COUNT, 3))
    m = f.base_r[SETUP] @ r @ f.tool_r[TARGET]
    m = m @ Rotation.from_rotvec(noise * rng.normal(size=(COUNT, 3))).as_matrix()
    return Sighting(p, r, q, m if turned else np.full_like(m, np.nan), SETUP, TARGET), f


@pytest.mark.parametrize("turned", [True, False])
def test_slopes_are_central_differences(turned: bool) -> None:
    s, f = sighting(turned)
    slopes = _linear(s, f)[1]
    errors = []
    for h in (1e-3, 5e-4):
        numeric = np.empty_like(slopes)
        for k, step in enumerate(np.eye(slopes.shape[1])):
            sides = [deepcopy(f), deepcopy(f)]
            for side, sign in zip(sides, (1.0, -1.0), strict=True):
                _move(side, sign * h * step)
            numeric[:, k] = (_linear(s, sides[0])[0] - _linear(s, sides[1])[0]) / (2 * h)
        errors.append(np.abs(numeric - slopes).max())
    assert errors[0] < 1e-5 and errors[0] / errors[1] == pytest.approx(4.0, rel=0.1)


@pytest.mark.parametrize("turned", [True, False])
def test_frames_are_found_to_the_noise(turned: bool) -> None:
    s, f = sighting(turned, noise=1e-4)
    found = find_frames(s)
    assert np.abs(found.base_p - f.base_p).max() < 5e-4 and np.abs(found.tool_p - f.tool_p).max() < 5e-4
    assert np.abs(found.base_r - f.base_r).max() < 5e-4
    assert not turned or np.abs(found.tool_r - f.tool_r).max() < 5e-4
