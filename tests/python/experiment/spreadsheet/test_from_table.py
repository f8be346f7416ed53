"""`experiment_from_table` does all that its command does, for Python."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import stiffmap as sm
from stiffmap.common.errors import StiffmapError
from stiffmap.ui.cli.app import main

SHEET = """Name;Uhr 1 [µm];Uhr 2 [µm];Last X [N];x [mm];y [mm]
a;50,5;1,0;100;0;416
b;-20,25;;200;20;416
"""


def test_the_same_folder_as_by_the_command(tmp_path: Path) -> None:
    (tmp_path / "sheet.csv").write_text(SHEET, encoding="utf-8")
    said = {"dx": "Uhr 1 [µm]", "dy": "Uhr 2 [µm]"}
    made = sm.experiment_from_table(
        "five-bar", tmp_path / "sheet.csv", tmp_path / "own",
        columns=said, constants={"z": np.float64(0.0)}, noise={"dx": 1.0, "dy": np.int64(1)},
    )  # fmt: skip
    words = [f"--map={k}={v}" for k, v in said.items()]
    command = ["experiment", "new", str(tmp_path / "sheet.csv"), "--machine", "five-bar", *words]
    assert (
        main([*command, "--set", "z=0", "--noise=dx=1", "--noise=dy=1", "-o", str(tmp_path / "shell")]) == 0
    )
    for name in ("data.csv", "experiment.yaml"):
        assert (tmp_path / "own" / name).read_bytes() == (tmp_path / "shell" / name).read_bytes()
    e = made.experiment
    np.testing.assert_allclose(e.reading[:, 0], [50.5e-6, -20.25e-6])
    assert np.isnan(e.reading[1, 1]) and len(e) == 2 and made.folder == tmp_path / "own"
    assert sm.load_experiment(made.folder).ids == e.ids


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"columns": 3}, "columns: expected a mapping"),
        ({"noise": {"dx": "much"}}, "noise: dx: expected a number, got text"),
        ({"constants": {"z": None}}, "constants: z: expected a number"),
        ({"quantity": "speed"}, "quantity: expected"),
        ({"difference": "both"}, "difference: expected"),
        ({"record": {"weather": "fine"}}, "record: expected one of"),
        ({"machine": None}, "give either --machine or --dh"),
        ({"table": "nowhere.csv"}, "nowhere.csv"),
    ],
)
def test_what_is_wrong_is_one_error(tmp_path: Path, change: dict[str, object], message: str) -> None:
    (tmp_path / "sheet.csv").write_text(SHEET, encoding="utf-8")
    call = {"table": tmp_path / "sheet.csv", "folder": tmp_path / "own", "machine": "five-bar"}
    with pytest.raises(sm.StiffmapError, match=message):
        sm.experiment_from_table(**{**call, **change})
    assert not (tmp_path / "own").exists()


@pytest.mark.parametrize(
    "header",
    [
        "t,x,y,z,Fx,dx",  # seconds, as logs write them; T is a temperature
        "Nr,x,y,z,Fx,Disp X",
        "Nr,Pos X,Pos Y,Pos Z,Fx,x-displacement",
        "Nr,cmd_x,desired_y,z_ref,Fx,x-disp.",
    ],
)
def test_names_of_logs_and_of_image_correlation(header: str, tmp_path: Path) -> None:
    (tmp_path / "t.csv").write_text(f"{header}\n1,0,400,0,50,0.1\n2,50,420,0,50,0.2\n")
    made = sm.experiment_from_table(
        "five-bar",
        tmp_path / "t.csv",
        tmp_path / "out",
        units={"length": "mm", "force": "N"},
        noise={"dx": 0.01},
    )
    np.testing.assert_allclose(made.experiment.position, [[0, 0.4, 0], [0.05, 0.42, 0]])
    np.testing.assert_allclose(made.experiment.reading[:, 0], [1e-4, 2e-4])


@pytest.mark.parametrize("lost", ["px", "py", "pz"])
def test_a_place_without_one_of_its_axes_is_asked_for_by_its_name(lost: str, tmp_path: Path) -> None:
    header = "x [mm],y [mm],z [mm],fx [N],px [mm],py [mm],pz [mm]".replace(lost, "other")
    (tmp_path / "t.csv").write_text(f"{header}\n0,400,0,0,1,2,3\n50,420,0,0,1,2,3\n")
    with pytest.raises(StiffmapError, match=f"missing column '{lost}'.*say which by --map {lost}='HEADER'"):
        sm.experiment_from_table("five-bar", tmp_path / "t.csv", tmp_path / "o", quantity="position")


@pytest.mark.parametrize(
    ("text", "columns", "said"),
    [
        ("x,y,z,Fx,a,b\n0,400,0,50,0.1,400\n50,420,0,50,50.1,420\n90,410,0,50,90.1,410\n", {"dx": "a", "dy": "b"}, "dx, dy change"),
        ("x,y,z,Fx,a\n0,400,0,50,1200.1\n50,420,0,50,1250.3\n90,410,0,50,1290.2\n", {"dx": "a"}, "dx change"),  # in another frame
        ("x,y,z,Fx,a\n0,400,0,50,0.1\n50,420,0,50,0.15\n90,410,0,50,0.2\n", {"dx": "a"}, ""),
        ("x,y,z,Fx,a\n0,400,0,50,0.1\n0,400,0,50,0.1\n0,400,0,80,0.2\n", {"dx": "a"}, ""),
    ],
)  # fmt: skip
def test_places_that_are_given_as_differences_are_said(
    text: str, columns: dict[str, str], said: str, tmp_path: Path
) -> None:
    (tmp_path / "t.csv").write_text(text)
    units, noise = {"length": "mm", "force": "N"}, dict.fromkeys(columns, 0.1)
    made = sm.experiment_from_table(
        "five-bar", tmp_path / "t.csv", tmp_path / "o", columns=columns, units=units, noise=noise
    )
    first = " ".join(made.warnings)
    assert first.startswith(said) if said else "change as the commanded" not in first
