"""One job for one output, among threads, processes and commands."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from threading import Thread

import pytest

from stiffmap.common.errors import FileError
from stiffmap.common.outputs import only_job, reserved, write_text

HOLD = """
import sys
from stiffmap.common.outputs import reserved
with reserved(sys.argv[1]):
    print("held", flush=True)
    sys.stdin.read()
"""


def test_another_process_is_refused_until_the_first_has_ended(tmp_path: Path) -> None:
    target = write_text(tmp_path / "a.json", "old")
    with subprocess.Popen(
        [sys.executable, "-c", HOLD, str(target)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as other:
        assert other.stdout is not None
        assert other.stdout.readline() == "held\n"
        with pytest.raises(FileError, match=r"a\.json: is being written by another job"):
            write_text(target, "new")
        (tmp_path / "b.json").symlink_to(target)
        with pytest.raises(FileError, match="another job"):  # the same file by another name
            write_text(tmp_path / "b.json", "new")
        assert target.read_text() == "old"
        other.kill()
    write_text(target, "new")
    assert sorted(p.name for p in tmp_path.iterdir()) == [
        "a.json",
        "b.json",
    ]  # also the lock of the killed one


def test_another_thread_is_refused(tmp_path: Path) -> None:
    seen: list[str] = []

    def other() -> None:
        try:
            write_text(tmp_path / "a", "x")
        except FileError as error:
            seen.append(error.reason)

    with only_job(tmp_path / "a"):
        thread = Thread(target=other)
        thread.start()
        thread.join()
    assert seen == ["is being written by another job"]


def test_a_job_writes_what_it_holds_but_not_within_itself(tmp_path: Path) -> None:
    with reserved(tmp_path / "a"), only_job(tmp_path / "a"):
        write_text(tmp_path / "a", "x")
        with pytest.raises(FileError, match="another job"), only_job(tmp_path / "a"):
            pass
        assert sorted(p.name for p in tmp_path.iterdir()) == [".a.lock", "a"]
    assert [p.name for p in tmp_path.iterdir()] == ["a"]


def test_a_job_that_is_closed_late_takes_nothing_from_the_next(tmp_path: Path) -> None:
    """A command that failed is closed when its traceback is, perhaps in the midst of the next command."""
    first = only_job(tmp_path / "a")
    first.__enter__()
    with only_job(tmp_path / "b"):
        first.__exit__(None, None, None)
        write_text(tmp_path / "b", "still mine")
    with only_job(tmp_path / "a"):
        pass


def test_a_planted_link_is_not_followed(tmp_path: Path) -> None:
    victim = tmp_path / "victim"
    victim.write_text("precious")
    (tmp_path / ".a.lock").symlink_to(victim)
    with pytest.raises(FileError, match=r"its lock \.a\.lock is a symbolic link; delete that"):
        write_text(tmp_path / "a", "x")
    (tmp_path / ".b.lock").symlink_to(tmp_path / "nowhere")
    with pytest.raises(FileError, match="symbolic link"):
        write_text(tmp_path / "b", "x")
    assert victim.read_text() == "precious" and not (tmp_path / "nowhere").exists()


def test_a_folder_that_is_not_there_yet(tmp_path: Path) -> None:
    with reserved(tmp_path / "a" / "b"):
        assert [p.name for p in tmp_path.iterdir()] == [".a+b.lock"]
    assert list(tmp_path.iterdir()) == []
    (tmp_path / "file").touch()
    with pytest.raises(FileError, match="Not a directory"), reserved(tmp_path / "file" / "b"):
        pass
