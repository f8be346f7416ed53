"""Commands on full disks, two at once, and killed in the middle: the old output stays, or the new one is whole."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from pathlib import Path
from threading import Thread

import numpy as np
import pytest

import stiffmap as sm
from stiffmap.common.errors import FileError
from stiffmap.common.outputs import one_command, reserved, write_text
from stiffmap.experiment import load_experiment
from stiffmap.ui.cli import main
from stiffmap.workspace.maps import grid_map
from stiffmap.workspace.maps.store import Store

ROOT = Path(__file__).parents[4]
DATA = ROOT / "tests/data/experiments/C-backlash"
GRID = {"x": np.linspace(-0.1, 0.1, 5), "y": np.linspace(-0.1, 0.1, 7), "z": [0.0]}
CALL = {**GRID, "wrench": [300.0, 0, 0, 0, 0, 0], "plane": None}


def command(
    arguments: list[str], folder: Path, *, size: float | None = None, stdout: int | None = subprocess.PIPE
) -> subprocess.CompletedProcess[str]:
    """A command in a process of its own that may write files of at most `size` bytes."""
    limit = f"resource.setrlimit(resource.RLIMIT_FSIZE, ({int(size)},) * 2)" if size else ""
    code = f"import resource, sys; {limit}\nfrom stiffmap.ui.cli import main; sys.exit(main(sys.argv[1:]))"
    return subprocess.run([sys.executable, "-B", "-c", code, *arguments], cwd=folder, check=False,
                          stdout=stdout, stderr=subprocess.PIPE, text=True)  # fmt: skip


def earlier(path: Path) -> None:
    """What an earlier command wrote there: only that may be replaced."""
    path.parent.mkdir()
    with one_command():
        write_text(path, "old")


def sheet(path: Path, rows: int) -> Path:
    """Readings of a five-bar."""
    text = "".join(f"r{i},{100 + i % 7},{200 + i % 5},0,10,0,0,{i % 3}\n" for i in range(rows))
    path.write_text(f"id,x [mm],y [mm],z [mm],fx [N],fy [N],fz [N],dx [um]\n{text}")
    return path


def test_two_maps_on_one_netcdf_file_never_mix(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    machine, seen = sm.load_machine("orthoglide-revised"), []
    put = Store.put

    def second(self: Store, rows: slice, block: dict[str, object]) -> None:
        def job() -> None:
            try:
                sm.error_map(machine, **{**CALL, "wrench": [1.0, 0, 0, 0, 0, 0]}, out=tmp_path / "m.nc")
            except FileError as error:
                seen.append(error.reason)

        thread = Thread(target=job)
        thread.start()
        thread.join()
        put(self, rows, block)

    monkeypatch.setattr(grid_map.Store, "put", second)
    ds = sm.error_map(machine, **CALL, out=tmp_path / "m.nc")
    assert set(seen) == {"is being written by another job"}
    np.testing.assert_array_equal(ds.displacement, sm.error_map(machine, **CALL).displacement)
    ds.close()
    assert [p.name for p in tmp_path.iterdir()] == ["m.nc"]


@pytest.mark.parametrize("size", [2e3, 12e3])
def test_a_map_on_a_full_disk_is_one_message(size: float, tmp_path: Path) -> None:
    """The first limit stops the arrays in which the map grows, the second one the NetCDF file."""
    earlier(tmp_path / "out/map.nc")
    done = command(
        ["map", "orthoglide-revised", "--points", "5", "--z", "0", "-o", "out"],
        tmp_path,
        size=size,
    )
    assert done.returncode == 2, done.stderr
    (line,) = done.stderr.splitlines()
    assert line.startswith("stiffmap: out/map.nc: cannot be written: ")
    assert (tmp_path / "out/map.nc").read_text() == "old"


def test_a_command_that_is_not_alone_says_so_before_it_computes(tmp_path: Path) -> None:
    with reserved(tmp_path / "out"):
        started = time.process_time()
        done = command(["diagnose", "five-bar", "nowhere", "-o", "out"], tmp_path)
        assert (done.returncode, done.stderr) == (2, "stiffmap: out: is being written by another job\n")
    assert time.process_time() - started < 60
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", ["diagnose", "calibrate", "residual"])
def test_results_on_a_full_disk_keep_the_previous_ones(name: str, tmp_path: Path) -> None:
    file = {"diagnose": "diagnosis.json", "calibrate": "calibration.json", "residual": "residual.csv"}[name]
    earlier(tmp_path / "out" / file)
    machine = load_experiment(DATA).machine
    budget = [] if name == "residual" else ["--budget", "1"]
    done = command([name, machine, str(DATA), "-o", "out", *budget], tmp_path, size=400)
    assert done.returncode == 2
    assert f"stiffmap: out/{file}: cannot be written: File too large" in done.stderr
    left = {p.name: p.read_text() for p in (tmp_path / "out").iterdir()}
    assert left == {file: "old"}


def test_a_data_set_that_was_cut_off_is_refused(tmp_path: Path) -> None:
    args = [
        "experiment",
        "new",
        str(sheet(tmp_path / "a.csv", 50)),
        "--machine",
        "five-bar",
        "-o",
        str(tmp_path / "e"),
    ]
    assert main(args) == 0
    data = tmp_path / "e/data.csv"
    whole = data.read_bytes()
    assert len(load_experiment(tmp_path / "e")) == 50
    lines = whole.splitlines(keepends=True)
    for cut, words in (
        (b"".join(lines[:40]), "expected 50 rows.*found 39"),
        (whole[:-3], "no end of the last line"),
    ):
        data.write_bytes(cut)
        with pytest.raises(FileError, match=words):
            load_experiment(tmp_path / "e")
    experiment = load_experiment(DATA)
    from stiffmap.experiment.files.save import save_experiment

    save_experiment(experiment, tmp_path / "saved")
    (tmp_path / "saved/data.csv").write_bytes(
        b"".join((tmp_path / "saved/data.csv").read_bytes().splitlines(True)[:-1])
    )
    with pytest.raises(FileError, match="cut off"):
        load_experiment(tmp_path / "saved")


def test_killed_while_it_writes_a_data_set(tmp_path: Path) -> None:
    sheet(tmp_path / "a.csv", 30_000)
    args = ["experiment", "new", "a.csv", "--machine", "five-bar", "-o", "e"]
    code = "import sys; from stiffmap.ui.cli import main; sys.exit(main(sys.argv[1:]))"
    with subprocess.Popen(
        [sys.executable, "-c", code, *args], cwd=tmp_path, stdout=subprocess.DEVNULL
    ) as job:
        while job.poll() is None and not any(tmp_path.glob(".e.new/.data.csv.writing*")):
            time.sleep(0.001)
        job.send_signal(signal.SIGKILL)
    assert not (tmp_path / "e").exists()
    assert command(args, tmp_path).returncode == 0
    assert sorted(p.name for p in (tmp_path / "e").iterdir()) == ["data.csv", "experiment.yaml"]
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.csv", "e"]


def test_standard_output_on_a_full_disk_is_one_message(tmp_path: Path) -> None:
    with open("/dev/full", "w") as full:
        done = command(["machines", "--json"], tmp_path, stdout=full.fileno())
    assert done.returncode == 2
    assert done.stderr == "stiffmap: standard output: cannot be written: No space left on device\n"


def test_outputs_to_devices(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    done = command(["new", "--overwrite", "/dev/full"], tmp_path)
    assert (done.returncode, "/dev/full: cannot be written: No space left" in done.stderr) == (2, True)
    assert (
        json.loads(command(["new", "--overwrite", "--json", "/dev/null"], tmp_path).stdout)["file"]
        == "/dev/null"
    )
