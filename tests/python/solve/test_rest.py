"""`rest` of a link spring is the deflection at which it is free of force: with laws, with effects, in rigid directions."""

from __future__ import annotations

import numpy as np
import pytest

import stiffmap as sm
from stiffmap.model.files import description_from_text

METHODS = ("fast", "reference")
REST = (2e-4, -1e-4, 3e-4, 1e-3, -2e-3, 5e-4)
STIFF = (1e6, 2e6, 3e6, 1e6, 2e6, 3e6)
AXES = ("tx", "ty", "tz", "rx", "ry", "rz")


def link(laws: str = "", rest: tuple[float, ...] = REST, rigid: int | None = None) -> sm.Machine:
    numbers = ", ".join("0" if i == rigid else str(1 / k) for i, k in enumerate(STIFF))
    return sm.Machine(
        description_from_text(
            "name: link\nunits: {length: m, force: N, angle: rad}\nhome: {translation: [0, 0, 0]}\nlegs:\n  a:\n"
            f"    elements:\n      - {{spring: s, compliance: [{numbers}], rest: {list(rest)}{laws}}}\n"
        )
    )


def unit(i: int) -> np.ndarray:
    return np.eye(6)[i]


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("i", range(6), ids=AXES)
@pytest.mark.parametrize("law", ["knots: [[0, 0], [1.0e-3, 1000]]", "cubic: 1.0e12", "knots: [[-1.0e-3, -1500], [1.0e-3, 1500]]"])  # fmt: skip
def test_a_law_counts_from_rest(law: str, i: int, method: str) -> None:
    rest = tuple(v if k == i else 0.0 for k, v in enumerate(REST))
    with_law = link(f", laws: {{{AXES[i]}: {{stiffness: {STIFF[i]}, {law}}}}}", rest)
    without = link(f", laws: {{{AXES[i]}: {{stiffness: {STIFF[i]}, {law}}}}}", (0.0,) * 6)
    for load in (0.0, -60.0, 170.0):
        moved = with_law.solve(np.zeros(3), load * unit(i), method=method).displacement
        plain = without.solve(np.zeros(3), load * unit(i), method=method).displacement
        np.testing.assert_allclose(moved - plain, np.array(rest), rtol=0, atol=1e-15)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(
    ("kind", "numbers"),
    [("hardening", {"cubic": 1e-3}), ("friction", {"force": 1e-9}), ("dead_zone", {"half_width": 1e-13})],
)
def test_an_effect_that_is_nothing_moves_nothing(kind: str, numbers: dict[str, float], method: str) -> None:
    machine = link()
    changed = machine.with_effect(kind, element="s.k11", legs=["a"], **numbers)
    for load in (np.zeros(6), np.array([-100.0, 40, 30, 0, 0, 0])):
        np.testing.assert_allclose(
            changed.solve(np.zeros(3), load, method=method).displacement,
            machine.solve(np.zeros(3), load, method=method).displacement,
            rtol=0,
            atol=1e-12,
        )


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("i", range(6), ids=AXES)
def test_a_rigid_direction_stands_at_rest(i: int, method: str) -> None:
    """As one that yields and bears nothing."""
    rest = tuple(v if k == i else 0.0 for k, v in enumerate(REST))
    load = np.array([50.0, -30, 20, 0, 0, 0]) * (np.arange(6) != i)
    for w in (np.zeros(6), load):
        got = link(rest=rest, rigid=i).solve(np.zeros(3), w, method=method).displacement
        want = link(rest=rest).solve(np.zeros(3), w, method=method).displacement
        np.testing.assert_allclose(got, want, rtol=0, atol=1e-9 * abs(REST[i]) + 1e-10 * np.abs(w).max() / 50)
        assert abs(got[i] - REST[i]) < 1e-9
