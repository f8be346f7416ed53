"""Plans as CSV files: columns in mm, N and rad, or in the unit that their header names."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import stiffmap as sm
from stiffmap.common.errors import FileError
from stiffmap.experiment.files.load import load_plan


def plan(folder: Path, text: str) -> sm.Experiment:
    (folder / "p.csv").write_text(text, encoding="utf-8")
    return load_plan(
        folder / "p.csv",
        sm.load_machine("linear-delta"),
        "position",
        axes=("dx", "dy", "dz"),
        noise=None,
        angle_noise=1e-5,
    )


@pytest.mark.parametrize(
    "text",
    [
        "x [cm],y [µm],z,fx [kN]\n1,20000,300,0.1\n",
        "x_mm,y_um,z_cm,fx_kN\n10,20000,30,0.1\n",
        "X (mm);Y (cm);Z (mm);Fx (N)\n10,0;2,0;300;100\n",
        "X / mm,Y / mm,Z / mm,FX / N\n10,20,300,100\n",
    ],
)
def test_headers_may_name_their_units(text: str, tmp_path: Path) -> None:
    bare = plan(tmp_path, "x,y,z,fx\n10,20,300,100\n")
    own = plan(tmp_path, text)
    np.testing.assert_allclose(own.position, bare.position, rtol=1e-15)
    np.testing.assert_allclose(own.position, [[0.01, 0.02, 0.3]], rtol=1e-15)
    np.testing.assert_allclose(own.wrench, bare.wrench, rtol=1e-15)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("x [N],y,z\n1,2,3\n", "unit of column 'x': expected m, cm, .*; found 'N'"),
        ("x,y,z,order [s]\n1,2,3,1\n", "unit of column 'order': expected none; found 's'"),
        ("x,x [mm],y,z\n1,1,2,3\n", "column 'x' occurs twice"),
        ("x [mm],y,zz [mm]\n1,2,3\n", "unknown column 'zz'"),
    ],
)
def test_wrong_headers_are_named(text: str, words: str, tmp_path: Path) -> None:
    with pytest.raises(FileError, match=words):
        plan(tmp_path, text)
