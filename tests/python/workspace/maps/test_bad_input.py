"""Bad input: one clear sentence each."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import stiffmap as sm

GOOD: dict[str, Any] = {"x": [0.0], "y": [0.0], "z": [0.0], "wrench": [300.0, 0, 0, 0, 0, 0]}
BAD_MAPS: list[tuple[dict[str, Any], str]] = [
    ({"x": []}, "x: expected at least one number, got an empty grid"),
    ({"y": [0.0, np.nan]}, "y: expected finite numbers, got nan at index 1"),
    ({"z": [0.0, np.inf]}, "z: expected finite numbers, got inf"),
    ({"x": [0.1, 0.1]}, "x: expected different numbers"),
    ({"x": [[0.1, 0.2]]}, r"x: expected one axis of numbers, got shape \(1, 2\)"),
    ({"x": ["a"]}, "x: expected numbers"),
    ({"wrench": [300.0, 0, 0]}, "wrench: expected 6 numbers"),
    ({"wrench": np.zeros((2, 2, 6))}, r"wrench: expected shape \(6,\) or \(cases, 6\)"),
    ({"wrench": {}}, "wrench: expected at least one case"),
    ({"wrench": [np.nan] * 6}, "wrench: expected finite numbers"),
    ({"wrench": np.ones((2, 6)), "cases": ["a"]}, "cases: expected 2 different names"),
    ({"wrench": None}, "force: the wrench holds no force"),
    ({"wrench": None, "tolerance": 0.0}, "tolerance: expected a positive number"),
    ({"wrench": None, "directions": 2}, "directions: expected 3 or more"),
    ({"wrench": None, "plane": "zx"}, "plane: expected one of xy, xz, yz"),
    ({"force": -1.0}, "force: expected a positive number"),
    ({"tolerance": 0.0}, "tolerance: expected a positive number"),
    ({"plane": "zx"}, "plane: expected one of xy, xz, yz"),
    ({"directions": 2}, "directions: expected 3 or more"),
    ({"chunk": 0}, "chunk: expected 1 or more"),
    ({"threads": 0}, "threads: expected 1 or more"),
    ({"point": "nose"}, "point: expected one of"),
]


@pytest.mark.parametrize(("change", "message"), BAD_MAPS, ids=[m for _, m in BAD_MAPS])
def test_error_map(machine: sm.Machine, change: dict[str, Any], message: str) -> None:
    with pytest.raises(sm.StiffmapError, match=message):
        sm.error_map(machine, **{**GOOD, **change})


@pytest.mark.parametrize("name", ["m.csv", "m.xlsx", "m.json"])
def test_a_map_is_no_table(machine: sm.Machine, tmp_path: Path, name: str) -> None:
    with pytest.raises(
        sm.StiffmapError, match=rf"out: expected a name that ends in \.nc or \.zarr, found '{name}'"
    ):
        sm.error_map(machine, **GOOD, out=tmp_path / name)
    assert not list(tmp_path.iterdir())


def test_unwritable_output(machine: sm.Machine, tmp_path: Path) -> None:
    with pytest.raises(sm.StiffmapError, match=r"m\.nc: cannot be written"):
        sm.error_map(machine, **GOOD, out=tmp_path / "nowhere" / "m.nc")
    (tmp_path / "folder.nc").mkdir()
    with pytest.raises(sm.StiffmapError, match="cannot be written: it is a folder"):
        sm.error_map(machine, **GOOD, out=tmp_path / "folder.nc")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"position": [0.0, 0.0]}, "position: expected a position"),
        ({"position": np.zeros((2, 3))}, "position: expected one position"),
        ({"position": [0.0, 0.0, np.nan]}, "position: expected finite numbers"),
        ({"force": 0.0}, "force: expected a positive number"),
        ({"plane": "ab"}, "plane: expected one of"),
        ({"directions": 1}, "directions: expected 3 or more"),
    ],
)
def test_polar(machine: sm.Machine, change: dict[str, Any], message: str) -> None:
    with pytest.raises(sm.StiffmapError, match=message):
        sm.polar(machine, **{"position": np.zeros(3), **change})


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"direction": [0.0, 0.0, 0.0]}, "direction: expected one vector"),
        ({"direction": [1.0, 0.0]}, "direction: expected a direction"),
        ({"forces": []}, "forces: expected at least one number"),
        ({"forces": [np.nan]}, "forces: expected finite numbers"),
    ],
)
def test_sweep(machine: sm.Machine, change: dict[str, Any], message: str) -> None:
    with pytest.raises(sm.StiffmapError, match=message):
        sm.sweep(machine, **{"position": np.zeros(3), "direction": [1.0, 0, 0], "forces": [1.0], **change})
