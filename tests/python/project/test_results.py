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


def results(poses: Any = POSES) -> dict[str, Any]:
    """One of each kind, over three poses of which the last is out of reach."""
    m = sm.load_machine("orthoglide-revised")
    return {
        "Solution": m.solve(poses, [100, 0, 0, 0, 0, 0]),
        "Kinematics": sm.inverse_kinematics(m, poses),
        "InternalWrenches": sm.assembly_wrenches(m, poses),
        "HoldingWrench": m.wrench(poses, [1e-5, 0, 0, 0, 0, 0]),
        "AccuracyTransmission": sm.accuracy_transmission(m, poses),
        "ForceTransmission": sm.force_transmission(m, poses),
        "VelocityTransmission": sm.velocity_transmission(m, poses),
        "NaturalFrequencies": sm.natural_frequencies(m, poses),
    }


RESULTS = results()
OTHERS = [results(p) for p in (POSES[0], np.zeros((0, 3)), [*POSES, POSES[0]])]


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


@pytest.mark.parametrize("kind", RESULTS)
def test_columns_are_those_of_any_number_of_poses(kind: str) -> None:
    """Three poses of a machine with three drives too: its limits are no numbers of the poses."""
    columns = list(RESULTS[kind].to_dataframe().columns)
    for other, count in zip(OTHERS, (1, 0, 4), strict=True):
        table = other[kind].to_dataframe()
        assert len(table) == count
        assert list(table.columns) == columns


def test_only_base_axes_are_called_x_y_z() -> None:
    """Three drives, three modes and three encoders are numbered; twists and wrenches have the names of their components."""
    modes = sm.natural_frequencies(sm.load_machine("orthoglide-revised"), POSES, modes=3)
    names = {n: set(r.to_dataframe().columns) for n, r in (RESULTS | {"modes": modes}).items()}
    assert {"actuators_0", "position_x", "rotation_z_y"} < names["Kinematics"]
    assert {"frequency_0", "frequency_2"} < names["modes"]
    assert {"corner_2", "errors_0", "components_dx"} < names["AccuracyTransmission"]
    assert {"jacobian_dz_0", "limits_2"} < names["VelocityTransmission"]
    assert {"dx", "springs.x.foot_fx", "legs.x_mz"} < names["InternalWrenches"]
    assert {"stiffness_fx_dx", "leg_wrench_0_fx"} < names["HoldingWrench"]
    assert RESULTS["VelocityTransmission"].to_xarray()["limits"].shape == (3,)


def test_plain_data_is_data_of_json() -> None:
    m = sm.load_machine("orthoglide-revised")
    one, failed = (m.solve(p, [100, 0, 0, 0, 0, 0]) for p in (POSES[0], POSES[2]))
    held = m.wrench(POSES[2], [1e-5, 0, 0, 0, 0, 0])
    budget = sm.deflection_budget(m, POSES[0], [100, 0, 0, 0, 0, 0])
    for result in (one, failed, held, budget):
        json.dumps(result.as_plain(), allow_nan=False)
    assert failed.as_plain()["displacement"] == [None] * 6
    for several in (RESULTS["Solution"], RESULTS["HoldingWrench"], OTHERS[1]["Solution"]):
        with pytest.raises(sm.StiffmapError, match="status: expected that of one pose"):
            several.as_plain()


def test_the_largest_internal_force_where_poses_failed() -> None:
    failed = sm.assembly_wrenches(sm.load_machine("orthoglide-revised"), POSES[2:])
    assert np.isnan(failed.largest()[1]) and np.isnan(OTHERS[1]["InternalWrenches"].largest()[1])
    assert RESULTS["InternalWrenches"].largest()[1] >= 0
    with pytest.raises(sm.StiffmapError, match="no link springs"):
        sm.assembly_wrenches(sm.load_machine("ur10"), [-0.775, -0.05, 0.3]).largest()


def test_the_largest_displacement_is_that_of_a_pose_with_an_answer() -> None:
    """An unstable equilibrium keeps its displacement, but is no answer; nor has one a batch of failed poses alone."""
    short = sm.load_machine("orthoglide-revised").with_number("x.bar/length", 0.01)
    unstable = short.solve(POSES[0], [100, 0, 0, 0, 0, 0])
    assert unstable.status == sm.Status.UNSTABLE and np.isfinite(unstable.displacement).all()
    assert "largest displacement none" in unstable._repr_html_()
    assert "largest displacement none" in OTHERS[1]["Solution"]._repr_html_()
    assert "largest displacement 0.0" in RESULTS["Solution"]._repr_html_()
