"""Random machines: the core agrees with energy minimisation, by both paths; numbers and statuses."""

from __future__ import annotations

import pytest
from tests.oracle.compare import Comparison, compare, compare_machine
from tests.oracle.generate import Generator
from tests.oracle.nightly import objection

import stiffmap as sm

FAMILIES = (
    "random_legs",
    "hexapod",
    "heavy_starts",
    "spinning_rods",
    "arm_on_a_rail",
    "unlike_delta",
    "four_legs",
    "strut",
)


def of_family(family: str, seed: int) -> list[Comparison]:
    generator = Generator(seed)
    d = getattr(generator, family)()
    loads, pose = generator.loads(d), generator.pose(d)
    return compare_machine(generator.declared(d), loads, pose=pose)


@pytest.mark.parametrize("seed", range(12))
def test_core_agrees_with_energy_minimisation(seed: int) -> None:
    for c in compare(seed):
        assert not objection(c), c


@pytest.mark.parametrize("family", FAMILIES)
def test_every_family_agrees(family: str) -> None:
    for c in of_family(family, 10_000):
        assert not objection(c), c


@pytest.mark.parametrize("seed", range(133, 145))
def test_heavy_joints_before_the_first_spring(seed: int) -> None:
    """The fast path's tangent with bodies that turn and slide before anything yields (docs/fast_path.md F9)."""
    for c in of_family("heavy_starts", seed):
        assert not objection(c), c


@pytest.mark.parametrize("seed", [1147, 401, 732, 1246, 372, 1522, 1668, 1001, 1678])
def test_rods_that_spin_far(seed: int) -> None:
    """Machines whose rods turn far under their weight, past locks of the axes that their balls are declared with."""
    for c in compare(seed):
        assert not objection(c), c


def test_struts_buckle_where_the_energy_says_so() -> None:
    """Beyond exact bifurcations: unstable without a flag, or flagged, never CONVERGED and unflagged."""
    seen = [c for seed in range(20) for c in of_family("strut", seed)]
    for c in seen:
        assert not objection(c), c
    beyond = [c for c in seen if c.truth == "found" and c.crossed and not c.told]
    assert {c.status for c in beyond} == {sm.Status.UNSTABLE} and len(beyond) > 3
