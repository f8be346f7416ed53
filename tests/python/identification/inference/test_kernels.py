"""Which gaps the readings of an experiment can hold."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from stiffmap.identification.inference import kernels


@pytest.mark.parametrize(
    ("pose", "condition", "expected"),
    [
        ([0, 1, 2], [0, 1, 2], []),  # one row a pose: what its readings share is their noise
        ([0, 0, 1], [0, 0, 1], ["condition"]),
        ([0, 0, 1], [0, 1, 2], ["pose"]),
        ([0, 0, 0], [0, 0, 1], ["condition", "pose"]),
    ],
)
def test_what_readings_share_is_asked_for_once_and_where_it_is_not_the_noise(pose, condition, expected):
    e: Any = SimpleNamespace(groups=np.array(pose), conditions=np.array(condition))
    rows, channel = np.repeat(np.arange(3), 3), np.tile(np.arange(3), 3)
    found = list(kernels.shared(e, rows, channel))
    assert [name for _, name, _ in found] == expected
    assert all(np.all(k[channel[:, None] != channel] == 0.0) for _, _, k in found)
