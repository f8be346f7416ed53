"""A platform in eight cables under random loads: always the minimum that is near, by both paths."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from tests.python.workspace.cables.energy import hung

from stiffmap import Flag, Machine, Status
from stiffmap.model.description import Body, Cable, MachineDescription, Pose

SMOOTH = ("fast", "reference")


def suspension(seed: int, *, radius: float = 0.0) -> Machine:
    """Four cables from above, four from below, some at their free length, some under pretension."""
    rng = np.random.default_rng(seed)
    cables = []
    for i in range(8):
        sx, sy = ((-1, -1), (-1, 1), (1, 1), (1, -1))[i % 4]
        z = 1.9 if i < 4 else 0.05
        anchor = np.array([0.9 * sx, 0.8 * sy, z]) + rng.uniform(-0.1, 0.1, 3)
        at = np.array([0.2 * sx, 0.15 * sy, 0.05 if i < 4 else -0.05]) + rng.uniform(-0.03, 0.03, 3)
        cables.append(
            Cable(
                f"c{i + 1}",
                anchor=tuple(anchor),
                at=tuple(at),
                stiffness=9e5,
                pretension=float(rng.choice([0.0, 400.0])),
                radius=radius,
            )
        )
    return Machine(
        MachineDescription(
            "suspension",
            (),
            platform=(*cables, Body("body", 60.0, (0.005, -0.008, 0.03))),
            home=Pose((0.0, 0.0, 0.95)),
            gravity=(0.0, 0.0, -9.81),
        )
    )


def cases(seed: int, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Positions and forces: from nothing to several times the weight."""
    rng = np.random.default_rng(seed)
    p = np.array([0, 0, 0.95]) + rng.uniform(-0.15, 0.15, (count, 3))
    size = 10 ** rng.uniform(0, 3.5, (count, 1))
    direction = rng.normal(size=(count, 3))
    w = np.zeros((count, 6))
    w[:, :3] = size * direction / np.linalg.norm(direction, axis=1, keepdims=True)
    return p, w


def check(machine: Machine, count: int, seed: int) -> None:
    p, w = cases(seed, count)
    both = {m: machine.solve(p, w, method=m) for m in SMOOTH}
    for method, s in both.items():
        assert (s.status == Status.CONVERGED).all(), (method, np.flatnonzero(s.status))
    fast, reference = both["fast"], both["reference"]
    assert not (fast.flags & Flag.REFERENCE_PATH).any()
    near = ~((fast.flags | reference.flags) & Flag.BRANCH_UNVERIFIED).astype(bool)
    assert near.mean() > 0.9
    np.testing.assert_allclose(fast.displacement[near], reference.displacement[near], rtol=1e-9, atol=1e-12)
    scale = np.abs(reference.compliance[near]).max((-2, -1), keepdims=True)
    assert np.abs((fast.compliance - reference.compliance)[near] / scale).max() < 1e-9
    slack = 0
    for i in np.flatnonzero(near):
        here = hung(machine.description, p[i], np.eye(3))
        q, r = here.minimum(p[i], np.eye(3), w[i, :3])
        d = fast.displacement[i]
        np.testing.assert_allclose(q - p[i], d[:3], atol=2e-8)
        np.testing.assert_allclose(Rotation.from_matrix(r).as_rotvec(), d[3:], atol=2e-7)
        t = here.tension(q, r)[0]
        np.testing.assert_allclose(fast.tension[i], t, atol=0.05)
        slack += (t == 0).any()
        assert bool(fast.flags[i] & Flag.SLACK) == bool((fast.tension[i] == 0).any())
    assert slack > 0.1 * near.sum()


@pytest.mark.parametrize("seed", [1, 2])
def test_few(seed: int) -> None:
    """A handful of loads on two suspensions."""
    check(suspension(seed), 15, seed)


def test_two_hundred_random_loads() -> None:
    """None is left without an answer, all are the minimum that an independent descent finds."""
    for seed in range(5):
        check(suspension(seed), 40, seed + 10)


def test_pulleys_agree() -> None:
    """Both paths over pulleys."""
    machine = suspension(3, radius=0.03)
    p, w = cases(4, 40)
    fast, reference = (machine.solve(p, w, method=m) for m in SMOOTH)
    assert (fast.status == Status.CONVERGED).all()
    near = ~((fast.flags | reference.flags) & Flag.BRANCH_UNVERIFIED).astype(bool)
    np.testing.assert_allclose(fast.displacement[near], reference.displacement[near], rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("seed", [3, 8, 21])
def test_a_platform_that_turns_far_is_flagged(seed: int) -> None:
    """A turn counts as an arc at the machine's length: without the flag both paths stand in one minimum, and near."""
    machine = suspension(seed)
    rng = np.random.default_rng(seed)
    wrench = rng.normal(size=(80, 6)) * 2e3
    wrench[:, 3:] *= 10 ** rng.uniform(-1, 1.6, (80, 1))
    at = np.tile(machine.description.home.p, (80, 1))
    answers = [machine.solve(at, wrench, gravity=(0, 0, -9.81), method=method) for method in SMOOTH]
    turned = [np.linalg.norm(a.displacement[:, 3:], axis=1) for a in answers]
    assert max(np.nanmax(t) for t in turned) > 1.0
    for a, t in zip(answers, turned, strict=True):
        flagged = (a.flags & Flag.BRANCH_UNVERIFIED) != 0
        assert not ((a.status == Status.CONVERGED) & (t > 0.3) & ~flagged).any()
    near = ~((answers[0].flags | answers[1].flags) & Flag.BRANCH_UNVERIFIED).astype(bool)
    assert near.any()
    np.testing.assert_allclose(
        answers[0].displacement[near], answers[1].displacement[near], rtol=0, atol=1e-8
    )
