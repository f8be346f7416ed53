"""The blocks of code on a page: Python, and commands of a terminal."""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
import textwrap
from contextlib import chdir, redirect_stderr, redirect_stdout
from dataclasses import dataclass
from io import StringIO
from pathlib import Path
from typing import Any

from stiffmap.ui.cli import main

FENCE = re.compile(r"^([ >]*)```(\w*)\n(.*?)^\1```", re.DOTALL | re.MULTILINE)
SHELL = ("sh", "bash", "console", "")
INSTALL = re.compile(r"-m venv|pip install|activate|\./(?:test|install)\.sh|^git |apt ")
"""Commands that install or test stiffmap itself: `.ci/run` is what runs these."""


@dataclass(frozen=True)
class Block:
    """One block; `code` is Python, or lines of a shell."""

    language: str
    code: str
    line: int


def blocks(page: Path) -> list[Block]:
    """The blocks of a page that can be run, in order."""
    text, out = page.read_text(encoding="utf-8"), []
    for match in FENCE.finditer(text):
        code = textwrap.dedent(match[3])
        line = text[: match.start()].count("\n") + 1
        if match[2] == "python":
            out.append(Block("python", code, line))
        elif match[2] in SHELL and commands(code):
            out.append(Block("shell", code, line))
    return out


def commands(code: str) -> list[str]:
    """Command lines of a block: those after a prompt, else all that start with a command of ours."""
    lines = code.replace("\\\n", " ").splitlines()
    prompted = [line[2:] for line in lines if line.startswith("$ ")]
    starts = ("stiffmap ", "cd ", "python", ".venv/", "./", "cat ", "cp ", "mkdir ")
    return prompted or [line for line in lines if line.startswith(starts)]


def own_part(command: str) -> str:
    """A command without the parts that install; empty where nothing is left."""
    parts = [part.strip() for part in command.replace(".venv/bin/", "").split("&&")]
    return " && ".join(part for part in parts if not INSTALL.search(part))


class Reader:
    """Somebody who follows a page from top to bottom in one folder."""

    def __init__(self, folder: Path, given: dict[str, Any]) -> None:
        self.folder, self.space = folder, dict(given)

    def follow(self, block: Block) -> None:
        """Run one block; fails with what the terminal said."""
        if block.language == "python":
            exec(compile(block.code, f"line {block.line}", "exec"), self.space)
            return
        for command in filter(None, map(own_part, commands(block.code))):
            if command.startswith("cd "):
                self.folder = self.folder / command[3:].split("#")[0].strip()
            else:
                self.run(command)

    def run(self, command: str) -> None:
        """One command line; a judgement (exit code 1) is an answer, a bad command (2) or a traceback is not."""
        words = shlex.split(command, comments=True)
        if words[0] == "stiffmap":
            said = StringIO()
            with chdir(self.folder), redirect_stdout(StringIO()), redirect_stderr(said):
                code = main(words[1:])
            assert code in (0, 1) and "Traceback" not in said.getvalue(), (
                f"{command}\n{said.getvalue()[-2000:]}"
            )
            return
        bin_folder = shlex.quote(str(Path(sys.executable).parent))
        done = subprocess.run(
            ["bash", "-c", f"export PATH={bin_folder}:$PATH MPLBACKEND=Agg\n{command}"],
            cwd=self.folder,
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode in (0, 1) and "Traceback" not in done.stderr, (
            f"{command}\n{done.stderr[-2000:]}"
        )
