"""Frequency responses of every shipped machine against MuJoCo's linearisation, dampers and losses everywhere."""

from __future__ import annotations

import pytest

import stiffmap as sm


@pytest.mark.parametrize("name", sm.machine_names())
def test_frequency_response_against_mujoco(name):
    pytest.importorskip("mujoco")
    from tests.python.workspace.vibration.mujoco_frf import difference

    assert difference(name) < 1e-6
