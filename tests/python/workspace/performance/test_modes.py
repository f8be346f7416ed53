"""Natural frequencies of chains and beams with a closed form, and links in more and more pieces."""

from __future__ import annotations

import numpy as np
import pytest

import stiffmap as sm
from stiffmap.workspace.performance import in_pieces
from stiffmap.workspace.performance.motion.inertia import total_mass

CHAIN = """
name: chain
units: {length: m, force: N, angle: rad, mass: kg}
home: {translation: [0, 0, 0]}
workspace: {x: [-1, 1], y: [-0.1, 0.1], z: [-0.1, 0.1]}
task: [x]
legs:
  one:
    elements:
      - {actuator: slide, kind: prismatic, axis: x, rigid: true}
      - {spring: first, compliance: [2.5e-5, 0, 0, 0, 0, 0]}
      - {body: near, mass: 3}
      - {offset: apart, translation: [0.3, 0, 0]}
      - {spring: second, compliance: [2.5e-5, 0, 0, 0, 0, 0]}
      - {body: far, mass: 3}
      - {offset: tool, translation: [-0.3, 0, 0]}
"""

BEAM = """
name: beam
units: {length: m, force: N, angle: rad, mass: kg}
home: {translation: [0.8, 0, 0]}
workspace: {x: [0, 1], y: [-0.1, 0.1], z: [-0.1, 0.1]}
task: [x]
materials: {steel: {E: 2.1e11, nu: 0.3}}
legs:
  one:
    elements:
      - {actuator: slide, kind: prismatic, axis: x, rigid: true}
      - {offset: length, translation: [0.8, 0, 0]}
      - {body: beam, mass: MASS, com: [-0.4, 0, 0], inertia: [0.002, TURN, TURN]}
      - {spring: beam, beam: {length: 0.8, along: x, rectangle: {width: 0.03, height: 0.05}, material: steel}}
      - {body: tool, mass: TOOL}
"""
EI, MASS = 2.1e11 * 0.05 * 0.03**3 / 12, 7850 * 0.03 * 0.05 * 0.8


def machine(tmp_path, text):
    path = tmp_path / "machine.yaml"
    path.write_text(text, encoding="utf-8")
    return sm.load_machine(path)


def beam(tmp_path, mass, tool):
    text = BEAM.replace("MASS", repr(mass)).replace("TURN", repr(mass * 0.8**2 / 12))
    return machine(tmp_path, text.replace("TOOL", repr(tool)))


def test_two_masses_on_two_springs(tmp_path):
    found = sm.natural_frequencies(machine(tmp_path, CHAIN), [0.0, 0.0, 0.0])
    square = 4e4 / 3 * (3 + np.array([-1, 1]) * np.sqrt(5)) / 2
    np.testing.assert_allclose(found.frequency[:2], np.sqrt(square) / (2 * np.pi), rtol=1e-12)
    assert np.isnan(found.frequency[2:]).all()
    # the modes of unit modal mass: the far mass moves the golden ratio as far, or that against the near one
    names = sm.load_machine(tmp_path / "machine.yaml").compiled.names.coordinates
    first, second = (found.shape[0][names.index(n)] for n in ("one.first.tx", "one.second.tx"))
    assert abs((first + second) / first) == pytest.approx((1 + np.sqrt(5)) / 2, rel=1e-9)
    assert 3 * (first**2 + (first + second) ** 2) == pytest.approx(1.0, rel=1e-9)


def test_a_mass_at_the_end_of_a_cantilever(tmp_path):
    found = sm.natural_frequencies(beam(tmp_path, 1e-9, 4.0), [0.8, 0.0, 0.0], modes=1)
    assert float(found.frequency[0]) == pytest.approx(
        np.sqrt(3 * EI / (4.0 * 0.8**3)) / (2 * np.pi), rel=1e-8
    )


def test_a_cantilever_in_pieces_tends_to_the_continuous_one(tmp_path):
    """Euler-Bernoulli: beta L = 1.8751, 4.6941 of cos(b) cosh(b) = -1; the difference falls with the square."""
    whole = beam(tmp_path, MASS, 1e-9)
    scale = np.sqrt(EI / (MASS * 0.8**3)) / (2 * np.pi)
    found = [
        sm.natural_frequencies(in_pieces(whole, n), [0.8, 0.0, 0.0], modes=8).frequency for n in (8, 16, 32)
    ]
    for root in (1.875104068711961, 4.694091132974175):
        off = [np.abs(f / (root**2 * scale) - 1).min() for f in found]
        assert off[2] < 2.5e-3
        assert off[0] / off[1] == pytest.approx(4, rel=0.2) and off[1] / off[2] == pytest.approx(4, rel=0.1)


@pytest.mark.parametrize("name", ["five-bar", "linear-delta"])
def test_links_of_shipped_machines_in_pieces(name):
    whole = sm.load_machine(name)
    p = whole.workspace.mean(axis=0)
    first = []
    for n in (1, 2, 4, 8):
        m = in_pieces(whole, n)
        assert total_mass(m) == pytest.approx(total_mass(whole), rel=1e-12)
        np.testing.assert_allclose(
            m.solve(p).compliance, whole.solve(p).compliance, rtol=1e-7, atol=1e-9 * 1e-5
        )
        first.append(float(sm.natural_frequencies(m, p, modes=1).frequency[0]))
    assert first[0] == pytest.approx(float(sm.natural_frequencies(whole, p, modes=1).frequency[0]), rel=1e-9)
    steps = np.abs(np.diff(first))
    assert steps[1] / steps[2] == pytest.approx(4, rel=0.3)


def test_what_cannot_be_divided_is_said():
    with pytest.raises(sm.StiffmapError, match="no uniform bar"):
        in_pieces(sm.load_machine("orthoglide-revised"), 2)  # its bars are springs of a table
    with pytest.raises(sm.StiffmapError, match="pieces"):
        in_pieces(sm.load_machine("linear-delta"), 0)


def test_shapes_are_drawn_at_their_phase():
    from stiffmap.ui.plot.modes import mode_figure, swung

    m = sm.load_machine("five-bar")
    p = m.workspace.mean(axis=0)
    w = sm.natural_frequencies(m, p)
    assert len(mode_figure(m, p, modes=2).axes) == 2
    at, there = (m.compiled.frames(x)[0] for x in (w.coordinates, swung(m, w, 0, np.pi / 2, 0.01)))
    assert np.linalg.norm(there - at, axis=1).max() == pytest.approx(0.01, rel=0.05)
    np.testing.assert_allclose(swung(m, w, 0, 0.0, 0.01), w.coordinates)
