"""Every column may have its own unit."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import stiffmap as sm

PLAIN = """machine: orthoglide-revised
quantity: deflection
units: {length: mm, force: N, angle: deg}
noise: {dx: 0.003, rx: 0.01}
"""
MIXED = """machine: orthoglide-revised
quantity: deflection
units: {length: mm, force: N, temperature: degC, dx: um, x: cm, fx: kN, mz: N*m, rx: mrad}
noise: {dx: 3, rx: 0.17453292519943295}
"""
ROWS = "x,y,z,fx,fy,fz,mz,temperature,u_dx,dx,rx\n10,20,30,100,0,5,2000,20.5,0.004,0.101,0.02\n"
OTHER = "x,y,z,fx,fy,fz,mz,temperature,u_dx,dx,rx\n1,20,30,0.1,0,5,2,20.5,4,101,0.3490658503988659\n"


def load(folder: Path, head: str, rows: str) -> sm.Experiment:
    folder.mkdir()
    (folder / "experiment.yaml").write_text(head)
    (folder / "data.csv").write_text(rows)
    return sm.load_experiment(folder)


def test_units_of_single_columns(tmp_path: Path) -> None:
    one, other = load(tmp_path / "a", PLAIN, ROWS), load(tmp_path / "b", MIXED, OTHER)
    for name in ("position", "wrench", "reading", "sigma"):
        np.testing.assert_allclose(getattr(other, name), getattr(one, name), rtol=1e-12)
    assert other.temperature is not None and other.temperature[0] == 20.5


def test_a_wrong_unit_names_its_column(tmp_path: Path) -> None:
    with pytest.raises(sm.StiffmapError, match=r"units\.dx"):
        load(tmp_path / "c", MIXED.replace("dx: um", "dx: N"), OTHER)
    with pytest.raises(sm.StiffmapError, match="did you mean"):
        load(tmp_path / "d", MIXED.replace("dx: um", "dxx: um"), OTHER)
