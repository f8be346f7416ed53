"""Commands map, polar, sweep, solve, show, paper: output, files, exit codes, bad input."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

import stiffmap as sm
from stiffmap.ui.cli import main

PNG = b"\x89PNG"
NAME = "orthoglide-revised"
NAMES = ["map", "polar", "sweep", "solve", "show", "paper"]


def run(capsys: pytest.CaptureFixture[str], *arguments: str) -> tuple[int, str, str]:
    """Exit code, output, errors."""
    code = main(arguments)
    out, err = capsys.readouterr()
    return code, out, err


def run_json(capsys: pytest.CaptureFixture[str], *arguments: str) -> tuple[int, Any]:
    """Exit code and the JSON document printed."""
    code, out, err = run(capsys, *arguments, "--json")
    assert err == ""
    return code, json.loads(out)


@pytest.mark.parametrize("name", NAMES)
def test_help_has_examples(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    code, out, _ = run(capsys, name, "--help")
    assert code == 0
    assert f"stiffmap {name}" in out
    assert "Examples" in out
    assert "Exit codes" in out or name == "show"
    assert "--json" in out


def test_map_writes_what_the_library_computes(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    code, data = run_json(capsys, "map", NAME, "--points", "3", "-o", str(tmp_path))
    assert code == 0
    assert data["failed"] == {}
    assert len(data["rows"]) == 3 * 4
    files = [Path(f) for f in data["files"]]
    pictures = [f"map-{name}.png" for name in ("worst", "best", "Fx", "Fy", "loaded")]
    assert [f.name for f in files] == ["map.nc", *pictures, "report.html"]
    assert all(f.read_bytes().startswith(PNG) for f in files[1:-1])
    report = files[-1].read_text(encoding="utf-8")
    assert report.count("<img") == len(pictures) and "worst pose" in report.lower() and "://" not in report
    x = np.linspace(-0.2, 0.3, 3)
    cases = {"Fx": [300.0, 0, 0, 0, 0, 0], "Fy": [0, 300.0, 0, 0, 0, 0]}
    same = sm.error_map(sm.load_machine(NAME), x=x, y=x, z=[-0.2, 0, 0.3], wrench=cases)
    with xr.open_dataset(files[0]) as ds:
        assert ds.load().identical(same)
    worst = [r for r in data["rows"] if r["force"] == "worst"]
    assert [r["max"] for r in worst] == [
        float(same.worst_deflection_xy.sel(z=z).max()) for z in (-0.2, 0, 0.3)
    ]


def test_map_table_and_failed_poses(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    code, out, _ = run(
        capsys,
        "map",
        NAME,
        "--points",
        "2",
        "--force",
        "20000",
        "-o",
        str(tmp_path),
        "--no-pictures",
        "--z",
        "0",
    )
    assert code == 1
    assert "UNSTABLE" in out
    assert "within 0.25 mm" in out
    code, out, _ = run(capsys, "map", NAME, "--points", "2", "--z", "0", "--no-pictures", "-o", str(tmp_path))
    assert code == 0
    assert "worst direction" in out


def test_map_as_zarr(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    pytest.importorskip("zarr")
    code, data = run_json(
        capsys, "map", NAME, "--points", "2", "--z", "0", "--zarr", "--no-pictures", "-o", str(tmp_path)
    )
    assert code == 0
    assert xr.open_zarr(data["files"][0], consolidated=False).deflection.shape == (1, 2, 2, 2)


def test_polar(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    code, data = run_json(
        capsys,
        "polar",
        NAME,
        "--at",
        "-200,-200,-200",
        "--at",
        "0,0,0",
        "--directions",
        "8",
        "-o",
        str(tmp_path),
    )
    assert code == 0
    first = data["diagrams"][0]
    assert first["position"] == [-0.2, -0.2, -0.2]
    assert np.rad2deg(first["worst_direction_xy"]) % 180 == pytest.approx(45, abs=0.1)
    assert sorted(p.name for p in tmp_path.iterdir()) == [
        "ellipses.png",
        "polar-1.nc",
        "polar-2.nc",
        "polar.png",
    ]
    code, out, _ = run(capsys, "polar", NAME, "--directions", "8")
    assert code == 0
    assert "worst/best" in out


def test_sweep_names_unstable_equilibria(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    code, out, _ = run(capsys, "sweep", NAME, "--to", "6000", "--points", "3", "-o", str(tmp_path))
    assert code == 1
    assert "unstable" in out
    assert (tmp_path / "sweep.png").read_bytes().startswith(PNG)
    code, data = run_json(capsys, "sweep", NAME, "--to", "300", "--points", "2", "--direction", "0,2,0")
    assert code == 0
    assert data["direction"] == [0.0, 1.0, 0.0]
    assert data["force"] == [0.0, 300.0]


def test_solve(capsys: pytest.CaptureFixture[str]) -> None:
    code, data = run_json(
        capsys, "solve", NAME, "--at", "-200,-200,-200", "--force", "300,0,0", "--moment", "0,1000,0"
    )
    assert code == 0
    assert data["wrench"] == [300.0, 0, 0, 0, 1.0, 0]
    s = sm.load_machine(NAME).solve([-0.2, -0.2, -0.2], [300.0, 0, 0, 0, 1.0, 0])
    assert data["displacement"] == s.displacement.tolist()
    code, out, _ = run(capsys, "solve", NAME, "--force", "300,0,0")
    assert code == 0
    assert "mm" in out
    assert "status converged" in out


def test_solve_unreachable(capsys: pytest.CaptureFixture[str]) -> None:
    code, data = run_json(capsys, "solve", NAME, "--at", "5000,0,0")
    assert code == 1
    assert data["status"] == "UNREACHABLE"
    assert data["displacement"] == [None] * 6


@pytest.mark.parametrize(("name", "freedom", "over"), [("orthoglide-revised", 3, 12), ("tripteron", 3, 3)])
def test_show(name: str, freedom: int, over: int, capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    picture = tmp_path / "m.png"
    code, data = run_json(capsys, "show", name, "-o", str(picture))
    assert code == 0
    assert data["platform_freedom"] == data["degrees_of_freedom"] == freedom
    assert data["over_constraint"] == over
    assert data["free_spins"] == []
    assert picture.read_bytes().startswith(PNG)
    code, out, _ = run(capsys, "show", name, "--no-picture")
    assert code == 0
    assert f"over-constraint: {over}" in out


def test_paper(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    code, data = run_json(capsys, "paper", "--points", "3", "-o", str(tmp_path))
    assert code == 0
    assert sum(data["count"].values()) == len(data["statements"]) > 25
    names = {p.name for p in tmp_path.iterdir()}
    assert names == {"figure5.png", "figure6.png", "figure7-worst.png", "figure7-best.png", "figure7-Fx.png",
                     "figure7-Fy.png", "statements.csv", "statements.md"}  # fmt: skip


BAD = [
    (("map", "nope"), "unknown machine 'nope'"),
    (("map", NAME, "--points", "0"), "points: expected 1 or more, got 0"),
    (("map", NAME, "--force", "-1"), "a size is a positive number"),
    (("map", NAME, "-o", "/dev/null/x"), "cannot be written"),
    (("map", NAME, "--z", "nan"), "z: expected finite numbers"),
    (("polar", NAME, "--at", "0,0"), "--at: expected 3 numbers"),
    (("polar", NAME, "--plane", "ab"), "plane: expected one of"),
    (("sweep", NAME, "--direction", "0,0,0"), "direction: expected one vector"),
    (("sweep", NAME, "--tolerance", "nan"), "--tolerance: expected a positive number (mm), got nan"),
    (
        ("plan", NAME, "--identify", "length bar error=1mm", "--until", "-0.1"),
        "until: expected a positive number",
    ),
    (("sweep", NAME, "--points", "0"), "forces: expected at least one number"),
    (("solve", NAME, "--force", "a,b,c"), "--force: expected numbers"),
    (("solve", NAME, "--at", "nan,0,0"), "--at: expected finite numbers"),
    (("solve", NAME, "--point", "nose"), "point: expected one of"),
    (("solve", NAME, "--method", "slow"), "method: expected"),
    (("show", NAME, "--at", "5000,0,0"), "cannot take this pose: unreachable"),
    (("show", NAME, "-o", "/dev/null/x.png"), "cannot be written"),
    (("paper", "--points", "2", "-o", "/dev/null/x"), "cannot be written"),
]


@pytest.mark.parametrize(("arguments", "message"), BAD, ids=[" ".join(a) for a, _ in BAD])
def test_bad_input_is_one_line(
    arguments: tuple[str, ...], message: str, capsys: pytest.CaptureFixture[str], tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    monkeypatch.chdir(tmp_path)
    code, out, err = run(capsys, *arguments)
    assert code == 2
    assert out == ""
    assert err.count("\n") == 1
    assert message in err


def test_solving_does_not_import_matplotlib_and_no_picture_pyplot() -> None:
    script = (
        "import sys; from stiffmap.ui.cli import main; main(['solve', 'five-bar', '--json']); "
        "main(['polar', 'five-bar', '--directions', '4', '--json']); assert not {'matplotlib', 'scipy.stats'} & {*sys.modules}; "
        "from stiffmap import plot; plot.machine_figure; sys.exit('matplotlib.pyplot' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", script], capture_output=True, check=False).returncode == 0


@pytest.mark.parametrize("command", ["map", "polar", "sweep", "solve"])
def test_effects_reach_the_machine(
    command: str, capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    options = {
        "map": ["--points", "2", "--z", "0", "--no-pictures"],
        "polar": ["--directions", "4"],
        "sweep": ["--points", "2"],
        "solve": ["--force", "0,300,0"],
    }[command]
    _, plain = run_json(capsys, command, NAME, *options)
    code, softer = run_json(capsys, command, NAME, *options, "--effect", "compliance actuator scale=3")
    assert code == 0
    assert softer != plain
    code, _, err = run(capsys, command, NAME, *options, "--effect", "rust actuator y")
    assert code == 2
    assert err.count("\n") == 1


def test_python_maps_the_positions_of_the_command(tmp_path: Path) -> None:
    load = ["--force", "100,0,0", "--z", "0", "--points", "5", "--no-pictures"]
    assert main(["map", "orthoglide-revised", *load, "-o", str(tmp_path), "--json"]) == 0
    ds = sm.error_map("orthoglide-revised", z=[0.0], points=5, wrench=[100, 0, 0, 0, 0, 0])
    with xr.open_dataset(tmp_path / "map.nc") as written:
        np.testing.assert_array_equal(written.deflection.values.ravel(), ds.deflection.values.ravel())
