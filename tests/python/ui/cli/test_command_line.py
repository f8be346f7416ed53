"""One meaning of an option in every command, and vectors as people type them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import stiffmap as sm
from stiffmap.ui.cli import main
from stiffmap.ui.cli.app import joined

NAME = "orthoglide-revised"


def run_json(capsys: pytest.CaptureFixture[str], *arguments: str) -> Any:
    assert main([*arguments, "--json"]) in (0, 1)
    return json.loads(capsys.readouterr().out)


@pytest.mark.parametrize(
    ("typed", "read"),
    [
        (["--at", "-200", "-200", "-200"], ["--at=-200,-200,-200"]),
        (["--at", "-200,-200,-200", "--force", "300"], ["--at=-200,-200,-200", "--force=300"]),
        (["--force=1", "-2", "3", "-o", "x"], ["--force=1,-2,3", "-o", "x"]),
        (["--at", "1,", "2,", "3"], ["--at=1,2,3"]),
        (["--at", "--json"], ["--at", "--json"]),
        (["--at", "12m"], ["--at", "12m"]),
        (["--points", "3", "4"], ["--points", "3", "4"]),
    ],
)
def test_numbers_of_a_vector_are_drawn_together(typed: list[str], read: list[str]) -> None:
    assert joined(typed) == read


def test_blanks_and_commas_are_the_same(capsys: pytest.CaptureFixture[str]) -> None:
    one = run_json(capsys, "solve", NAME, "--at", "-200", "-200", "-200", "--force", "300", "0", "0")
    other = run_json(capsys, "solve", NAME, "--at", "-200,-200,-200", "--force", "300,0,0")
    assert one == other
    assert one["displacement"][0] == pytest.approx(0.3934e-3, abs=1e-7)


def test_a_size_of_force_finds_the_worst_direction_in_space(capsys: pytest.CaptureFixture[str]) -> None:
    found = run_json(capsys, "solve", NAME, "--at", "-200,-200,-200", "--force", "300")
    assert np.linalg.norm(found["wrench"]) == pytest.approx(300)
    size = np.linalg.norm(found["displacement"][:3])
    machine = sm.load_machine(NAME)
    rng = np.random.default_rng(1)
    tried = rng.normal(size=(300, 3))
    tried = np.c_[300 * tried / np.linalg.norm(tried, axis=1, keepdims=True), np.zeros((300, 3))]
    brute = np.linalg.norm(machine.solve([-0.2] * 3, tried).displacement[:, :3], axis=1).max()
    assert brute <= size * (1 + 1e-12)
    assert brute > 0.98 * size


def test_map_and_polar_take_size_and_vector(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    common = ("--points", "3", "--z", "0", "--no-pictures", "-o", str(tmp_path))
    size = run_json(capsys, "map", NAME, "--force", "300", *common)
    vector = run_json(capsys, "map", NAME, "--force", "300,0,0", *common)
    rows = {r["force"]: r for r in size["rows"]}
    assert {r["force"]: r for r in vector["rows"]} == {
        "worst": rows["worst"],
        "best": rows["best"],
        "F": rows["Fx"] | {"force": "F"},
    }
    polar = run_json(capsys, "polar", NAME, "--force", "300,0,0", "--directions", "8")
    at_zero = polar["diagrams"][0]["displacement"][0]
    np.testing.assert_allclose(polar["displacement_under_the_vector"][0], at_zero, rtol=1e-12)


@pytest.mark.parametrize("text", ["12m", "1,2", "0", "-5", "300N"])
def test_a_wrong_force_is_one_line_without_metres(text: str, capsys: pytest.CaptureFixture[str]) -> None:
    for command in ("solve", "map", "polar"):
        assert main([command, NAME, f"--force={text}"]) == 2
        error = capsys.readouterr().err
        assert error.startswith("stiffmap: --force: ") and error.count("\n") == 1
        assert "such as 12m" not in error


def test_a_missing_unit_invites_micrometres(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["solve", NAME, "--effect", "dead_zone actuator y half_width=12"]) == 2
    assert "write 12um or 12mm" in capsys.readouterr().err


def test_new_and_import_overwrite_only_when_told(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    file = str(tmp_path / "m.yaml")
    assert main(["new", file]) == 0
    assert main(["new", file]) == 2
    assert "--overwrite" in capsys.readouterr().err
    assert main(["new", file, "--overwrite"]) == 0
    for command in ("new", "import"):
        main([command, "--help"])
        out = capsys.readouterr().out
        assert "--overwrite" in out and "--force" not in out


def test_the_starter_maps_fully(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    file = str(tmp_path / "starter.yaml")
    assert main(["new", file]) == 0
    capsys.readouterr()
    data = run_json(capsys, "map", file, "--points", "9", "--no-pictures", "-o", str(tmp_path))
    assert data["failed"] == {}
    assert {r["z"] for r in data["rows"]} == {0.0}
    low, high = sm.load_machine(file).workspace
    corners = [[x, y, 0.0] for x in (low[0], high[0]) for y in (low[1], high[1])]
    forces = [[300.0, 0, 0, 0, 0, 0], [0, -300.0, 0, 0, 0, 0]]
    s = sm.load_machine(file).solve(np.array(corners)[:, None], np.array(forces)[None])
    assert s.ok.all() and not s.flags.any()


def test_planar_machines_have_one_plane_and_lines_one_row(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    for name, sizes in {"five-bar": (3, 3, 1), "swing-table": (3, 1, 1), "3-rps": (1, 1, 3)}.items():
        data = run_json(capsys, "map", name, "--points", "3", "-o", str(tmp_path / name))
        assert data["failed"] == {}
        import xarray as xr

        with xr.open_dataset(tmp_path / name / "map.nc") as ds:
            assert (ds.sizes["x"], ds.sizes["y"], ds.sizes["z"]) == sizes
        assert (tmp_path / name / "map-worst.png").is_file()


def test_planes_across_another_axis(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    data = run_json(capsys, "map", NAME, "--y", "0", "--y", "100", "--plane", "xz", "--points", "4",
                    "--format", "svg,pdf", "-o", str(tmp_path))  # fmt: skip
    assert {r["y"] for r in data["rows"]} == {0.0, 0.1}
    endings = {Path(f).suffix for f in data["files"]}
    assert endings == {".nc", ".html", ".svg", ".pdf"}
    assert main(["map", NAME, "--y", "0", "--z", "0"]) == 2
    assert "planes across one axis" in capsys.readouterr().err
    assert main(["map", NAME, "--format", "gif"]) == 2
    assert "--format: expected png, svg, pdf" in capsys.readouterr().err


def test_a_table_is_whole_on_80_columns(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    assert (
        main(["measures", "five-bar", "--only", "transmission_min,transmission_max,velocity", "--nodes", "5"])
        == 0
    )
    rows = [line for line in capsys.readouterr().out.splitlines()[1:] if line.startswith(" ")]
    assert not any("…" in row for row in rows)
    assert {row.split()[0] for row in rows if row.strip()} >= {
        "transmission_min",
        "transmission_max",
        "velocity",
    }
    assert max(map(len, rows)) <= 80


@pytest.mark.parametrize(
    ("machine", "at", "shown"),
    [
        ("five-bar", "0,400", "at (0, 400, 0) mm; not commanded: z"),
        ("five-bar", "0,400,0", "at (0, 400, 0) mm; not commanded: z"),
        ("3-rps", "600", "at (0, 0, 600) mm; not commanded: x, y"),
        ("orthoglide-revised", "1,2,3", "at (1, 2, 3) mm\n"),
    ],
)
def test_a_pose_is_given_in_what_the_machine_commands(
    machine: str, at: str, shown: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["solve", machine, "--at", at]) == 0
    assert shown in capsys.readouterr().out


@pytest.mark.parametrize("command", ["solve", "polar", "show", "stress"])
@pytest.mark.parametrize(
    ("machine", "at", "words"),
    [
        (
            "five-bar",
            "0,400,50",
            "five-bar does not command z, which is 0 mm at home; got 50 (commanded: x, y)",
        ),
        ("3-rps", "5,0,600", "3-rps does not command x, which is 0 mm at home; got 5"),
        ("five-bar", "400", "--at: expected 3 numbers separated by commas, got '400'"),
        ("orthoglide-revised", "0,400", "--at: expected 3 numbers separated by commas, got '0,400'"),
    ],
)
def test_another_value_of_what_is_not_commanded_is_refused(
    command: str, machine: str, at: str, words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([command, machine, "--at", at]) == 2
    assert words in " ".join(capsys.readouterr().err.split())
