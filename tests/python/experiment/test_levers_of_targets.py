"""Where targets were commanded: the tool point, and the lever of those that were seen and have been found."""

from __future__ import annotations

from typing import Any

import numpy as np

from stiffmap.experiment.setups import SEEN, target_positions


class Rows:
    """Four rows that stand upright or a quarter turn around z, with two targets of which one has been found."""

    setup = instrument = ()
    target = ("a", "b", "a", "a")
    points = (f"{SEEN}1", f"{SEEN}2", f"{SEEN}1", "tcp")
    registration = (("target a", np.eye(3), np.array([0.1, 0.0, 0.02])),)
    position = np.arange(12.0).reshape(4, 3)
    rotation = np.stack([np.eye(3), np.eye(3), np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]]), np.eye(3)])

    def __len__(self) -> int:
        return 4


def test_a_target_that_was_seen_and_found_stands_off_the_tool_point() -> None:
    rows: Any = Rows()
    lever = target_positions(rows) - rows.position
    np.testing.assert_allclose(lever, [[0.1, 0, 0.02], [0, 0, 0], [0, 0.1, 0.02], [0, 0, 0]], atol=1e-15)
    rows.points = ()
    np.testing.assert_array_equal(target_positions(rows), rows.position)
