"""Receptance at the tool against statics, closed forms, direct solutions and a published arm."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import stiffmap as sm
from stiffmap.model.description import Joint, Spring
from stiffmap.model.description.tree import edit_sequences
from stiffmap.workspace.vibration import tip_modes
from stiffmap.workspace.vibration.response import direct, receptance

ARM = Path(__file__).parents[4] / "examples/taps/kr210.yaml"
MASSIVE = [n for n in sm.machine_names() if n != "tripteron"]

OSCILLATOR = """
name: oscillator
units: {length: m, force: N, angle: rad, mass: kg}
home: {translation: [0, 0, 0]}
workspace: {x: [-1, 1], y: [-0.1, 0.1], z: [-0.1, 0.1]}
task: [x]
legs:
  one:
    elements:
      - {actuator: slide, kind: prismatic, axis: x, compliance: 2.5e-5, DAMPED}
      - {body: near, mass: 3}
      - {spring: second, compliance: [1e-5, 0, 0, 0, 0, 0], LOSSY}
      - {body: far, mass: 2}
"""
F = np.array([0.0, 7.0, 19.0, 40.0, 95.0])


def oscillator(tmp_path, damped="", lossy="", modal=""):
    text = OSCILLATOR.replace(", DAMPED", f", {damped}" if damped else "")
    path = tmp_path / "machine.yaml"
    path.write_text(text.replace(", LOSSY", f", {lossy}" if lossy else "") + modal, encoding="utf-8")
    return sm.load_machine(path)


def two_masses(f, c=0.0, eta=0.0):
    """At the far mass, by hand."""
    w = 2 * np.pi * f
    k1, k2 = 4e4, 1e5 * (1 + 1j * eta * np.sign(w))
    near, far = k1 + k2 + 1j * w * c - 3 * w**2, k2 - 2 * w**2
    return near / (near * far - k2**2)


def middle(machine):
    low, high = machine.workspace
    return (low + high) / 2 + np.where(high - low > 0.01, np.array([0.01, -0.02, 0.015]), 0.0)


@pytest.mark.parametrize("name", MASSIVE)
def test_at_rest_it_is_the_loaded_compliance(name):
    machine = sm.load_machine(name)
    p, w = middle(machine), [30.0, -20.0, 50.0, 0.0, 0.0, 0.0]
    found = sm.frequency_response(machine, p, [0.0, 5.0], w)
    c = machine.solve(p, w).compliance
    assert np.abs(found.values[0] - c).max() <= 1e-12 * np.abs(c).max()
    assert found.dims == ("frequency", "response", "force") and "assumed" in found.attrs["damping"]
    # without the statics of the kernels: modes and condensed flexibility alone
    modes = tip_modes(machine, p, w)
    own = machine.compiled  # the part of all that is massless is what statics leave
    assert own.length > 0
    sum_of_modes = modes.tip[0] @ modes.tip[0].T
    assert np.linalg.eigvalsh(c - sum_of_modes).min() > -1e-9 * np.abs(c).max()


@pytest.mark.parametrize("effect", ["preload", "external_spring", ""])
def test_modes_stand_on_the_equilibrium_of_what_acts_without_a_wrench(effect):
    machine = sm.load_machine("orthoglide-revised")
    if effect == "preload":
        machine = machine.with_effect("preload", element="foot", legs=["x"], rest_x=5e-3)
    if effect == "external_spring":
        machine = machine.with_effect(
            "external_spring", element="tcp", anchor_x=0.0, anchor_y=0.0, anchor_z=1.0, stiffness=2e3
        )
    p = middle(machine)
    barely = tip_modes(
        machine, p, [1e-9, 0, 0, 0, 0, 0]
    )  # too little to move anything, but found as an equilibrium
    assert tip_modes(machine, p).square == pytest.approx(barely.square, rel=1e-9)


def test_published_arm_of_six_joints():
    machine = sm.load_machine(ARM)
    p = machine.description.home.p
    np.testing.assert_allclose(p, [1.9814, -0.2778, 1.2253], atol=6e-5)
    modes = tip_modes(machine, p)
    expected = [10.07, 11.31, 21.33, 71.92, 110.70, 293.76]
    np.testing.assert_allclose(modes.frequency[0], expected, atol=0.012)
    c = sm.frequency_response(machine, p, [0.0]).values[0, :3, :3].real * 1e6
    np.testing.assert_allclose([c[0, 0], c[1, 1], c[2, 2], c[0, 1]], [0.241, 1.809, 1.651, 0.213], atol=6e-4)
    np.testing.assert_allclose(np.sort(1 / np.linalg.eigvalsh(c)), [0.544, 0.606, 4.719], atol=1.2e-3)


@pytest.mark.parametrize(("c", "eta"), [(0.0, 0.0), (150.0, 0.0), (0.0, 0.08), (150.0, 0.08), (4000.0, 0.0)])
def test_two_masses_with_a_damper_and_a_lossy_spring(tmp_path, c, eta):
    machine = oscillator(tmp_path, f"damping: {c}" if c else "", f"loss_factor: {eta}" if eta else "")
    found = sm.frequency_response(machine, [0.0, 0.0, 0.0], F, damping=None if c or eta else 0.0)
    np.testing.assert_allclose(found.values[:, 0, 0], two_masses(F, c, eta), rtol=1e-11)
    if c or eta:
        assert "declared" in found.attrs["damping"] and "complex modes" in found.attrs["modal"]


def test_modal_ratios_of_a_file_and_of_a_call(tmp_path):
    declared = oscillator(tmp_path, modal="modal_damping: [0.05, 0.01]\n")
    modes = tip_modes(declared, [0.0, 0.0, 0.0])
    np.testing.assert_allclose(modes.ratio[0], [0.05, 0.01], rtol=1e-12)
    assert modes.proportional
    given = tip_modes(declared, [0.0, 0.0, 0.0], damping=0.03)
    np.testing.assert_allclose(given.ratio[0], [0.03, 0.03], rtol=1e-12)
    saved = sm.load_machine(oscillator_saved(declared, tmp_path))
    assert saved.description.modal_damping == (0.05, 0.01)
    # one mode at its peak: 1 / (2 ratio) of its static share
    f = modes.frequency[0, :1]
    peak = sm.frequency_response(declared, [0.0, 0.0, 0.0], f).values[0, 0, 0].imag
    assert -peak == pytest.approx(modes.tip[0, 0, 0] ** 2 / 0.1, rel=0.01)


def oscillator_saved(machine, tmp_path):
    path = tmp_path / "saved.yaml"
    machine.save(path)
    return path


def test_dampers_and_losses_are_saved(tmp_path):
    machine = oscillator(tmp_path, "damping: 150", "loss_factor: 0.08")
    again = sm.load_machine(oscillator_saved(machine, tmp_path))
    elements = again.description.legs[0].elements
    assert next(e for e in elements if isinstance(e, Joint)).damping == 150
    assert next(e for e in elements if isinstance(e, Spring)).loss_factor == 0.08


def damped(machine):
    """Every joint with a damper and every spring with a loss factor of its own: nothing proportional."""

    def change(elements):
        out = []
        for i, e in enumerate(elements):
            if isinstance(e, Joint):
                e = replace(e, damping=3.0 + i)
            elif isinstance(e, Spring):
                e = replace(e, loss_factor=0.02 + 0.01 * (i % 5))
            out.append(e)
        return tuple(out)

    d = machine.description
    legs = tuple(replace(leg, elements=edit_sequences(leg.elements, change)) for leg in d.legs)
    return sm.Machine(replace(d, legs=legs))


@pytest.mark.parametrize("name", ["orthoglide-revised", "five-bar", "ur10"])
def test_poles_against_one_system_for_each_frequency(name):
    machine = damped(sm.load_machine(name))
    modes = tip_modes(machine, middle(machine))
    assert not modes.proportional
    f = np.array([0.0, 3.0, 11.0, 30.0, 120.0, 700.0])
    expected = direct(modes, 0, 2j * np.pi * f)
    found = receptance(modes, f)[0]
    np.testing.assert_allclose(found, expected, atol=1e-9 * np.abs(expected).max())


def test_modes_that_are_left_out_count_by_their_flexibility():
    machine = sm.load_machine("orthoglide-revised")
    p, f = middle(machine), np.array([0.0, 5.0, 20.0])
    full, few = (sm.frequency_response(machine, p, f, modes=k).values for k in (None, 6))
    scale = np.abs(full).max()
    assert np.abs(few[0] - full[0]).max() < 1e-13 * scale
    third = tip_modes(machine, p).frequency[0, 6]
    assert np.abs(few[2] - full[2]).max() < 2 * (20 / third) ** 2 * scale


def test_poses_as_an_array_and_one_that_fails():
    machine = sm.load_machine("orthoglide-revised")
    p = np.array([[middle(machine), [9.0, 9.0, 9.0]], [[0.0, 0.0, 0.0], middle(machine)]])
    found = sm.frequency_response(machine, p, [10.0, 20.0])
    assert found.shape == (2, 2, 2, 6, 6) and np.iscomplexobj(found.values)
    assert found.status.values[0, 1] == sm.Status.UNREACHABLE and np.isnan(found.values[0, 1]).all()
    np.testing.assert_allclose(found.values[0, 0], found.values[1, 1], rtol=1e-12)
    one = sm.frequency_response(machine, p[0, 0], [10.0, 20.0], kind="accelerance")
    w2 = (2 * np.pi * one.frequency.values) ** 2
    np.testing.assert_allclose(one.values, -w2[:, None, None] * found.values[0, 0], rtol=1e-10)


def test_an_unsymmetric_stiffness_is_refused_or_symmetrised():
    machine = sm.load_machine("orthoglide-revised")
    w = [0.0, 0.0, 0.0, 0.0, 40.0, 0.0]
    with pytest.raises(sm.StiffmapError, match="symmetrise=True"):
        sm.frequency_response(machine, middle(machine), [0.0, 10.0], w)
    found = sm.frequency_response(machine, middle(machine), [0.0, 10.0], w, symmetrise=True)
    assert found.attrs["unsymmetric"] > 1e-9 and "symmetric part" in found.attrs["symmetrised"]
    np.testing.assert_allclose(found.values, found.values.transpose(0, 2, 1), atol=1e-12)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"frequencies": [10.0, 5.0]}, "rising frequencies .* entry 2 is 5 after 10"),
        ({"frequencies": [-1.0, 5.0]}, "from 0 on"),
        ({"damping": 2.0}, "0.02 is 2 %"),
        ({"kind": "compliance"}, "receptance, mobility, accelerance"),
        ({"point": "nose"}, "no point 'nose'"),
        ({"modes": 0}, "modes"),
    ],
)
def test_bad_input_is_one_message(change, message):
    given = {"position": [0.0, 0.0, 0.0], "frequencies": [5.0], **change}
    with pytest.raises(sm.StiffmapError, match=message):
        sm.frequency_response("orthoglide-revised", **given)


def test_a_machine_without_mass_is_said():
    with pytest.raises(sm.StiffmapError, match="needs masses"):
        sm.frequency_response("tripteron", [0.0, 0.0, 0.5], [5.0])


@pytest.mark.parametrize(
    ("text", "message"),
    [("modal_damping: 2\n", "0.02 is 2 %"), ("modal_damping: []\n", "at least one"), ("modal_damping: soft\n", "modal_damping")],
)  # fmt: skip
def test_bad_damping_in_a_file(tmp_path, text, message):
    with pytest.raises(sm.StiffmapError, match=message):
        oscillator(tmp_path, modal=text)
    with pytest.raises(sm.StiffmapError, match="damping"):
        oscillator(tmp_path, damped="damping: -1")
