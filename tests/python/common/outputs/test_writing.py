"""An output is whole or not there: full disks, killed jobs, links, devices."""

from __future__ import annotations

import contextlib
import errno
import os
import signal
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest

from stiffmap.common.errors import FileError
from stiffmap.common.outputs import add_lines, mapped_array, needs_space, put_folder, write_text, writing
from stiffmap.experiment import load_experiment, save_experiment

DATA = Path(__file__).parents[4] / "tests/data/experiments/C-backlash"


def run(code: str, folder: Path, *, megabytes: float | None = None) -> subprocess.CompletedProcess[str]:
    """Python code in a process of its own, which may write files up to a size."""
    limit = (
        f"import resource; resource.setrlimit(resource.RLIMIT_FSIZE, (int({megabytes} * 1e6),) * 2)\n"
        if megabytes
        else ""
    )
    return subprocess.run(
        [sys.executable, "-B", "-c", limit + textwrap.dedent(code)],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
    )


def test_the_old_file_stays_until_the_new_one_is_whole(tmp_path: Path) -> None:
    target = write_text(tmp_path / "a.json", "old")

    def half() -> None:
        with writing(target) as fresh:
            assert fresh.parent == target.parent and fresh.suffix == ".json"
            fresh.write_text("half")
            assert target.read_text() == "old"
            raise RuntimeError

    with pytest.raises(RuntimeError):
        half()
    assert target.read_text() == "old"
    assert os.listdir(tmp_path) == ["a.json"]
    write_text(target, "new")
    assert target.read_text() == "new"
    assert os.listdir(tmp_path) == ["a.json"]


def test_a_full_disk_leaves_the_old_file(tmp_path: Path) -> None:
    (tmp_path / "a.json").write_text("old")
    done = run(
        "from stiffmap.common.outputs import write_text; write_text('a.json', 'x' * 100_000)",
        tmp_path,
        megabytes=0.05,
    )
    assert "FileError: a.json: cannot be written: File too large" in done.stderr
    assert {p.name: p.read_text() for p in tmp_path.iterdir()} == {"a.json": "old"}


def test_a_killed_job_leaves_the_old_file_and_the_next_one_clears_up(tmp_path: Path) -> None:
    target = write_text(tmp_path / "a.json", "old")
    done = run(
        """
        import os, signal
        from stiffmap.common.outputs import writing
        with writing("a.json") as fresh:
            fresh.write_text("half")
            os.kill(os.getpid(), signal.SIGKILL)
        """,
        tmp_path,
    )
    assert done.returncode == -signal.SIGKILL
    assert target.read_text() == "old"
    write_text(target, "new")
    assert [p.name for p in tmp_path.iterdir()] == ["a.json"]


def test_links_stay_and_devices_are_written_to(tmp_path: Path) -> None:
    real = write_text(tmp_path / "real.txt", "old")
    (tmp_path / "link.txt").symlink_to(real)
    write_text(tmp_path / "link.txt", "new")
    assert (tmp_path / "link.txt").is_symlink() and real.read_text() == "new"
    write_text("/dev/null", "nobody reads this")
    assert not Path("/dev/.null.lock").exists()
    with pytest.raises(FileError, match=f"/dev/full: cannot be written: {os.strerror(errno.ENOSPC)}"):
        write_text("/dev/full", "nobody reads this")


def test_the_mode_of_the_old_file_stays_and_a_new_one_has_the_usual_one(tmp_path: Path) -> None:
    old = os.umask(0o027)
    try:
        assert write_text(tmp_path / "new", "").stat().st_mode & 0o777 == 0o640
    finally:
        os.umask(old)
    target = tmp_path / "old"
    target.touch()
    target.chmod(0o604)
    assert write_text(target, "x").stat().st_mode & 0o777 == 0o604


def test_a_scratch_file_that_somebody_planted_is_not_followed(tmp_path: Path) -> None:
    victim = tmp_path / "victim"
    victim.write_text("precious")
    (tmp_path / ".a.json.writing.json").symlink_to(victim)
    write_text(tmp_path / "a.json", "new")
    assert victim.read_text() == "precious" and (tmp_path / "a.json").read_text() == "new"


def test_long_names(tmp_path: Path) -> None:
    name = "n" * 250 + ".csv"
    assert write_text(tmp_path / name, "x").read_text() == "x"
    with pytest.raises(FileError, match="File name too long"):
        write_text(tmp_path / ("n" * 300), "x")
    assert [p.name for p in tmp_path.iterdir()] == [name]


@pytest.mark.parametrize("place", ["missing/a.txt", "file/a.txt", ".", "folder"])
def test_what_cannot_be_written_has_a_name(place: str, tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    (tmp_path / "folder").mkdir()
    with pytest.raises(FileError, match="cannot be written"):
        write_text(tmp_path / place, "x")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["file", "folder"]


def test_a_folder_is_replaced_as_a_whole(tmp_path: Path) -> None:
    for name in ("old", "new"):
        (tmp_path / name).mkdir()
        (tmp_path / name / name).touch()
    put_folder(tmp_path / "new", tmp_path / "old")
    assert [p.name for p in tmp_path.rglob("*")] == ["old", "new"]


def test_lines_follow_a_line_that_was_cut(tmp_path: Path) -> None:
    path = tmp_path / "journal"
    add_lines(path, ["a", "b"])
    with path.open("a") as file:
        file.write("ha")
    add_lines(path, ["c"])
    assert path.read_text() == "a\nb\nha\nc\n"


def test_space_is_asked_for_before_it_is_used(tmp_path: Path) -> None:
    with pytest.raises(FileError, match=r"big.nc: cannot be written: the map needs 1e\+12 TB, .* are free"):
        needs_space(tmp_path / "big.nc", 1e24, "the map")
    needs_space(tmp_path / "missing" / "small.nc", 1, "the map")
    array = mapped_array(tmp_path / "a.npy", "f8", (1000, 1000))
    stat = (tmp_path / "a.npy").stat()
    assert 512 * stat.st_blocks >= stat.st_size >= array.nbytes  # no holes
    done = run("from pathlib import Path\nfrom stiffmap.common.outputs import mapped_array\n"
               "mapped_array(Path('b.npy'), 'f8', (1000, 1000))", tmp_path, megabytes=1)  # fmt: skip
    assert "File too large" in done.stderr and not (tmp_path / "b.npy").exists()


@pytest.mark.parametrize("killed_at", range(4))
def test_files_that_belong_together_never_mix(
    killed_at: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A kill before any of the renames: all old, all new, or without the file that says what they are."""
    old, new = load_experiment(DATA), load_experiment(DATA.with_name("A-servo"))
    save_experiment(old, tmp_path / "e")
    (tmp_path / "e/photo.jpg").write_text("mine")
    count = iter(range(10))
    replace = os.replace

    class Killed(BaseException):
        pass

    def rename(source: Path, target: Path) -> None:
        if Path(target).parent == tmp_path / "e" and next(count) == killed_at:
            raise Killed
        replace(source, target)

    monkeypatch.setattr(os, "replace", rename)
    with contextlib.suppress(Killed):
        save_experiment(new, tmp_path / "e")
    assert (tmp_path / "e/photo.jpg").read_text() == "mine"
    if killed_at < 2:
        with pytest.raises(FileError, match=r"experiment\.yaml"):
            load_experiment(tmp_path / "e")
    else:
        found = load_experiment(tmp_path / "e")
        assert len(found) == len(new) and found.machine == new.machine
