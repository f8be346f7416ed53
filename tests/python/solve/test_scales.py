"""Answers do not depend on how large a machine is or how hard it is to push: lengths and forces times 1e-6 to 1e6."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

import stiffmap as sm
from stiffmap.common import units
from stiffmap.model.files import description_from_text

HEAD = "name: m\nunits: {length: m, force: N, angle: rad}\n"
SLIDES = (
    HEAD
    + """home: {translation: [0, 0, 0]}
task: [x, y]
legs:
  carrier:
    elements:
      - {joint: sx, kind: prismatic, axis: x}
      - {joint: sy, kind: prismatic, axis: y}
"""
)
PLANAR = {  # springs of a point at the origin: anchor, stiffness, free length
    "three": [((1.0, 0.1), 2.0e6, 1.004987562112089), ((-0.5, 0.8), 1.0e6, 0.9433981132056603), ((-0.4, -0.9), 1.5e6, 0.9848857801796105)],
    "stretched": [((1.0, 0.1), 1.0e8, 0.9), ((-0.5, 0.8), 3.0e7, 0.94), ((-0.4, -0.9), 1.5e8, 0.95)],
    "two, soft and stiff": [((1.0, 0.0), 1.0e3, 1.0), ((0.1, 0.8), 1.0e8, 0.8062257748298549)],
    "pressed": [((1.0, 0.2), 1.0e6, 1.1), ((-1.0, 0.1), 1.0e6, 1.1), ((0.1, 0.8), 4.0e7, 0.81)],
}  # fmt: skip
ARM = (
    HEAD
    + """home: {translation: [0.6, 0.5, 0], rotation: [[0, -1, 0], [1, 0, 0], [0, 0, 1]]}
task: [x, y]
legs:
  arm:
    elements:
      - {joint: j1, kind: revolute, axis: z}
      - {offset: o1, translation: [0.6, 0, 0]}
      - {joint: j2, kind: revolute, axis: z, home: 1.5707963267948966}
      - {offset: o2, translation: [0.5, 0, 0]}
platform:
  - {point: p}
external_springs:
  a: {point: platform.p, anchor: [1.6, 0.5, 0], stiffness: 2.0e6, length: 1.0}
  b: {point: platform.p, anchor: [0.6, 1.7, 0], stiffness: 5.0e5, length: 1.2}
"""
)
METHODS = ("fast", "reference")


def planar(name: str) -> str:
    springs = "\n".join(
        f"  s{i}: {{point: platform.p, anchor: [{x}, {y}, 0], stiffness: {k}, length: {free}}}"
        for i, ((x, y), k, free) in enumerate(PLANAR[name])
    )
    return f"{SLIDES}platform:\n  - {{point: p}}\nexternal_springs:\n{springs}\n"


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("name", PLANAR)
def test_springs_outside_the_legs_hold_free_slides(name: str, method: str) -> None:
    """Balance sum k (l - l0) u = w with its closed-form stiffness; the carrier bears nothing."""
    machine = sm.Machine(description_from_text(planar(name)))
    anchors, k, free = (np.array(v) for v in zip(*PLANAR[name], strict=True))
    rng = np.random.default_rng(4)
    for push in rng.normal(size=(60, 2)) * 10 ** rng.uniform(0, 2, (60, 1)):

        def rest(u: np.ndarray, push: np.ndarray = push) -> np.ndarray:
            d = u - anchors
            length = np.linalg.norm(d, axis=1)
            return ((k * (length - free) / length)[:, None] * d).sum(axis=0) - push

        def slope(u: np.ndarray) -> np.ndarray:
            d = u - anchors
            length = np.linalg.norm(d, axis=1)
            along = np.einsum("ni,nj->nij", d, d) / length[:, None, None] ** 2
            tension = (k * (length - free) / length)[:, None, None]
            return (k[:, None, None] * along + tension * (np.eye(2) - along)).sum(axis=0)

        s = machine.solve(np.zeros(3), [*push, 0, 0, 0, 0], method=method)
        assert s.status == sm.Status.CONVERGED
        found = s.displacement[:2]
        assert (np.linalg.eigvalsh(slope(found)) > 0).all()
        assert (
            np.linalg.norm(np.linalg.solve(slope(found), rest(found))) < 1e-10 * np.linalg.norm(found) + 4e-16
        )
        want = np.linalg.inv(slope(found))
        size = np.sqrt(np.outer(np.diag(want), np.diag(want)))
        np.testing.assert_allclose(s.compliance[:2, :2] / size, want / size, rtol=0, atol=1e-8)
        round_off = 4e-16 * (k * np.linalg.norm(anchors, axis=1)).sum()  # of springs' lengths
        assert np.abs(s.leg_wrench).max() < 1e-9 * np.linalg.norm(push) + round_off


def load(source: str, length: int, force: int, monkeypatch: pytest.MonkeyPatch) -> sm.Machine:
    """A machine whose lengths are 10^length and forces 10^force times those of its file."""
    with monkeypatch.context() as m:
        for name, tens in (("LENGTHS", length), ("FORCES", force), ("MASSES", force)):
            table = {k: v * Fraction(10) ** tens for k, v in getattr(units, name).items()}
            m.setattr(units, name, table)
        units._scale.cache_clear()
        machine = sm.Machine(description_from_text(source)) if "\n" in source else sm.load_machine(source)
    units._scale.cache_clear()
    return machine


@pytest.mark.parametrize("source", [planar("three"), planar("pressed"), ARM, "orthoglide-revised", "hexapod", "ur10"],
                         ids=["three springs", "pressed springs", "arm on springs", "orthoglide", "hexapod", "ur10"])  # fmt: skip
@pytest.mark.parametrize(
    ("length", "force"), [(-6, 0), (6, 0), (0, -6), (0, 6), (-6, 6), (6, -6), (-6, -6), (6, 6)]
)
def test_scaled_machines_answer_alike(
    source: str, length: int, force: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    machine, scaled = load(source, 0, 0, monkeypatch), load(source, length, force, monkeypatch)
    a, b = 10.0**length, 10.0**force
    rng = np.random.default_rng(2)
    n = len(machine.actuators)
    position = machine.description.home.p + rng.uniform(-0.05, 0.05, (8, 3)) * [1, 1, n > 2]
    wrench = rng.normal(size=(8, 6)) * ([100, 100, 100, 5, 5, 5] if n > 2 else [100, 100, 0, 0, 0, 0])
    moved, pushed = np.repeat([a, 1], 3), np.repeat([b, a * b], 3)
    for method in METHODS:
        here = machine.solve(position, wrench, method=method)
        there = scaled.solve(position * a, wrench * pushed, method=method)
        assert (here.status == 0).all()
        assert (there.status == 0).all()
        size = np.linalg.norm(here.displacement, axis=1, keepdims=True)
        assert np.abs(there.displacement / moved - here.displacement).max() < 1e-9 * size.max()
        c = there.compliance / moved[:, None] * pushed
        scale = np.sqrt(np.abs(np.diagonal(here.compliance, axis1=1, axis2=2)))
        gap = np.abs(c - here.compliance) / (scale[:, :, None] * scale[:, None, :] + 1e-300)
        assert gap[here.compliance != 0].max() < 1e-9
