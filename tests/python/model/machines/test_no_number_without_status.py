"""No NaN with CONVERGED, no number with a failed status: every machine, in and far outside its box, any load."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import stiffmap as sm
from stiffmap import Flag, Status

MACHINES = sorted(p.stem for p in (Path(sm.__file__).parent / "model/machines").glob("*.yaml"))
FAILED = (Status.UNREACHABLE, Status.NOT_CONVERGED)


@pytest.mark.parametrize("name", MACHINES)
@pytest.mark.parametrize("method", ["fast", "reference"])
def test_numbers_and_statuses_agree(name: str, method: str) -> None:
    machine = sm.load_machine(name)
    rng = np.random.default_rng(3)
    low, high = machine.workspace
    middle, half = (low + high) / 2, (high - low) / 2
    count = 60 if method == "fast" else 12
    position = middle + half * rng.uniform(-1, 1, (count, 3)) * rng.choice([0.9, 1.5, 20.0], (count, 1))
    position[0] = middle + 1e3 * half  # out of reach of everything
    wrench = rng.normal(size=(count, 6)) * [1, 1, 1, 0.1, 0.1, 0.1] * 10.0 ** rng.uniform(0, 6, (count, 1))
    s = machine.solve(position, wrench, method=method, threads=1)
    converged = s.status == Status.CONVERGED
    assert np.isfinite(s.displacement[converged]).all()
    assert np.isfinite(s.compliance[converged]).all()
    elastic = converged & (s.flags & Flag.RIGID_DIRECTION == 0)  # a rigid direction has no finite stiffness
    assert np.isfinite(s.stiffness[elastic]).all()
    failed = np.isin(s.status, FAILED)
    assert failed[0]
    for values in (s.displacement, s.stiffness, s.compliance, s.actuator_effort):
        assert np.isnan(values[failed]).all()
