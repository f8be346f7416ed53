"""Refinement of chosen designs and what tolerances do to them, against closed forms."""

from __future__ import annotations

import numpy as np
import pytest

import stiffmap as sm
from stiffmap.ui.plot.design import comparison_figure
from stiffmap.workspace.design import load_design
from stiffmap.workspace.design.chosen import robustness
from stiffmap.workspace.design.judging import judge, refine

MACHINE = """
name: bar
units: {length: mm, force: N, angle: rad, mass: kg}
home: {translation: [400, 0, 0]}
workspace: {x: [395, 405], y: [-1, 1], z: [-1, 1]}
materials: {steel: {E: 2.1e5, nu: 0.3, density: 7.85e-6}}
legs:
  one:
    elements:
      - {actuator: x, kind: prismatic, axis: x, rigid: true}
      - {actuator: y, kind: prismatic, axis: y, rigid: true}
      - {actuator: z, kind: prismatic, axis: z, rigid: true}
      - {actuator: a, kind: revolute, axis: x, rigid: true}
      - {actuator: b, kind: revolute, axis: y, rigid: true}
      - {actuator: c, kind: revolute, axis: z, rigid: true}
      - {body: bar, of: bar}
      - {offset: length, translation: [400, 0, 0]}
      - {spring: bar, beam: {length: 400, along: x, rectangle: {width: WIDTH, height: HEIGHT}, material: steel}}
"""
DESIGN = """
name: lightest
machine: bar.yaml
toolpath: cut.yaml
variables: {width: {low: 5, high: 60}, height: {low: 5, high: 60}}
numbers:
  legs.one.elements.spring[bar].beam.rectangle.width: width
  legs.one.elements.spring[bar].beam.rectangle.height: height
objectives: [mass]
constraints: {path_compliance: {at_most: 0.5 um/N}}
search: {nodes: 2, population: 8, generations: 2}
"""
CUT = """
name: cut
line: {start: [399 mm, 0 mm, 0 mm], end: [401 mm, 0 mm, 0 mm]}
duration: 1 s
force: [0 N, 1 N, 0 N]
"""
WIDTH, HEIGHT = "{value: 30, u: 0.1}", "{value: 20, u: 0.2}"


def problem(tmp_path, width=WIDTH, height=HEIGHT):
    (tmp_path / "bar.yaml").write_text(
        MACHINE.replace("WIDTH", width).replace("HEIGHT", height), encoding="utf-8"
    )
    (tmp_path / "cut.yaml").write_text(CUT, encoding="utf-8")
    (tmp_path / "design.yaml").write_text(DESIGN, encoding="utf-8")
    return load_design(tmp_path / "design.yaml")


def compliance(width, height):
    """Cantilever pushed along its width: L³ / 3EI, I = height width³ / 12, mm/N."""
    return 400**3 / (3 * 2.1e5 * height * width**3 / 12)


def test_the_lightest_bar_is_found(tmp_path):
    """As thin across as may be and as wide along the force as the compliance asks for."""
    design = problem(tmp_path)
    x = np.array([55.0, 30.0])
    values = judge(design, x).values
    assert values["path_compliance"] == pytest.approx(1e-3 * compliance(*x), rel=1e-6)
    best, found = refine(design, x, np.ones(1))
    assert (found.violations <= 0).all()
    # the bound of the width is met first, then the height is what the compliance asks for
    height = 5 * compliance(60, 5) / 0.5e-3
    mass = 7.85e-6 * 60 * height * 400
    assert best == pytest.approx([60, height], rel=1e-3) and found.objectives[0] == pytest.approx(
        mass, rel=1e-3
    )


def test_what_cannot_be_bettered_stays(tmp_path):
    design = problem(tmp_path)
    best, _ = refine(design, np.array([55.0, 30.0]), np.ones(1))
    again, found = refine(design, best, np.ones(1))
    assert found.objectives[0] == pytest.approx(judge(design, best).objectives[0], rel=1e-4)
    np.testing.assert_allclose(again, best, rtol=1e-2)


def test_first_order_by_hand_and_by_random_machines(tmp_path):
    """c goes with width^-3 height^-1: its relative deviation is that of the widths and heights."""
    design = problem(tmp_path)
    x = np.array([40.0, 20.0])
    r = robustness(design, x, draws=300)
    c = 1e-3 * compliance(*x)
    by_hand = c * np.hypot(3 * 0.1 / 40, 0.2 / 20)
    assert r.first_order["path_compliance"] == pytest.approx(by_hand, rel=1e-4)
    assert r.drawn["path_compliance"] == pytest.approx(by_hand, rel=0.15)
    mass = 7.85e-6 * 40 * 20 * 400
    assert r.first_order["mass"] == pytest.approx(mass * np.hypot(0.1 / 40, 0.2 / 20), rel=1e-4)
    assert len(r.places) == 2


def test_a_design_at_its_bound_holds_for_every_second_machine(tmp_path):
    design = problem(tmp_path)
    height = 5 * compliance(50, 5) / 0.5e-3
    assert 0.35 < robustness(design, np.array([50.0, height]), draws=200).meets < 0.65
    assert robustness(design, np.array([50.0, 1.2 * height]), draws=50).meets == 1.0


def test_maps_side_by_side():
    machine = sm.load_machine("orthoglide-revised")
    table = sm.measures(machine, only=["deflection", "mass", "transmission_max"], nodes=3, coarse=3)
    figure = comparison_figure({"one": table, "other": table})
    titles = [a.get_title() for a in figure.axes if a.get_title()]
    assert titles == ["one", "other"] * 2
    with pytest.raises(sm.StiffmapError, match="no maps"):
        comparison_figure({"one": sm.measures(machine, only=["mass"], nodes=3)})


def test_without_tolerances_there_is_nothing_to_say(tmp_path):
    assert robustness(problem(tmp_path, "30", "20"), np.array([40.0, 20.0])) is None


def test_three_legs_are_three_tolerances():
    design = load_design("redesign")
    low, high = design.bounds
    r = robustness(design, (low + high) / 2, draws=2)
    assert len(r.places) == 21 and r.first_order["deflection"] > 0 and r.first_order["velocity"] < 1e-9
