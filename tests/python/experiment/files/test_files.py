"""Experiments as files: what is read, and one clear error for each thing that is wrong."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import stiffmap as sm
from stiffmap.experiment import random_plan, save_experiment, simulate

HEAD = (
    "machine: orthoglide-revised\nquantity: deflection\nunits: {length: mm, force: N}\nnoise: {dx: 0.003}\n"
)
ROWS = "id,x,y,z,fx,fy,fz,dx\n1,0,0,0,100,0,0,0.05\n2,0,0,0,-100,0,0,-0.05\n3,10,0,0,100,0,0,\n"


def write(folder: Path, head: str = HEAD, rows: str = ROWS) -> Path:
    (folder / "experiment.yaml").write_text(head)
    (folder / "data.csv").write_text(rows)
    return folder


def test_values_become_si(tmp_path: Path) -> None:
    e = sm.load_experiment(write(tmp_path))
    assert e.quantity == "deflection" and e.ids == ("1", "2", "3") and e.axes == ("dx",)
    assert e.reading[0, 0] == pytest.approx(5e-5, rel=1e-12)
    assert e.position[2, 0] == pytest.approx(0.01, rel=1e-12)
    assert e.wrench[1].tolist() == [-100, 0, 0, 0, 0, 0]
    assert np.isnan(e.reading[2]).all()
    assert e.groups[0] == e.groups[1] != e.groups[2]


def test_decimal_commas_are_those_of_numbers_alone(tmp_path: Path) -> None:
    """A name such as 1,2 stays as it is written."""
    rows = "id;x;y;z;fx;fy;fz;dx\n1,1;0,5;0;0;100;0;0;0,05\n1,2;0,5;0;0;-100;0;0;-0,05\n2,1;10;0;0;100;0;0;\n"
    e = sm.load_experiment(write(tmp_path, rows=rows))
    assert e.ids == ("1,1", "1,2", "2,1")
    assert e.reading[:2, 0] == pytest.approx([5e-5, -5e-5], rel=1e-12)
    assert e.position[:, 0] == pytest.approx([5e-4, 5e-4, 0.01], rel=1e-12)


@pytest.mark.parametrize(
    ("head", "rows", "words"),
    [
        (HEAD, ROWS.replace("id,x,", "id,u,"), ["data.csv", "'u'"]),
        (HEAD, "id,y,z,fx,dx\n1,0,0,100,0.05\n", ["data.csv", "missing column 'x'"]),
        (HEAD.replace(", force: N", ""), ROWS, ["'force' is not declared"]),
        (HEAD.replace("units: {length: mm, force: N}\n", ""), ROWS, ["units"]),
        (HEAD, ROWS.replace("2,0,0", "1,0,0"), ["data.csv, line 3", "'id'", "twice"]),
        (HEAD, ROWS.replace("-0.05", "oops"), ["data.csv, line 3", "'dx'", "oops"]),
        (HEAD, ROWS.replace("-100,0,0", "nan,0,0"), ["data.csv, line 3", "'fx'", "finite"]),
        (HEAD, ROWS.replace(",dx\n", ",rx\n"), ["'angle' is not declared"]),
        (HEAD, ROWS.replace("3,10,0,0,100,0,0,\n", "3,10,0\n"), ["line 4", "expected 8 values"]),
        (HEAD, f"{ROWS}mean,0,0,0,0,0,0,0\n", ["data.csv, line 5", "readings alone", "'mean'"]),
        (HEAD.replace("deflection", "distance"), ROWS, ["quantity"]),
        (HEAD, "id,x,y,z,dx\n1,0,0,0,0.1\n", ["needs a load", "a position none"]),
        (HEAD + "colour: red\n", ROWS, ["unknown key 'colour'"]),
    ],
)
def test_bad_input_is_one_clear_error(tmp_path: Path, head: str, rows: str, words: list[str]) -> None:
    with pytest.raises(sm.StiffmapError) as caught:
        sm.load_experiment(write(tmp_path, head, rows))
    for word in words:
        assert word in str(caught.value)


@pytest.mark.parametrize("name", ["", "row", "Unnamed: 0"])
def test_names_of_rows_are_those_that_programs_write(name: str, tmp_path: Path) -> None:
    e = sm.load_experiment(write(tmp_path, rows=ROWS.replace("id,", f"{name},", 1)))
    assert e.ids == ("1", "2", "3") and e.reading[0, 0] == pytest.approx(5e-5, rel=1e-12)
    head, *rows = ROWS.splitlines()
    beside = "\n".join([f"{name},{head}", *(f"{7 + k},{row}" for k, row in enumerate(rows)), ""])
    found = sm.load_experiment(write(tmp_path, rows=beside))
    assert found.ids == e.ids and np.array_equal(found.reading, e.reading, equal_nan=True)


def test_letters_name_rows(tmp_path: Path) -> None:
    rows = ROWS.replace("\n1,", "\nl,").replace("\n2,", "\nm,").replace("\n3,", "\nn,")
    assert sm.load_experiment(write(tmp_path, rows=rows)).ids == ("l", "m", "n")


def test_no_folder(tmp_path: Path) -> None:
    with pytest.raises(sm.StiffmapError, match="no such experiment"):
        sm.load_experiment(tmp_path / "nowhere")


def test_a_table_is_no_folder(tmp_path: Path) -> None:
    (tmp_path / "readings.xlsx").write_bytes(b"PK\xff")
    with pytest.raises(
        sm.StiffmapError, match=r"readings.xlsx: .*stiffmap experiment new makes one of a table"
    ):
        sm.load_experiment(tmp_path / "readings.xlsx")


def test_a_virtual_experiment_survives_its_file(tmp_path: Path) -> None:
    machine = sm.load_machine("orthoglide-revised")
    twin = simulate(machine, random_plan(machine, "deflection", poses=3, loads=2), seed=3)
    save_experiment(twin, tmp_path)
    back = sm.load_experiment(tmp_path)
    assert back.ids == twin.ids and back.quantity == twin.quantity
    np.testing.assert_allclose(back.position, twin.position, atol=1e-12)
    np.testing.assert_allclose(back.wrench, twin.wrench, atol=1e-12)
    np.testing.assert_allclose(back.reading, twin.reading, rtol=1e-8)
    np.testing.assert_allclose(back.sigma, twin.sigma, rtol=1e-5)


HEADERS = "id,x,y,z,fx,dx,dy,rx,u_dx,hours"
CELLS = "a,1,2,300,100,0.01,0.02,0.5,0.003,1"


def with_header(folder: Path, header: str, cells: str, more: str = "") -> sm.Experiment:
    (folder / "experiment.yaml").write_text(
        "machine: linear-delta\nquantity: deflection\nunits: {length: mm, force: N, angle: mrad}\n"
        f"noise: {{dx: 0.003, dy: 0.003, dz: 0.003, rx: 0.01}}\n{more}"
    )
    (folder / "data.csv").write_text(f"{header}\n{cells}\n", encoding="utf-8")
    return sm.load_experiment(folder)


def test_a_header_may_name_its_unit(tmp_path: Path) -> None:
    """The unit of a column is its header's; noise of the file stays in the file's units."""
    bare = with_header(tmp_path, HEADERS, CELLS)
    headers = "id,x [cm],y [µm],z (m),fx [kN],DEFL [um],dy [mm],rx [deg],u_dx [um],hours [h]"
    cells = f"a,0.1,2000,0.3,0.1,10,0.02,{float(np.degrees(5e-4))!r},3,1"
    own = with_header(tmp_path, headers, cells, "columns: {dx: DEFL}\n")
    for name in ("position", "wrench", "reading", "sigma", "hours"):
        np.testing.assert_allclose(getattr(own, name), getattr(bare, name), rtol=1e-14, err_msg=name)
    wrong = {"x [N]": "unit of column 'x': expected m, cm, .*; found 'N'", "fx [kg]": "unit of column 'fx'",
             "id [mm]": "unit of column 'id': expected none; found 'mm'", "x,x [mm]": "column 'x' occurs twice"}  # fmt: skip
    for header, words in wrong.items():
        column = header.partition(" ")[0].partition(",")[0]
        more = CELLS if "," not in header else CELLS.replace("a,1", "a,1,1")
        with pytest.raises(sm.StiffmapError, match=words) as caught:
            with_header(tmp_path, f",{HEADERS},".replace(f",{column},", f",{header},").strip(","), more)
        assert "data.csv" in str(caught.value) and "\n" not in str(caught.value)


def test_each_column_has_the_unit_of_its_own_header(tmp_path: Path) -> None:
    """Not that of the first column of its quantity."""
    head = HEAD.replace("force: N}", "force: N, angle: mrad}").replace("dx: 0.003", "dx: 0.003, rx: 0.1")
    rows = "id,x,y,z,fx,dx,rx [deg],ry [rad],rz\n1,0,0,0,100,0.05,1,0.01,2\n"
    e = sm.load_experiment(write(tmp_path, head, rows))
    assert e.axes == ("dx", "rx", "ry", "rz")
    np.testing.assert_allclose(e.reading[0, [0, 3, 4, 5]], [5e-5, np.deg2rad(1), 0.01, 2e-3], rtol=1e-12)
