"""The scoreboard: its page is made from its rows, and sets that are absent or fail are rows as well."""

from __future__ import annotations

import json
import runpy
import sys
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parents[3]
SCRIPT = ROOT / "bench/scoreboard.py"
COLUMNS = {"set", "authors", "before", "after", "unseen_rows", "cause", "seconds"}


class Run:
    """A script of bench in this process: exit code, and what it said of errors."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
        self.monkeypatch, self.capsys = monkeypatch, capsys
        monkeypatch.setattr("sys.path", [*sys.path])

    def __call__(self, *arguments: str | Path, script: Path = SCRIPT) -> tuple[object, str]:
        self.monkeypatch.setattr("sys.argv", [str(script), *map(str, arguments)])
        code: object = 0
        try:
            runpy.run_path(str(script), run_name="__main__")
        except SystemExit as end:
            code = end.code
        return code, self.capsys.readouterr().err


@pytest.fixture
def run(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Run:
    return Run(monkeypatch, capsys)


def test_the_page_of_the_documentation_is_made_from_its_rows(run: Run, tmp_path: Path) -> None:
    kept = ROOT / "docs/scoreboard.json"
    assert run("--out", tmp_path / "board.md", "--page-of", kept)[0] == 0
    assert (tmp_path / "board.md").read_text() == (ROOT / "docs/scoreboard.md").read_text()
    rows = json.loads(kept.read_text())["rows"]
    assert all(set(r) >= COLUMNS for r in rows)
    assert all(r["unseen_rows"] for r in rows if r["status"] == "measured")


def test_speed_is_a_table_of_ratios(run: Run, tmp_path: Path) -> None:
    data = json.loads((ROOT / "docs/scoreboard.json").read_text())
    case = {"case": "a case", "note": ""}
    data["speed"] = [
        {**case, "package": "stiffmap", "microseconds": 2.0},
        {**case, "package": "by hand", "microseconds": 25.0},
        {**case, "package": "other", "microseconds": None, "note": "not here"},
    ]
    (tmp_path / "rows.json").write_text(json.dumps(data))
    assert run("--out", tmp_path / "board.md", "--page-of", tmp_path / "rows.json")[0] == 0
    page = (tmp_path / "board.md").read_text()
    assert "| a case | by hand | 25 | 12.5 |  |" in page
    assert "| a case | other | – |  | not here |" in page


def test_absent_and_damaged_sets_are_rows(run: Run, tmp_path: Path) -> None:
    (tmp_path / "data/ur5_tracker").mkdir(parents=True)
    (tmp_path / "data/a_new_set").mkdir()
    code, said_on_the_way = run("--out", tmp_path / "board.html", "--data", tmp_path / "data")
    assert code == 0, said_on_the_way
    rows: list[dict[str, Any]] = json.loads((tmp_path / "board.json").read_text())["rows"]
    said = {r["set"]: (r["status"], r["note"]) for r in rows}
    assert said["UR5, laser tracker"][0] == "failed"
    assert "grid.csv" in said["UR5, laser tracker"][1]
    status, note = said["UR10, laser tracker"]
    assert status == "absent" and "ipa_ur10_accuracy" in note and "bench/convert_set.py" in note
    assert "github.com/christianlandgraf/ipa-robot-accuracy@507fba6, MIT" in note and note in said_on_the_way
    assert said["a_new_set"] == ("absent", "no reader for this set yet")
    page = (tmp_path / "board.html").read_text()
    assert all(r["set"] in page and r["note"].split(":")[0] in page for r in rows)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--out", "x.txt"], "expected a name that ends in .md or .html"),
        (["--out", "x.md", "--peer", "figaroh"], "expected NAME=PYTHON"),
        (["--out", "x.md", "--only", "nothing"], "expected one of ur5_tracker"),
        (["--out", "x.md", "--page-of", "gone.json"], "gone.json"),
    ],
)
def test_bad_arguments(run: Run, arguments: list[str], words: str) -> None:
    code, errors = run(*arguments)
    assert code not in (0, None)  # a number, or the text that Python prints
    assert words in f"{errors}{code}"


def test_plain_least_squares_finds_a_known_arm() -> None:
    """The peer that costs nothing: an arm with errors is found from its places, to round-off."""
    import numpy as np

    sys.path.insert(0, str(ROOT / "bench/peers"))
    try:
        import arm_least_squares as plain
    finally:
        sys.path.pop(0)
    rng = np.random.default_rng(0)
    q = rng.uniform(-2, 2, (120, 6))
    model = np.eye(3)[[2, 1, 1, 1, 2, 1]], rng.normal(size=(6, 3)), rng.normal(size=3)
    seen = plain.places(1e-3 * rng.normal(size=45), q, *model)
    x = plain.fitted(q[:90], seen[:90], *model)
    assert np.abs(plain.places(x, q[90:], *model) - seen[90:]).max() < 1e-12
    assert np.abs(plain.places(0 * x, q, *model) - seen).max() > 1e-2


def test_authors_tables_become_sets(run: Run, tmp_path: Path) -> None:
    """Small tables of the authors' form; what cannot be found is one line."""
    clone, data = tmp_path / "clone", tmp_path / "data"
    for series, name in (("B", "joint_configurations"), ("C", "random_poses"), ("D", "iso_cubes")):
        (clone / f"Series_{series}").mkdir(parents=True)
        cells = ";".join(["2,02103E+13", *(f"{k},5" for k in range(25))])
        head = ";".join(["Timestamp", *"abcdefghijklmnopqrstuvwxy"])
        (clone / f"Series_{series}/measurements_{name}.csv").write_text(f"{head}\n{cells}\n")
    for socket in "01":
        for robot in ("panda_2", "panda_6", "panda_7"):
            (clone / f"data/{robot}/front").mkdir(parents=True, exist_ok=True)
            (clone / f"data/{robot}/front/hole_{socket}.csv").write_text("1,2,3,4,5,6,7\n")
    for name in ("grid", "random"):
        (clone / f"3D_UR5_uncalibrated_{name}_cleaned.csv").write_text(f"{name}\n")

    def convert(name: str, folder: Path) -> tuple[object, str]:
        return run(name, folder, "--data", data, script=ROOT / "bench/convert_set.py")

    for name in ("ur5_tracker", "ipa_ur10_accuracy", "ball_in_socket"):
        assert convert(name, clone)[0] == 0
    columns, values = (
        line.split(",") for line in (data / "ipa_ur10_accuracy/series_D.csv").read_text().splitlines()
    )
    made = dict(zip(columns, values, strict=True))
    assert [made[k] for k in ("index", "goal_x_m", "q1_rad", "temperature_C", "meas_x_mm", "meas_std_rz_deg")] == [
        "0", "0.5", "6.5", "12.5", "13.5", "24.5"
    ]  # fmt: skip
    assert (data / "ball_in_socket/panda_6.csv").read_text().splitlines()[2] == "front,1,1,2,3,4,5,6,7"
    assert (data / "ur5_tracker/random.csv").read_text() == "random\n"
    code, errors = convert("ipa_ur10_accuracy", tmp_path)
    assert code == 2 and "measurements_joint_configurations.csv" in errors


def test_pages_of_measured_machines_name_public_places_only() -> None:
    for page in (ROOT / "docs").glob("measured_*.md"):
        text = page.read_text(encoding="utf-8")
        assert "../" not in text.replace("](../examples/", "") and "scoreboard.md#repeat-it" in text, (
            page.name
        )
