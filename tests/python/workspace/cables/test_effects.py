"""Effects of cables against closed forms and the energy of the real machine."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.python.workspace.cables.energy import hung
from tests.python.workspace.cables.made import hanging

from stiffmap import Machine
from stiffmap.model.description import Body, Cable

EA, T = 2.0e5, 300.0
PLACE = np.array([0.2, -0.1, 1.1])


def frame(lead: float = 0.0) -> Machine:
    corners = [(sx * 2.0, sy * 1.5, z) for z in (0.0, 2.0) for sx in (-1, 1) for sy in (-1, 1)]
    at = [
        (-0.1 * np.sign(a[1]) if a[2] else 0.15 * np.sign(a[0]), 0.12 * np.sign(a[1]), a[2] / 10)
        for a in corners
    ]
    six = ("x", "y", "z", "rx", "ry", "rz")
    return hanging(
        corners,
        at=[tuple(map(float, p)) for p in at],
        freedoms=six,
        home=(0.0, 0.0, 1.0),
        elasticity=EA,
        pretension=T,
        lead=lead,
        mass=10.0,
        gravity=(0.0, 0.0, -9.81),
    )


def built(machine: Machine, name: str, **real: object) -> np.ndarray:
    """Displacement of the machine that a change of its parts makes real, commanded as declared."""
    commanded = hung(machine.description, PLACE, np.eye(3))
    parts = [
        replace(e, **real) if isinstance(e, Cable) and e.name == name else e
        for e in machine.description.platform
    ]
    real_machine = hung(replace(machine.description, platform=tuple(parts)), PLACE, np.eye(3))
    real_machine.free = commanded.free
    return real_machine.minimum(PLACE, np.eye(3), np.zeros(3))[0] - PLACE


@pytest.mark.parametrize("method", ["fast", "reference"])
def test_anchor_and_stretch(method: str) -> None:
    """Lengths are those of the declared machine, forces those of the real one."""
    m = frame()
    off = m.with_effect("cable_anchor", element="c2", dx=0.004, dz=-0.003)
    x, y, z = next(e for e in m.description.platform if e.name == "c2").anchor
    expected = built(m, "c2", anchor=(x + 0.004, y, z - 0.003))
    np.testing.assert_allclose(off.solve(PLACE, method=method).displacement[:3], expected, atol=1e-8)
    soft = m.with_effect("cable_stretch", element="c3", scale=2.0)
    expected = built(m, "c3", elasticity=EA / 2)
    np.testing.assert_allclose(soft.solve(PLACE, method=method).displacement[:3], expected, atol=1e-8)


def test_mass() -> None:
    """Half a cable at its fixing point is a body there."""
    m = frame()
    heavy = m.with_effect("cable_mass", element="c5", density=0.2)
    c = next(e for e in m.description.platform if e.name == "c5")
    length = np.linalg.norm(np.array([0, 0, 1.0]) + c.at - np.array(c.anchor))
    body = Body("w", 0.1 * length, c.at)
    own = Machine(replace(m.description, platform=(*m.description.platform, body)))
    np.testing.assert_allclose(heavy.solve(PLACE).displacement, own.solve(PLACE).displacement, atol=1e-13)


@pytest.mark.parametrize("method", ["fast", "reference"])
def test_guide_friction(method: str) -> None:
    """A pair under load: the lead of one side stretches less, so that this side is stiffer."""
    m = hanging([(-1.2, 0, 0), (0.8, 0, 0)], elasticity=EA, pretension=T, lead=0.5)
    rough = m.with_effect("guide_friction", element="c1", share=0.2)
    free = (np.array([1.2, 0.8]) - T * 0.5 / EA) / (1 + T / EA)
    k = EA / (free + np.array([0.4, 0.5]))
    stretch = np.array([1.2, 0.8]) - free
    u = -(k[0] * stretch[0] - k[1] * stretch[1]) / k.sum()
    np.testing.assert_allclose(rough.solve((0, 0, 0), method=method).displacement[0], u, rtol=1e-10)
    assert m.solve((0, 0, 0), method=method).displacement[0] == pytest.approx(0, abs=1e-15)
