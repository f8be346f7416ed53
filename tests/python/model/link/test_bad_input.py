"""Bad input to the identification: one clear error each."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from tests.python.model.link.link_fields import REFERENCE, WRENCHES, bar_compliance, end_nodes, noisy_field

from stiffmap.common.errors import StiffmapError
from stiffmap.model.link.identify import identify_link

POINTS, U = noisy_field(n=12)
NAN = U.copy()
NAN[2, 3, 1] = np.nan
LINE = np.linspace(0, 1, 12)[:, None] * [[0.01, 0.02, 0.03]]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"points": POINTS[:2], "displacements": U[:, :2]}, "points: expected at least 3"),
        ({"points": LINE}, "not on one line"),
        (
            {"displacements": NAN},
            r"displacements: expected finite numbers, got 1 NaN or infinite, first at \(2, 3, 1\)",
        ),
        ({"displacements": U[0]}, r"displacements: expected shape \(cases, n, 3\).*got \(12, 3\)"),
        ({"displacements": 0 * U}, "displacements: expected a field that moves, got 0 m at every point"),
        ({"displacements": 0 * U, "noise": 1e-6}, "displacements: expected a field that moves"),
        ({"displacements": 1e-290 * U}, "displacements: expected a field that moves"),
        ({"displacements": U[:, :5]}, "got .6, 5, 3."),
        ({"wrenches": WRENCHES[:, :3]}, r"wrenches: expected shape \(cases, 6\).*got \(6, 3\)"),
        ({"wrenches": WRENCHES[[0, 1, 2, 3, 4, 4]]}, "rank 6, got rank 5 from 6 cases; the columns of Mz"),
        ({"wrenches": WRENCHES[:4], "displacements": U[:4]}, "rank 4.*columns of My, Mz"),
        ({"wrenches": 0 * WRENCHES, "partial": True}, "at least one load case that is not zero"),
        ({"reference": [0, 0]}, r"reference: expected shape \(3,\)"),
        (
            {"reference": REFERENCE / 1e3},
            "reference: expected a place near the points, .* times 1000 is among",
        ),
        ({"points": "abc"}, "points: expected an array of numbers"),
        ({"noise": -1.0}, "noise: expected None"),
        ({"noise": [1e-8, 1e-8]}, "one or 6 positive numbers"),
        ({"noise": "white"}, "noise: expected None"),
        ({"level": 1.5}, "level: expected a probability"),
    ],
)
def test_one_clear_error(change, words):
    given = {"points": POINTS, "displacements": U, "wrenches": WRENCHES, "reference": REFERENCE} | change
    with pytest.raises(StiffmapError, match=words) as error:
        identify_link(**given)
    assert "\n" not in str(error.value)


def test_too_large_rotation_says_at_which_size():
    points, W = end_nodes(40), WRENCHES * 20
    u = [
        (points - REFERENCE) @ (Rotation.from_rotvec(x[3:]).as_matrix() - np.eye(3)).T + x[:3]
        for x in W @ bar_compliance().T
    ]
    noise = 1e-8 * np.random.default_rng(0).standard_normal((6, 40, 3))
    with pytest.raises(
        StiffmapError, match=r"too large for a linear field: case \d turns by .* part at .* rad"
    ):
        identify_link(points, np.array(u) + noise, W, reference=REFERENCE, method="linear")


def test_nodes_left_on_a_line_after_outliers_are_refused():
    points = np.vstack([LINE, [[0.0, 0.01, 0.0]]])
    u = np.zeros((6, 13, 3))
    u[:] = np.arange(1, 7)[:, None, None] * 1e-6
    u += 1e-12 * np.random.default_rng(0).standard_normal(u.shape)
    u[:, 12] += 1e-3
    with pytest.raises(StiffmapError, match="not on one line"):
        identify_link(points, u, WRENCHES, reference=REFERENCE)
