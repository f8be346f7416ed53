"""Machines of further classes: they close over their boxes, and both paths give the same numbers at home."""

from __future__ import annotations

import numpy as np
import pytest
from tests.oracle.unseen import UNSEEN

import stiffmap as sm


@pytest.mark.parametrize("name", UNSEEN)
def test_unseen_machines_close_over_their_box(name: str) -> None:
    machine = sm.Machine(UNSEEN[name]())
    assert machine.name == name
    at = np.random.default_rng(0).uniform(*machine.workspace, (20, 3))
    closed = machine.solve(at, gravity=(0, 0, 0), stiffness=False)
    assert (closed.status != sm.Status.UNREACHABLE).all()
    home = machine.description.home.p
    fast, reference = (machine.solve(home, gravity=(0, 0, 0), method=how) for how in ("fast", "reference"))
    assert fast.status == reference.status == sm.Status.CONVERGED
    size = np.sqrt(np.diagonal(reference.compliance))
    assert np.nanmax(np.abs(fast.compliance - reference.compliance) / np.outer(size, size)) < 1e-9
