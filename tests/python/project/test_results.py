"""Results over poses convert themselves, all alike."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
import xarray as xr

import stiffmap as sm

POSES = [[0.0, 0, 0], [0.1, 0, 0], [9.0, 9, 9]]


def results() -> dict[str, Any]:
    """One of each kind, over three poses of which the last is out of reach."""
    m = sm.load_machine("orthoglide-revised")
    return {
        "Solution": m.solve(POSES, [100, 0, 0, 0, 0, 0]),
        "Kinematics": sm.inverse_kinematics(m, POSES),
        "InternalWrenches": sm.assembly_wrenches(m, POSES),
        "HoldingWrench": m.wrench(POSES, [1e-5, 0, 0, 0, 0, 0]),
        "AccuracyTransmission": sm.accuracy_transmission(m, POSES),
        "ForceTransmission": sm.force_transmission(m, POSES),
        "VelocityTransmission": sm.velocity_transmission(m, POSES),
        "NaturalFrequencies": sm.natural_frequencies(m, POSES),
    }


RESULTS = results()


@pytest.mark.parametrize("kind", RESULTS)
def test_results_over_poses_convert_and_are_written(kind: str, tmp_path: Path) -> None:
    result = RESULTS[kind]
    data = result.to_xarray()
    assert data["status"].dims == ("pose",) and data.sizes["pose"] == len(POSES)
    assert len(data.data_vars) > 1
    table = result.to_dataframe()
    assert len(table) == len(POSES) and table["status"].tolist() == result.status.tolist()
    for name, variable in data.data_vars.items():
        if variable.dtype.kind == "f" and variable.ndim == 2:
            own = str(variable.dims[1])
            first = data[own].to_numpy()[0] if own in data.coords else 0
            column = first if name == "displacement" and own == "component" else f"{name}_{first}"
            assert np.array_equal(table[column], variable[:, 0], equal_nan=True), name
    read = json.loads(result.to_json())
    assert read["status"] == result.status.tolist() and set(read) == set(data.data_vars)
    for ending in (".json", ".csv", ".nc"):
        result.save(tmp_path / f"{kind}{ending}")
    assert len(pd.read_csv(tmp_path / f"{kind}.csv")) == len(POSES)
    with xr.open_dataset(tmp_path / f"{kind}.nc") as back:
        assert set(back.data_vars) == set(data.data_vars)
    with pytest.raises(sm.StiffmapError, match=r"ends in \.json, \.csv, \.nc"):
        result.save(tmp_path / "a.txt")


def test_one_pose_is_one_row() -> None:
    s = sm.load_machine("orthoglide-revised").solve([0, 0, 0], [100, 0, 0, 0, 0, 0])
    table = s.to_dataframe()
    assert len(table) == 1
    assert [table[c][0] for c in ("dx", "dy", "dz", "rx", "ry", "rz")] == list(s.displacement)
    assert table["compliance_dx_fz"][0] == s.compliance[0, 2]
    assert table["actuator_effort_y.actuator"][0] == s.actuator_effort[1]
