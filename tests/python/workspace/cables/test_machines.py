"""The example machines in cables over their boxes, against energy minimisation."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from tests.python.workspace.cables.energy import hung

from stiffmap import Flag, Status, load_machine

EXAMPLES = Path(__file__).parents[4] / "examples/cables"


@pytest.mark.parametrize("name", ["cogiro", "ipanema-1"])
def test_box(name: str) -> None:
    """Converged under its own weight by both paths; IPAnema's lower cables go slack in some corners, CoGiRo's nowhere."""
    machine = load_machine(EXAMPLES / f"{name}.yaml")
    assert machine.compiled.not_fast == ""
    low, high = machine.workspace
    axes = [np.linspace(a, b, 4) for a, b in zip(low, high, strict=True)]
    p = np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, 3)
    fast, reference = (machine.solve(p, method=m) for m in ("fast", "reference"))
    for s in (fast, reference):
        assert s.count() == {"CONVERGED": 64}
        allowed = Flag.DRIVE_FORCE | Flag.SLACK if name == "ipanema-1" else Flag(0)
        assert not (s.flags & ~np.uint32(allowed)).any()
    np.testing.assert_allclose(fast.displacement, reference.displacement, rtol=1e-9, atol=1e-12)
    for i in (0, 21, 63):
        q, _ = hung(machine.description, p[i], np.eye(3)).minimum(p[i], np.eye(3), np.zeros(3))
        np.testing.assert_allclose(fast.displacement[i, :3], q - p[i], atol=5e-8)


def test_belt_router() -> None:
    """Two freedoms: what the sheet holds does not move, and belts below go slack where the sled hangs low."""
    machine = load_machine(EXAMPLES / "belt-router.yaml")
    p = np.array([(x, y, 0.0) for x in (-1.2, 0.0, 1.2) for y in (-0.6, 0.0, 0.6)])
    s = machine.solve(p, [0, 20, 0, 0, 0, 0])
    assert (s.status == Status.CONVERGED).all()
    assert (s.flags & Flag.RIGID_DIRECTION).astype(bool).all()
    assert np.abs(s.displacement[:, 2:]).max() == 0.0
    for i in range(9):
        here = hung(machine.description, p[i], np.eye(3))
        t, u, _ = here.tension(p[i] + s.displacement[i, :3], np.eye(3))
        force = -(t[:, None] * u).sum(0) + here.mass * here.gravity + [0, 20, 0]
        assert np.abs(force[:2]).max() < 1e-6
        np.testing.assert_allclose(s.tension[i], t, atol=1e-6)
