"""What is written is read back: every field that a plan may have."""

from __future__ import annotations

from dataclasses import fields

import numpy as np
import pytest
from tests.python.experiment.conftest import Twin

from stiffmap.experiment import Experiment

PLANS = {
    "everything of a deflection": (
        "--poses", "3", "--loads", "full", "--branches", "--temperature", "20,25", "--setups", "2",
        "--frame", "unknown", "--unloaded", "unknown", "--zero-noise", "0.004", "--tool", "offset_unknown",
        "--joint", "x.actuator", "--joint", "y.distal", "--joint", "x.actuator:motor", "--read", "dx,rz",
        "--instrument-on", "base", "--target-on", "platform", "--force-against", "base",
        "--gravity", "0,0,-9.81", "--approach", "--shuffle",
    ),
    "distances": ("--quantity", "position", "--poses", "4", "--distances"),
    "command": ("--quantity", "position", "--poses", "4", "--command", "--approach"),
}  # fmt: skip


@pytest.mark.parametrize("name", PLANS)
def test_a_twin_survives_its_file(name: str, twin: Twin, tmp_path: object) -> None:
    from stiffmap.experiment import load_experiment, save_experiment

    e = twin(*PLANS[name])
    save_experiment(e, f"{tmp_path}/again", e.title)
    again = load_experiment(f"{tmp_path}/again")
    for f in fields(Experiment):
        one, two = getattr(e, f.name), getattr(again, f.name)
        if f.name in ("name", "source"):
            continue
        if isinstance(one, np.ndarray) and one.dtype.kind == "f":
            np.testing.assert_allclose(one, two, rtol=1e-8, atol=1e-14, err_msg=f.name)
        elif isinstance(one, np.ndarray):
            np.testing.assert_array_equal(one, two)
        else:
            assert one == two, f.name


def test_noise_of_single_readings(twin: Twin, tmp_path: object) -> None:
    from dataclasses import replace

    from stiffmap.experiment import load_experiment, save_experiment

    e = twin("--poses", "3", "--loads", "2")
    sigma = e.sigma * np.linspace(1, 2, len(e))[:, None]
    save_experiment(replace(e, sigma=sigma), f"{tmp_path}/own")
    np.testing.assert_allclose(load_experiment(f"{tmp_path}/own").sigma, sigma, rtol=1e-8)
