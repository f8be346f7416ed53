"""Model-free checks: each holds for a linear elastic machine and fails on the twin that breaks it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import kstest

import stiffmap as sm
from stiffmap.experiment import Experiment, simulate
from stiffmap.experiment.calls import placed
from stiffmap.experiment.noise.checks import Check, checks
from stiffmap.experiment.virtual.plans import load_set, plan_of_poses, random_poses, with_branches

ALL = ("linearity", "sign reversal", "superposition", "return to zero", "reciprocity")


@pytest.fixture(scope="module")
def full(orthoglide: sm.Machine) -> Experiment:
    poses = random_poses(orthoglide, 8, seed=4)
    return plan_of_poses(orthoglide, "deflection", poses, load_set("full", [100.0, 250.0, 400.0]), repeats=2)


def made(e: Experiment) -> dict[str, Check]:
    return {c.name: c for c in checks(e, e.reading, e.sigma, np.ones(len(e), bool))}


def with_offset(e: Experiment, metres: float) -> Experiment:
    return replace(e, reading=e.reading + metres)


@pytest.mark.parametrize(
    "effect",
    [
        "",
        "compliance actuator y scale=3",
        "load_gain load gain=1.2",
        "base_compliance base translation=2e-7m/N",
    ],
)
def test_linear_elastic_machines_pass(effect: str, orthoglide: sm.Machine, full: Experiment) -> None:
    terms = [placed(orthoglide, effect)] if effect else []
    found = made(simulate(orthoglide, full, terms, seed=2))
    for name in ALL:
        assert found[name].contrasts > 0
        assert found[name].p > 1e-3, name
        assert found[name].rms == pytest.approx(1.0, abs=0.25)


@pytest.mark.parametrize(
    ("effect", "broken", "kept"),
    [
        ("dead_zone actuator y half_width=15um", ("linearity", "superposition"), ("sign reversal", "return to zero")),
        ("friction actuator y force=80N", ("linearity", "superposition"), ("sign reversal", "return to zero")),
        ("hardening actuator y cubic=1e16N/m^3", ("linearity",), ("sign reversal", "return to zero")),
        ("load_direction load angle_z=0.08rad", ("reciprocity",), ("linearity", "sign reversal", "superposition")),
        ("sensor_axes sensor angle_x=0.08rad", ("reciprocity",), ("linearity", "sign reversal", "superposition")),
        ("sensor_gain sensor gain_x=1.3", ("reciprocity",), ("linearity", "sign reversal", "superposition")),
    ],
)  # fmt: skip
def test_each_breaks_what_it_must(
    effect: str, broken: tuple[str, ...], kept: tuple[str, ...], orthoglide: sm.Machine, full: Experiment
) -> None:
    found = made(simulate(orthoglide, full, [placed(orthoglide, effect)], seed=2))
    for name in broken:
        assert found[name].p < 1e-6, name
    for name in kept:
        assert found[name].p > 1e-3, name


def test_reciprocity_says_nothing_of_a_machine_that_is_not_linear(
    orthoglide: sm.Machine, full: Experiment
) -> None:
    """Play is conservative, yet the matrix of mean slopes is not symmetric: no one may blame the axes."""
    twin = simulate(orthoglide, full, [placed(orthoglide, "dead_zone actuator y half_width=15um")], seed=2)
    c = made(twin)["reciprocity"]
    assert c.contrasts == 0
    assert "not linear" in c.note


def test_a_zero_that_is_off(orthoglide: sm.Machine, full: Experiment) -> None:
    found = made(with_offset(simulate(orthoglide, full, seed=2), 6e-6))
    for name in ("return to zero", "sign reversal", "superposition"):
        assert found[name].p < 1e-6, name


def test_an_unknown_zero_leaves_what_does_not_need_it(orthoglide: sm.Machine, full: Experiment) -> None:
    twin = simulate(orthoglide, replace(full, unloaded="unknown"), seed=2)
    found = made(twin)
    assert not any(found[n].contrasts for n in ("return to zero", "sign reversal", "superposition"))
    assert made(replace(twin, unloaded="centre"))["return to zero"].p < 1e-6


def test_a_shared_zero_is_in_the_covariance(orthoglide: sm.Machine, full: Experiment) -> None:
    twin = simulate(orthoglide, replace(full, zero_sigma=np.array([6e-6] * 3 + [0.0] * 3)), seed=2)
    assert all(made(twin)[n].p > 1e-3 for n in ALL)
    assert made(replace(twin, zero_sigma=np.zeros(6)))["return to zero"].p < 1e-6


def test_hysteresis(orthoglide: sm.Machine, full: Experiment) -> None:
    both = with_branches(full)
    assert made(simulate(orthoglide, both, seed=2))["hysteresis"].p > 1e-3
    rubbing = simulate(orthoglide, both, [placed(orthoglide, "friction actuator y force=40N")], seed=2)
    assert made(rubbing)["hysteresis"].p < 1e-6


def test_reciprocity_needs_force_and_reading_at_one_point(orthoglide: sm.Machine, full: Experiment) -> None:
    twin = simulate(orthoglide, full, seed=2)
    assert made(replace(twin, load_point="elsewhere"))["reciprocity"].contrasts == 0


def test_p_values_are_uniform_under_noise(orthoglide: sm.Machine, full: Experiment) -> None:
    """Contrasts share readings; with their covariance the p-value of each check is uniform."""
    exact = simulate(orthoglide, replace(full, sigma=full.sigma * 1e-9), seed=0)
    rng = np.random.default_rng(5)
    seen: dict[str, list[float]] = {n: [] for n in ALL}
    for _ in range(40):
        noisy = replace(full, reading=exact.reading + full.sigma * rng.standard_normal(full.sigma.shape))
        for name, check in made(noisy).items():
            if name in seen:
                seen[name].append(check.p)
    for name, p in seen.items():
        assert kstest(p, "uniform").pvalue > 1e-3, name
