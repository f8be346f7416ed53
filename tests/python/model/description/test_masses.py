"""Masses of links from their sections and material, by hand; a declared number wins."""

from __future__ import annotations

import numpy as np
import pytest

import stiffmap as sm
from stiffmap.model.description import Body
from stiffmap.model.description.tree import all_elements
from stiffmap.workspace.performance.motion.inertia import moving_mass

FILE = """
name: arm
units: {length: mm, force: N, angle: rad, mass: kg}
home: {translation: [400, 0, 0]}
workspace: {x: [390, 410], y: [-10, 10], z: [-10, 10]}
task: [x]
materials: {steel: {E: 2.1e5, nu: 0.3, density: 7.85e-6}, aluminium: {E: 7.0e4, nu: 0.33}}
legs:
  one:
    elements:
      - {actuator: slide, kind: prismatic, axis: x, rigid: true}
      - BODY
      - {offset: length, translation: [400, 0, 0]}
      - AFTER
      - {spring: bar, beam: {length: 400, along: x, SECTION, material: steel}}
"""
OTHER = "{point: mark}"
TUBE = "tube: {outer: 30, inner: 26}"


def body(tmp_path, first="{body: bar, of: bar}", after=OTHER, section=TUBE):
    path = tmp_path / "arm.yaml"
    path.write_text(FILE.replace("BODY", first).replace("AFTER", after).replace("SECTION", section))
    machine = sm.load_machine(path)
    (found,) = (e for _, e in all_elements(machine.description) if isinstance(e, Body))
    return machine, found


def test_a_tube_by_hand(tmp_path):
    machine, b = body(tmp_path)
    mass = 7850 * np.pi / 4 * (0.030**2 - 0.026**2) * 0.4  # 0.5524 kg
    assert b.mass == pytest.approx(mass, rel=1e-12) and moving_mass(machine) == pytest.approx(
        0.5524, abs=1e-4
    )
    assert b.com == pytest.approx((0.2, 0, 0))  # at the root: the offset leads on
    radii = 0.030**2 + 0.026**2
    axial, across = mass * radii / 8, mass * (radii / 16 + 0.4**2 / 12)
    np.testing.assert_allclose(np.array(b.inertia), np.diag([axial, across, across]), rtol=1e-12)


def test_a_rectangle_by_hand_and_at_the_end_of_the_beam(tmp_path):
    _, b = body(tmp_path, OTHER, "{body: bar, of: bar}", "rectangle: {width: 20, height: 50}")
    mass = 7850 * 0.02 * 0.05 * 0.4
    assert b.mass == pytest.approx(mass) and b.com == pytest.approx((-0.2, 0, 0))
    # width along y, height along z
    about = mass / 12 * np.array([0.02**2 + 0.05**2, 0.4**2 + 0.05**2, 0.4**2 + 0.02**2])
    np.testing.assert_allclose(np.array(b.inertia), np.diag(about), rtol=1e-12)


def test_what_is_declared_wins(tmp_path):
    _, plain = body(tmp_path)
    _, b = body(tmp_path, "{body: bar, of: bar, mass: 2, com: [150, 0, 0]}")
    assert b.mass == 2 and b.com == pytest.approx((0.15, 0, 0))
    np.testing.assert_allclose(b.inertia, np.array(plain.inertia) * 2 / plain.mass, rtol=1e-12)
    _, b = body(tmp_path, "{body: bar, of: bar, inertia: [1, 2, 3]}")
    np.testing.assert_allclose(b.inertia, np.diag([1e-6, 2e-6, 3e-6]), rtol=1e-12)


@pytest.mark.parametrize(
    ("first", "section", "words"),
    [
        ("{body: bar}", TUBE, "a body needs a mass, or of"),
        ("{body: bar, of: rod}", TUBE, "no spring 'rod' with a beam in this sequence; there are: bar"),
        ("{body: bar, of: bar}", "EA: 1, GJ: 1, EIy: 1, EIz: 1", "no section|material"),
    ],
)
def test_bad_input(tmp_path, first, section, words):
    with pytest.raises(sm.StiffmapError, match=words):
        body(tmp_path, first, section=section)


def test_a_material_without_density_is_named(tmp_path):
    path = tmp_path / "arm.yaml"
    text = FILE.replace("BODY", "{body: bar, of: bar}").replace("AFTER", OTHER).replace("SECTION", TUBE)
    path.write_text(text.replace("material: steel", "material: aluminium"))
    with pytest.raises(sm.StiffmapError, match="has not a material with a density"):
        sm.load_machine(path)
