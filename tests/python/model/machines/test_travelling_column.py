"""The travelling-column machine against cantilevers and guides in sequence, and springs that vary with a stroke."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import stiffmap as sm
from stiffmap.common.errors import FileError
from stiffmap.model.description import Spring, TableStroke
from stiffmap.model.description.tree import find

IRON, IRON_G = 1.2e11, 1.2e11 / 2.52
WIDE, DEEP, WALL = 0.48, 0.56, 0.028  # column: along x and y
RAM, RAM_WALL = 0.24, 0.022
ORDER = {"rtol": 0, "atol": 1e-10}


def tube(b: float, h: float, t: float) -> tuple[float, float, float, float]:
    """Area, second moments about the axes of `b` and of `h`, Bredt's torsion constant of a rectangular tube."""

    def second(width: float, height: float) -> float:
        return width * height**3 / 12 - (width - 2 * t) * (height - 2 * t) ** 3 / 12

    enclosed, around = (b - t) * (h - t), 2 * (b + h - 2 * t)
    return b * h - (b - 2 * t) * (h - 2 * t), second(b, h), second(h, b), 4 * enclosed**2 * t / around


def cantilever(
    length: float, along: np.ndarray, across: np.ndarray, b: float, h: float, t: float
) -> np.ndarray:
    """Compliance of the free end in base axes; `b` is measured along `across`."""
    area, about_b, about_h, torsion = tube(b, h, t)
    third = np.cross(along, across)
    c = np.zeros((6, 6))
    c[:3, :3] = length / (IRON * area) * np.outer(along, along)
    c[3:, 3:] = length / (IRON_G * torsion) * np.outer(along, along)
    for side, turns, second in ((across, third, about_h), (third, -across, about_b)):
        ei = IRON * second
        c[:3, :3] += length**3 / (3 * ei) * np.outer(side, side)
        c[3:, 3:] += length / ei * np.outer(turns, turns)
        c[:3, 3:] += length**2 / (2 * ei) * np.outer(side, turns)
    c[3:, :3] = c[:3, 3:].T
    return c


def closed_form(p: np.ndarray) -> np.ndarray:
    """Compliance of the TCP at p, m: every part's compliance carried there by its lever."""
    x, y, z = np.eye(3)
    nose = p - [0, 0.12, 0]
    ram_end = nose - [0, 0.1, 0]
    head = np.array([p[0], 0.0, p[2]])
    saddle = np.array([p[0], 0.0, 0.2])
    drives = np.zeros((6, 6))
    drives[:3, :3] = np.diag([4e-9, 4e-9, 3e-9])
    parts = [
        (p, drives),
        (saddle, np.diag([1e-10, 6e-10, 4e-10, 1.2e-9, 0.6e-9, 0.8e-9])),
        (head, cantilever(head[2] - 0.2, z, x, WIDE, DEEP, WALL)),
        (head, np.diag([7e-10, 5e-10, 1e-10, 1.0e-9, 1.6e-9, 1.4e-9])),
        (ram_end, cantilever(ram_end[1] - 0.4 + 0.12, y, x, RAM, RAM, RAM_WALL)),
        (nose, np.diag([1.6e-9, 0.9e-9, 1.6e-9, 2.4e-8, 1e-7, 2.4e-8])),
    ]
    total = np.zeros((6, 6))
    for at, compliance in parts:
        arm = p - at
        carry = np.eye(6)
        carry[:3, 3:] = -np.array([[0, -arm[2], arm[1]], [arm[2], 0, -arm[0]], [-arm[1], arm[0], 0]])
        total += carry @ compliance @ carry.T
    return total


@pytest.mark.parametrize("method", ["fast", "reference"])
def test_compliance_is_the_closed_form_all_over_the_box(method: str) -> None:
    machine = sm.load_machine("travelling-column")
    low, high = machine.workspace
    p = np.random.default_rng(12).uniform(low, high, (12, 3))
    got = machine.solve(p, method=method)
    assert got.ok.all()
    wanted = np.array([closed_form(q) for q in p])
    scale = np.sqrt(np.einsum("nii,njj->nij", wanted, wanted))
    np.testing.assert_allclose(got.compliance / scale, wanted / scale, **ORDER)


def test_the_map_shows_the_stroke() -> None:
    """Out of the head and up the column the machine is softer; a constant ram would hide half of it."""
    machine = sm.load_machine("travelling-column")
    far, near = machine.solve([[0, 1.3, 1.5], [0, 0.64, 0.7]], [0, 0, 1000, 0, 0, 0]).displacement[:, 2]
    assert far > 4 * near > 0


PUSHER = """
name: pusher
units: {{length: mm, force: N, angle: deg}}
home: {{translation: [500, 0, 0]}}
task: [x]
legs:
  arm:
    elements:
      - {{actuator: drive, kind: prismatic, axis: x, home: 100, compliance: 1.4e-4, range: [0, 300]}}
      - {{offset: length, translation: [400, 0, 0]}}
      - {spring}
"""
BEAM = "beam: {length: 200, round: {diameter: 40}, material: {E: 2.1e5, nu: 0.3}}"
DIAGONALS = {0: [1, 2, 2, 4, 4, 4], 200: [2, 8, 8, 5, 5, 5], 300: [3, 20, 20, 6, 6, 6]}


def rows() -> str:
    """A table with couplings, k26 = -k35 = half of the most that they may be."""
    out = []
    for at, d in DIAGONALS.items():
        k = [v * (1e-6 if i < 3 else 1e-10) for i, v in enumerate(d)]
        entries = [*(f"k{i + 1}{i + 1}: {v}" for i, v in enumerate(k)), f"k26: {0.5 * np.sqrt(k[1] * k[5])}"]
        out.append(f"{{at: {at}, compliance: {{{', '.join(entries)}}}}}")
    return f"[{', '.join(out)}]"


def pusher(tmp_path: Path, spring: str) -> sm.Machine:
    path = tmp_path / "pusher.yaml"
    path.write_text(PUSHER.format(spring=f"{{spring: bar, {spring}}}"), encoding="utf-8")
    return sm.load_machine(path)


def bar(machine: sm.Machine) -> Spring:
    (out,) = find(machine.description, "arm.bar")
    assert isinstance(out, Spring)
    return out


def at(machine: sm.Machine, mm: float, method: str = "fast") -> sm.Solution:
    return machine.solve([0.4 + mm / 1000, 0, 0], [10, 20, 30, 1, 2, 3], method=method)


@pytest.mark.parametrize("method", ["fast", "reference"])
def test_a_table_is_its_rows_and_linear_in_between(tmp_path: Path, method: str) -> None:
    machine = pusher(tmp_path, f"stroke: {{joint: drive, table: {rows()}}}")
    for mm, d in [*DIAGONALS.items(), (120, [1.6, 5.6, 5.6, 4.6, 4.6, 4.6])]:
        got = at(machine, mm, method)
        unloaded = machine.solve([0.4 + mm / 1000, 0, 0], method=method).compliance
        wanted = np.array(d) * np.where(np.arange(6) < 3, 1e-9, 1e-7)
        np.testing.assert_allclose(np.diag(unloaded)[1:], wanted[1:], rtol=1e-9)
        assert got.ok


def test_both_paths_agree(tmp_path: Path) -> None:
    for spring in (
        f"stroke: {{joint: drive, table: {rows()}}}",
        f"{BEAM}, stroke: {{joint: drive, at: 100, rate: 0.5}}",
    ):
        machine = pusher(tmp_path, spring)
        assert not machine.fast
        p = np.linspace(0.41, 0.69, 9)[:, None] * [1, 0, 0]
        wrench = 200 * np.random.default_rng(3).normal(size=(9, 6)) * [1, 1, 1, 0.1, 0.1, 0.1]
        fast, slow = (machine.solve(p, wrench, method=m) for m in ("fast", "reference"))
        assert fast.reference_share == 0
        np.testing.assert_allclose(fast.displacement, slow.displacement, rtol=1e-10, atol=1e-14)
        size = np.sqrt(np.einsum("nii,njj->nij", slow.compliance, slow.compliance))
        np.testing.assert_allclose(fast.compliance / size, slow.compliance / size, **ORDER)


def test_no_compliance_is_declared_there(tmp_path: Path) -> None:
    """Beyond the stroke: NaN and UNREACHABLE, never the end of the table."""
    machine = pusher(tmp_path, f"stroke: {{joint: drive, table: {rows()}}}")
    s = machine.solve([[0.35, 0, 0], [0.5, 0, 0], [0.71, 0, 0]], [1, 0, 0, 0, 0, 0])
    assert list(s.status) == [sm.Status.UNREACHABLE, sm.Status.CONVERGED, sm.Status.UNREACHABLE]
    assert np.isnan(s.displacement[[0, 2]]).all()


@pytest.mark.parametrize(
    "spring",
    [f"stroke: {{joint: drive, table: {rows()}}}", f"{BEAM}, stroke: {{joint: drive, at: 100, rate: 0.5}}"],
)
def test_effects_and_files_keep_the_stroke(tmp_path: Path, spring: str) -> None:
    machine = pusher(tmp_path, spring)
    softer = machine.with_effect("compliance", element="bar.k22", legs=["arm"], scale=1.5)
    for mm in (0, 150, 300):
        before, after = (np.diag(m.solve([0.4 + mm / 1000, 0, 0]).compliance) for m in (machine, softer))
        np.testing.assert_allclose(after / before, [1, 1.5, 1, 1, 1, 1], rtol=1e-9)
    for kept in (machine, softer):
        kept.save(tmp_path / "again.yaml")
        assert sm.load_machine(tmp_path / "again.yaml").description == kept.description


def test_derivatives_see_the_stroke(tmp_path: Path) -> None:
    """Slope by an effect's parameter, against differences of the reference path."""
    machine = pusher(tmp_path, f"{BEAM}, stroke: {{joint: drive, at: 100}}")
    effects = {"element": "bar", "legs": ["arm"]}
    p, w = [0.65, 0, 0], [100, 200, -50, 1, 2, 3]

    def reference(scale: float) -> np.ndarray:
        changed = machine.with_effect("compliance", **effects, scale=scale)
        return np.asarray(changed.solve(p, w, method="reference").displacement)

    difference = (reference(1.001) - reference(0.999)) / 0.002
    wanted = [("compliance", {**effects, "scale": 1.0})]
    (slope,) = machine.solve(p, w, derivatives=wanted).derivatives.values()
    np.testing.assert_allclose(slope, difference, rtol=1e-5, atol=1e-12)


@pytest.mark.parametrize(
    ("spring", "words"),
    [
        (f"{BEAM}, stroke: {{joint: driver}}", "no joint of one axis 'driver' (did you mean 'drive'?)"),
        (f"{BEAM}, stroke: {{joint: drive, at: 250}}", "with 'drive' at 0 mm the beam would be -50 mm long"),
        ("stroke: {joint: drive, table: " + rows().replace("at: 300", "at: 250") + "}",
         "the table goes from 0 mm to 250 mm, 'drive' to 300 mm"),
        (f"{BEAM}, stroke: {{joint: drive, table: {rows()}}}", "does not go with beam"),
        ("stroke: {joint: drive, table: " + rows().replace("at: 200", "at: 400") + "}", "must rise"),
        ("compliance: [1e-6, 1e-6, 1e-6, 0, 0, 0], stroke: {joint: drive}", "needs length and along"),
        ("stiffness: [1, 1, 1, 1, 1, 1], stroke: {joint: drive, length: 3, along: x}", "does not go with stiffness"),
    ],
)  # fmt: skip
def test_errors_name_the_key(tmp_path: Path, spring: str, words: str) -> None:
    with pytest.raises(FileError) as problem:
        pusher(tmp_path, spring)
    assert words in str(problem.value)
    assert "elements[2]" in str(problem.value)


def test_a_template_keeps_its_stroke_in_each_leg(tmp_path: Path) -> None:
    """The joint is found in the spring's own leg, and a full name in another one."""
    text = PUSHER.format(spring=f"{{spring: bar, {BEAM}, stroke: {{joint: arm.drive}}}}")
    (tmp_path / "m.yaml").write_text(text, encoding="utf-8")
    assert sm.load_machine(tmp_path / "m.yaml").solve([0.5, 0, 0]).ok
    machine = pusher(tmp_path, f"stroke: {{joint: drive, table: {rows()}}}")
    stroke = bar(machine).stroke
    assert isinstance(stroke, TableStroke)
    assert stroke.at == (0.0, 0.2, 0.3)
