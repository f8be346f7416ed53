"""Pictures of what they cannot draw: one clear error, or the reason in the picture."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import xarray as xr

import stiffmap as sm

W = [100.0, 0, 0, 0, 0, 0]


@pytest.fixture(scope="module")
def drawn() -> dict[str, Any]:
    m = sm.load_machine("orthoglide-revised")
    return {
        "machine": m,
        "polar": sm.polar(m, [0, 0, 0], directions=4),
        "sweep": sm.sweep(m, [0, 0, 0], [1, 0, 0], [0, 100.0]),
        "map": sm.error_map(m, x=[0, 0.1], y=[0, 0.1], z=0, wrench=W),
        "stress": sm.assembly_wrenches(m, [0, 0, 0]),
        "nothing": None,
        "text": "x",
        "number": 3,
    }


@pytest.mark.parametrize(
    ("figure", "good"),
    [
        (sm.plot.polar_figure, "polar"),
        (sm.plot.ellipse_figure, "polar"),
        (sm.plot.sweep_figure, "sweep"),
        (sm.plot.map_figure, "map"),
        (sm.plot.stress_figure, "stress"),
    ],
)
def test_only_the_results_that_a_picture_shows_are_taken(
    figure: Any, good: str, drawn: dict[str, Any]
) -> None:
    figure(drawn[good])
    for kind in set(drawn) - {good}:
        with pytest.raises(sm.StiffmapError, match="expected"):
            figure(drawn[kind])
    with pytest.raises(sm.StiffmapError, match="expected"):
        figure([])


def test_a_mode_is_of_a_path(drawn: dict[str, Any]) -> None:
    for found in (*drawn.values(), xr.Dataset()):
        with pytest.raises(sm.StiffmapError, match=r"^path: expected (a|the) Dataset"):
            sm.plot.mode_figure(drawn["machine"], found)
        with pytest.raises(sm.StiffmapError, match=r"^path: expected (a|the) Dataset"):
            sm.plot.path_figure(found)


def test_one_pose_is_drawn_under_one_wrench(drawn: dict[str, Any]) -> None:
    m = drawn["machine"]
    for position in (np.zeros((2, 3)), np.zeros((0, 3))):
        for figure in (sm.plot.machine_figure, sm.plot.loaded_figure):
            with pytest.raises(sm.StiffmapError, match="position: expected one position"):
                figure(m, position)
    with pytest.raises(sm.StiffmapError, match="wrench: expected one wrench"):
        sm.plot.loaded_figure(m, [0, 0, 0], np.zeros((2, 6)))
    with pytest.raises(sm.StiffmapError, match="path: expected a Dataset"):
        sm.plot.mode_figure(m, None)
    with pytest.raises(sm.StiffmapError, match="figure: expected a Figure"):
        sm.plot.save("x", "x.png")


def test_stress_of_a_failed_pose_says_so(drawn: dict[str, Any]) -> None:
    titles = [
        sm.plot.stress_figure(sm.assembly_wrenches(drawn["machine"], p), "stress").get_suptitle()
        for p in ([0, 0, 0], [9, 0, 0])
    ]
    assert "unreachable" not in titles[0] and titles[1] == "stress: none, unreachable"
