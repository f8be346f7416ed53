"""Polar diagrams and sweeps."""

from __future__ import annotations

import numpy as np
import pytest

import stiffmap as sm
from stiffmap.model.files import description_from_text

CORNER = np.array([-0.2, -0.2, -0.2])


def test_polar_values_are_those_of_solve(machine: sm.Machine) -> None:
    pol = sm.polar(machine, CORNER, force=200.0, directions=12)
    a = pol.angle.values
    zero = np.zeros(12)
    wrench = 200.0 * np.stack([np.cos(a), np.sin(a), zero, zero, zero, zero], axis=-1)
    np.testing.assert_array_equal(pol.displacement, machine.solve(CORNER, wrench).displacement)
    assert pol.worst_deflection >= pol.deflection.max()
    assert pol.best_deflection <= pol.deflection.min()
    assert pol.worst_deflection_xy >= pol.deflection_xy.max()


def test_polar_of_the_isotropic_point_is_a_circle(machine: sm.Machine) -> None:
    pol = sm.polar(machine, np.zeros(3), directions=16)
    assert float(pol.worst_deflection_xy / pol.best_deflection_xy) == pytest.approx(1.0, abs=1e-3)


def test_polar_extremes_of_a_diagonal_point_lie_on_the_diagonals(machine: sm.Machine) -> None:
    pol = sm.polar(machine, CORNER)
    worst, best = np.rad2deg([pol.worst_direction_xy, pol.best_direction_xy])
    # 45 and 135 degrees modulo 180 by the symmetry x <-> y, kept by the loaded equilibrium
    assert worst % 180 == pytest.approx(45, abs=0.05)
    assert best % 180 == pytest.approx(135, abs=0.5)


def test_sweep_starts_at_the_unloaded_machine(machine: sm.Machine) -> None:
    swp = sm.sweep(machine, CORNER, [1.0, 1.0, 0.0], [-300.0, 0.0, 300.0])
    assert float(swp.deflection[1]) < 1e-12
    assert swp.direction.values == pytest.approx([0.5**0.5, 0.5**0.5, 0])
    assert float(swp.deflection_along[0]) < 0 < float(swp.deflection_along[2])
    f = np.array([300.0, 300.0, 0, 0, 0, 0]) * 0.5**0.5
    np.testing.assert_allclose(
        swp.displacement[2], machine.solve(CORNER, f).displacement, rtol=1e-12, atol=1e-15
    )


def test_compliance_along_is_the_slope(machine: sm.Machine) -> None:
    h = 0.5
    swp = sm.sweep(machine, CORNER, [0.0, 1.0, 0.0], [200 - h, 200, 200 + h])
    slope = (swp.deflection_along[2] - swp.deflection_along[0]) / (2 * h)
    assert float(swp.compliance_along[1]) == pytest.approx(float(slope), rel=1e-7)


def test_single_forces_and_paths_have_one_schema(machine: sm.Machine) -> None:
    """The same variables, dimensions, types and units; what one of them has not is NaN or empty."""
    single = sm.sweep(machine, CORNER, [1.0, 1.0, 0.0], [0.0, 100.0])
    path = sm.sweep(machine, CORNER, [1.0, 1.0, 0.0], limit=100.0, steps=2)
    assert set(single.variables) == set(path.variables) and set(single.attrs) == set(path.attrs)
    for name, one in single.variables.items():
        other = path[name]
        assert one.dims == other.dims and one.dtype.kind == other.dtype.kind, name
        assert one.attrs.get("units") == other.attrs.get("units"), name
    assert np.isnan(single.unstable_modes).all() and np.isfinite(single.compliance_along).all()
    assert np.isnan(path.compliance_along).all() and (path.unstable_modes == 0).all()
    assert single.attrs["end"] == "" and single.sizes["critical"] == 0 and (single.branch == 0).all()
    np.testing.assert_allclose(path.displacement[-1], single.displacement[-1], rtol=1e-7, atol=1e-12)


SLIDES = """
name: slides
units: {{length: m, force: N, angle: deg, mass: kg}}
gravity: [{gx}, {gy}, 0]
home: {{translation: [0, 0, 0], turns: [{{about: z, by: {turn}}}]}}
task: [x, y]
legs:
  a:
    frame: {{translation: [0, 0, 0], turns: [{{about: z, by: {turn}}}]}}
    elements:
      - {{actuator: stiff, kind: prismatic, axis: x, stiffness: 1.0e8}}
      - {{actuator: soft, kind: prismatic, axis: y, stiffness: {soft}}}
platform:
  - {{body: tool, mass: 10, com: [0, 0, 0], inertia: [1, 1, 1]}}
"""


@pytest.mark.parametrize("soft", [1e6, 2e7])
@pytest.mark.parametrize("turn", [1.25, 2.5, 31.0, 88.1])
@pytest.mark.parametrize(("gx", "gy"), [(-14.9821, -0.98146), (3.0, -9.0), (0.0, -14.0)])
def test_of_two_extremes_the_farther_one_is_found(soft: float, turn: float, gx: float, gy: float) -> None:
    """Two slides under gravity are a linear machine: |C (m g + F u)|. Its two minima, and its two maxima, lie half a turn
    apart, on points of a scan or between them."""
    m = sm.Machine(description_from_text(SLIDES.format(soft=soft, turn=turn, gx=gx, gy=gy)))
    c, s = np.cos(np.radians(turn)), np.sin(np.radians(turn))
    turned = np.array([[c, -s], [s, c]])
    compliance = turned @ np.diag([1e-8, 1 / soft]) @ turned.T
    angle = np.linspace(0, 2 * np.pi, 200_001)
    push = 300 * np.array([np.cos(angle), np.sin(angle)])
    size = np.linalg.norm(compliance @ (10 * np.array([[gx], [gy]]) + push), axis=0)
    pol = sm.polar(m, np.zeros(3), force=300.0)
    assert float(pol.best_deflection) == pytest.approx(size.min(), rel=1e-5)
    assert float(pol.worst_deflection) == pytest.approx(size.max(), rel=1e-5)


@pytest.mark.parametrize(
    ("name", "at", "gravity"),
    [
        ("five-bar", (-0.1, 0.365, 0), (1, -2, -9)),
        ("ur10", (-0.7, 0.2, 0.4), (2, 3, -9)),
        ("tripteron", (0.3, 0.4, 0.5), (4, -3, -9)),
    ],
)
def test_extremes_of_machines_under_gravity(
    name: str, at: tuple[float, ...], gravity: tuple[float, ...]
) -> None:
    m = sm.load_machine(name)
    angle = np.linspace(0, 2 * np.pi, 1441)
    wrench = np.zeros((angle.size, 6))
    wrench[:, 0], wrench[:, 1] = 300 * np.cos(angle), 300 * np.sin(angle)
    size = np.linalg.norm(m.solve(at, wrench, gravity=gravity).displacement[:, :3], axis=1)
    pol = sm.polar(m, at, force=300.0, gravity=gravity)
    assert float(pol.best_deflection) <= size.min() * (1 + 1e-9)
    assert float(pol.worst_deflection) >= size.max() * (1 - 1e-9)
