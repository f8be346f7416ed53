"""Rows are no outliers where what is left could not contradict anything."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import stiffmap as sm
from stiffmap.common.tables.sheet import read_sheet
from stiffmap.experiment.spreadsheet.dh import forward, read_dh

ARM = "i,theta [deg],d [mm],a [mm],alpha [deg]\n1,0,300,0,90\n2,0,0,400,0\n3,0,0,300,0\n"


@pytest.mark.parametrize("wrong", [(1, 3), (0, 4), (1, 2), (1, 4)])
def test_two_of_five_rows_in_unknown_frames_are_not_set_aside(wrong: tuple[int, int], tmp_path: Path) -> None:
    """15 readings, 9 unknowns of instrument and reflector: without two rows, those that are left fit anything."""
    (tmp_path / "dh.csv").write_text(ARM)
    rows = read_dh(read_sheet(tmp_path / "dh.csv"), {}, "standard")
    q = np.random.default_rng(1).uniform(-1.2, 1.2, (5, 3))
    at = 1e3 * np.array([(forward(rows, True, v) @ [0.05, 0.02, 0.04, 1.0])[:3] for v in q])
    at[list(wrong)] += [[0.0, 6.0, -5.0], [7.0, 0.0, 6.0]]
    cells = [",".join(map(repr, [*a.tolist(), *b.tolist()])) for a, b in zip(q, at, strict=True)]
    (tmp_path / "t.csv").write_text("q1,q2,q3,px,py,pz\n" + "\n".join(cells) + "\n")
    noise, units = dict.fromkeys(("dx", "dy", "dz"), 0.05), {"joints": "rad", "length": "mm"}
    made = sm.experiment_from_table(
        None, tmp_path / "t.csv", tmp_path / "o", dh=tmp_path / "dh.csv", units=units, noise=noise
    )
    found = sm.residual(made.machine, made.experiment)
    assert not found.set_aside.any()
    assert found.lack_of_fit < 1e-6


def test_as_many_unknowns_as_readings_leave_nothing_to_contradict(tmp_path: Path) -> None:
    """9 readings, 9 unknowns of instrument and reflector: whatever was read fits, and no p-value says so."""
    (tmp_path / "dh.csv").write_text(ARM)
    cells = "0.1,0.2,0.3,500,20,400\n0.9,-0.4,0.5,300,520,100\n-0.7,0.8,-0.9,480,-390,620\n"
    (tmp_path / "t.csv").write_text(f"q1,q2,q3,px,py,pz\n{cells}")
    noise, units = dict.fromkeys(("px", "py", "pz"), 50.0), {"joints": "rad", "length": "mm"}
    made = sm.experiment_from_table(
        None, tmp_path / "t.csv", tmp_path / "o", dh=tmp_path / "dh.csv", units=units, noise=noise
    )
    found = sm.residual(made.machine, made.experiment)
    assert np.isnan(found.lack_of_fit)
    assert "nothing is left to contradict" in "\n".join(found.lines())
