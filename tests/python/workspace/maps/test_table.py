"""A map as CSV and as a spreadsheet."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import stiffmap as sm
from stiffmap.common.errors import StiffmapError
from stiffmap.ui.cli.app import main
from stiffmap.workspace.maps.files import write_map_table

pd = pytest.importorskip("pandas")
pytest.importorskip("openpyxl")


def test_the_numbers_are_those_of_the_map(tmp_path: Path) -> None:
    ds = sm.error_map(
        "five-bar",
        x=[-0.1, 0.0, 9.0],
        y=[0.36, 0.4],
        z=[0.0],
        wrench={"F": [50, 20, 0, 0, 0, 0]},
        progress=False,
    )
    for name, read in (("m.csv", pd.read_csv), ("m.xlsx", pd.read_excel)):
        table = read(write_map_table(ds, tmp_path / name))
        assert len(table) == 6
        row = table[(table["x, mm"] == -100) & (table["y, mm"] == 400)].iloc[0]
        one = ds.sel(x=-0.1, y=0.4, z=0.0, case="F")
        assert row["dx F, µm"] == pytest.approx(1e6 * float(one.displacement[0]), rel=1e-8)
        assert row["worst_deflection, µm"] == pytest.approx(1e6 * float(one.worst_deflection), rel=1e-8)
        lost = table[table["x, mm"] == 9000]
        assert (lost["status F"] == "unreachable").all()
        assert np.isnan(lost["dx F, µm"]).all()
    with pytest.raises(StiffmapError, match=r"expected \.csv or \.xlsx"):
        write_map_table(ds, tmp_path / "m.ods")


def test_command(tmp_path: Path) -> None:
    call = ["map", "five-bar", "--points", "4", "--no-pictures", "-o", str(tmp_path)]
    assert main([*call, "--table", "csv,xlsx"]) == 0
    assert {p.name for p in tmp_path.iterdir()} >= {"map.csv", "map.xlsx"}
    assert main([*call, "--table", "ods"]) == 2
