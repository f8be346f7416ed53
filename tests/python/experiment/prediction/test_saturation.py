"""A load that is commanded and not reached."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from stiffmap.experiment import load_experiment, save_experiment
from stiffmap.experiment.comparison.limitations import saturated

HEAD = """machine: gear
quantity: position
units: {length: mm, force: N, mz: N*m, angle: deg}
noise: {rz: 0.01}
command: {q: {actuator: box.gear, unit: deg}}
"""


def folder(place: Path, got: np.ndarray, asked: np.ndarray | None) -> Path:
    place.mkdir()
    (place / "experiment.yaml").write_text(HEAD)
    columns = ["order,q,rz,mz" + ("" if asked is None else ",mz_cmd")]
    for i, t in enumerate(got):
        columns.append(f"{i},0,{0.01 * t},{t}" + ("" if asked is None else f",{asked[i]}"))
    (place / "data.csv").write_text("\n".join(columns))
    return place


def ramp() -> np.ndarray:
    return np.concatenate([np.linspace(0, 40, 50), np.linspace(40, -40, 100), np.linspace(-40, 0, 50)])


def test_a_commanded_torque_that_saturates_is_told(tmp_path: Path) -> None:
    noise = 0.05 * np.random.default_rng(0).standard_normal(200)
    e = load_experiment(folder(tmp_path / "a", np.clip(ramp(), -25, 25) + noise, ramp()))
    (told,) = saturated(e)
    assert told.startswith("mz saturates at ±25")
    assert "up to 40 N·m is commanded" in told


@pytest.mark.parametrize("gain", [1.0, 0.8])
def test_a_load_that_follows_its_command_does_not_saturate(tmp_path: Path, gain: float) -> None:
    assert not saturated(load_experiment(folder(tmp_path / "a", gain * ramp(), ramp())))
    assert not saturated(load_experiment(folder(tmp_path / "b", np.clip(ramp(), -25, 25), None)))


def test_commanded_loads_are_saved(tmp_path: Path) -> None:
    e = load_experiment(folder(tmp_path / "a", np.clip(ramp(), -25, 25), ramp()))
    assert e.asked is not None
    save_experiment(e, tmp_path / "b")
    again = load_experiment(tmp_path / "b")
    assert again.asked is not None
    np.testing.assert_allclose(again.asked[:, 5], e.asked[:, 5])
    assert np.isnan(again.asked[:, :5]).all()
