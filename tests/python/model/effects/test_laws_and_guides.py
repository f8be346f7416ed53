"""Laws on single directions of link springs, tables, and guides that are not straight: closed forms."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from tests.python.model.effects.test_closed_forms import FORCES, LINK, C, deflection, slider

import stiffmap as sm
from stiffmap.common.errors import StiffmapError

METHODS = ("fast", "reference")
STEP, FACTORS = 2e-6, {"factor_1": 0.4, "factor_2": 0.7, "factor_3": 0.9, "factor_4": 1.2}


def table(stiffness: float) -> Any:
    """Deflection under a force by the table above, and beyond it along its last piece."""
    f = np.array([0.0, *(i * STEP * stiffness * v for i, v in enumerate(FACTORS.values(), 1))])
    a = STEP * np.arange(5)
    slope = (a[4] - a[3]) / (f[4] - f[3])

    def curve(force: np.ndarray) -> np.ndarray:
        size = np.abs(force)
        inside = np.interp(size, f, a)
        return np.asarray(np.sign(force) * np.where(size > f[4], a[4] + slope * (size - f[4]), inside))

    return curve


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(("element", "own", "rest"), [("x", C, LINK), ("link.k11", LINK, C)])
def test_table(element: str, own: float, rest: float, method: str) -> None:
    machine = slider().with_effect("tabulated", element=element, step=STEP, **FACTORS)
    wrench = np.zeros((len(FORCES), 6))
    wrench[:, 0] = FORCES
    got = machine.solve(machine.description.home.p, wrench, method=method).displacement[:, 0]
    assert got == pytest.approx(table(1 / own)(FORCES) + rest * FORCES, abs=1e-15)


def test_laws_of_a_link_direction() -> None:
    """The closed forms of a drive, on the link."""
    gap = slider().with_effect("dead_zone", element="link.k11", half_width=1e-5)
    assert deflection(gap, FORCES) == pytest.approx((C + LINK) * FORCES + 1e-5 * np.sign(FORCES), abs=1e-15)
    hard = slider().with_effect("hardening", element="link.k11", cubic=1e17)
    a = deflection(hard, FORCES) - C * FORCES
    assert a / LINK + 1e17 * a**3 == pytest.approx(FORCES, rel=1e-9)  # a is a small difference
    knee = slider().with_effect("bilinear", element="link.k11", ratio=3.0, knee=50.0)
    inside = np.clip(FORCES, -50, 50)
    bent = C * FORCES + LINK * (inside + 3.0 * (FORCES - inside))
    assert deflection(knee, FORCES) == pytest.approx(bent, abs=1e-15)
    for branch, sign in (("loading", -1.0), ("unloading", 1.0)):
        with_friction = slider().with_effect("friction", element="link.k11", force=10.0, branch=branch)
        shifted = (C + LINK) * FORCES + sign * LINK * 10.0 * np.sign(FORCES)
        assert deflection(with_friction, FORCES) == pytest.approx(shifted, abs=1e-15)


def test_only_directions_that_stand_alone_are_offered() -> None:
    """The bar's bending couples k22 with k66 and k33 with k55."""
    orthoglide = sm.load_machine("orthoglide-revised")
    with pytest.raises(StiffmapError, match=r"there are: actuator, foot.k22, foot.k55, bar.k11, bar.k44"):
        orthoglide.with_effect("hardening", element="bar.k22", cubic=1e12)
    with pytest.raises(StiffmapError, match="give torque"):
        orthoglide.with_effect("friction", element="bar.k44", force=1.0)


@pytest.mark.parametrize("kind", ["hardening", "bilinear", "dead_zone"])
def test_both_paths_agree_on_a_coupled_spring_with_a_law(kind: str) -> None:
    size = {
        "hardening": {"cubic": 1e17},
        "bilinear": {"ratio": 2.0, "knee": 50.0},
        "dead_zone": {"half_width": 1e-6},
    }
    machine = sm.load_machine("orthoglide-revised").with_effect(kind, element="bar.k11", **size[kind])
    args = ([0.05, 0.1, -0.1], [100.0, -50.0, 300.0, 0, 0, 0])
    fast, reference = (machine.solve(*args, method=m) for m in METHODS)
    plain = sm.load_machine("orthoglide-revised").solve(*args)
    np.testing.assert_allclose(fast.displacement, reference.displacement, rtol=1e-9)
    assert np.abs(fast.displacement - plain.displacement).max() > 1e-7


def test_a_table_must_rise() -> None:
    with pytest.raises(StiffmapError, match="the force must rise"):
        slider().with_effect("tabulated", element="x", step=1e-6, factor_2=0.4)


@pytest.mark.parametrize("method", METHODS)
def test_straightness_along_the_stroke(method: str) -> None:
    """Two harmonics in y, one in z; nothing along the guide."""
    x = np.linspace(0.2, 0.9, 8)
    machine = slider().with_effect("straightness", element="x", amplitude=3e-5, period=1.4, phase=0.3)
    machine = machine.with_effect("straightness", element="x", amplitude=1e-5, period=0.2)
    machine = machine.with_effect("straightness", element="x", amplitude=2e-5, period=0.9, across="z")
    u = x - 0.5
    y = 3e-5 * np.sin(2 * np.pi * u / 1.4 + 0.3) + 1e-5 * np.sin(2 * np.pi * u / 0.2)
    z = 2e-5 * np.sin(2 * np.pi * u / 0.9)
    got = machine.solve(np.stack([x, 0 * x, 0 * x], axis=-1), method=method).displacement
    np.testing.assert_allclose(got[:, :3], np.stack([0 * x, y, z], axis=-1), atol=1e-15)


def test_straightness_is_an_offset_of_the_guide_where_it_is_measured() -> None:
    """On the Orthoglide, at one pose: the same as a guide built that much beside its place."""
    machine, pose, force = (
        sm.load_machine("orthoglide-revised"),
        (0.05, 0.1, -0.1),
        (100.0, -50, 300, 0, 0, 0),
    )
    u = machine.solve(pose).joint_coordinates["y.actuator"]
    home = machine.description.legs[1].elements
    start = next(e.home[0] for e in home if e.name == "actuator")
    deviation = 4e-5 * np.sin(2 * np.pi * (float(u) - start) / 0.8 + 1.0)
    place = {"element": "actuator", "legs": ["y"]}
    for axis in ("y", "z"):
        bent = machine.with_effect(
            "straightness", **place, across=axis, amplitude=4e-5, period=0.8, phase=1.0
        )
        beside = machine.with_effect("position_offset", **place, **{f"error_{axis}": deviation})
        for method in METHODS:
            a, b = (m.solve(pose, force, method=method) for m in (bent, beside))
            np.testing.assert_allclose(a.displacement, b.displacement, rtol=1e-9, atol=1e-15)
            np.testing.assert_allclose(a.stiffness, b.stiffness, rtol=1e-9, atol=1e-3)
        assert np.abs(a.displacement - machine.solve(pose, force).displacement).max() > 1e-6


def test_straightness_is_across_the_guide() -> None:
    with pytest.raises(StiffmapError, match="across=x is not across the guide"):
        slider().with_effect("straightness", element="x", amplitude=1e-5, period=1.0, across="x")


@pytest.mark.parametrize(
    ("kind", "arguments"),
    [
        (
            "straightness",
            {"element": "actuator", "legs": ["y"], "amplitude": 1e-5, "period": 0.7, "across": "z"},
        ),
        ("tabulated", {"element": "foot.k22", "step": 1e-6, "factor_1": 0.5}),
        ("hardening", {"element": "bar.k11", "cubic": 1e16}),
        ("joint_friction", {"element": "pin_distal", "torque": 0.4, "branch": "unloading"}),
    ],
)
def test_saved_and_loaded(kind: str, arguments: dict[str, Any], tmp_path: Any) -> None:
    machine = sm.load_machine("orthoglide-revised").with_effect(kind, **arguments)
    machine.save(tmp_path / "machine.yaml")
    again = sm.load_machine(tmp_path / "machine.yaml")
    assert again == machine
    pose, force = (0.05, 0.1, -0.1), (100.0, -50, 300, 0, 0, 0)
    np.testing.assert_array_equal(
        again.solve(pose, force).displacement, machine.solve(pose, force).displacement
    )
