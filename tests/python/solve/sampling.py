"""Random poses and loads inside a shipped machine's workspace, and rotation helpers of the tests."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

import stiffmap as sm


def poses(machine: sm.Machine, n: int, seed: int, margin: float = 0.1) -> np.ndarray:
    """(n, 3) m, inside the workspace box and within reach."""
    rng = np.random.default_rng(seed)
    low, high = machine.workspace
    edge = margin * (high - low)
    found = rng.uniform(low + edge, high - edge, (20 * n, 3))
    reachable = sm.inverse_kinematics(machine, found).status == sm.Status.CONVERGED
    assert reachable.sum() >= n
    return found[reachable][:n]


def wrenches(n: int, seed: int, force: float = 1000.0, moment: float = 60.0) -> np.ndarray:
    """(n, 6) N, N·m."""
    rng = np.random.default_rng(seed)
    return rng.uniform(-1, 1, (n, 6)) * ([force] * 3 + [moment] * 3)


def cross(a: np.ndarray) -> np.ndarray:
    """(..., 3, 3) cross-product matrices."""
    zero = np.zeros(a.shape[:-1])
    rows = [[zero, -a[..., 2], a[..., 1]], [a[..., 2], zero, -a[..., 0]], [-a[..., 1], a[..., 0], zero]]
    return np.stack([np.stack(r, axis=-1) for r in rows], axis=-2)


def twist(now: np.ndarray, reference: np.ndarray) -> np.ndarray:
    """Small twist from one displacement (translation, rotation vector) to another, base axes."""
    turned = Rotation.from_rotvec(now[..., 3:]) * Rotation.from_rotvec(reference[..., 3:]).inv()
    return np.concatenate([now[..., :3] - reference[..., :3], turned.as_rotvec()], axis=-1)


def relative(got: np.ndarray, wanted: np.ndarray) -> float:
    """Largest error of a compliance, each entry against the geometric mean of its diagonal."""
    size = np.sqrt(np.abs(np.diagonal(wanted, axis1=-2, axis2=-1)))
    return float(np.max(np.abs(got - wanted) / (size[..., :, None] * size[..., None, :])))
