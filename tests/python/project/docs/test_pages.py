"""Every command block and every Python block of README and docs runs, in the order of its page."""

from __future__ import annotations

import importlib.util
import os
import re
import shutil
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.python.project.docs.blocks import Block, Reader, blocks, commands, own_part
from tests.python.project.docs.reader_files import ARM_DH, ROBOT, joint_table, link_arrays, link_tables

import stiffmap as sm

ROOT = Path(__file__).parents[4]
PAGES = {
    p.relative_to(ROOT).as_posix(): p for p in [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
}
WITH_CODE = {name: page for name, page in PAGES.items() if blocks(page)}
QUICK = ("docs/machine_files.md", "docs/machines.md", "docs/effects.md")
"""Pages for the fast lane; the others solve maps and diagnose."""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """What a reader has: a copy of the examples, and files of his own that a page names."""
    shutil.copytree(ROOT / "examples", tmp_path / "examples")
    sm.load_machine("tripteron").save(tmp_path / "my_machine.yaml")
    (tmp_path / "arm.urdf").write_text(ROBOT)
    (tmp_path / "poses.csv").write_text("x,y,z\n0,0,0\n100,-50,80\n")
    (tmp_path / "arm_dh.csv").write_text(ARM_DH)
    (tmp_path / "joints.csv").write_text(joint_table())
    shutil.copy(ROOT / "examples/link_bar.yaml", tmp_path / "bar.yaml")
    field, cases = link_tables()
    (tmp_path / "field.csv").write_text(field)
    (tmp_path / "cases.csv").write_text(cases)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def given(name: str) -> dict[str, Any]:
    """Variables that a page takes as given."""
    x = np.linspace(-0.1, 0.1, 3)
    some: dict[str, Any] = {"__name__": "page"}
    if name == "docs/effects.md":
        some |= {"poses": np.zeros((2, 3)), "wrench": np.array([300.0, 0, 0, 0, 0, 0])}
    if name == "docs/link.md":
        some |= link_arrays() | {"x": x, "y": x, "z": [0.0], "wrench": [300.0, 0, 0, 0, 0, 0]}
        some["machine"] = sm.load_machine(ROOT / "examples/orthoglide-links.yaml") if linked() else None
    return some


def linked() -> bool:
    """Whether the machine with a link file loads: the page makes that file by finite elements."""
    return (ROOT / "examples/bar-link.yaml").exists()


def cannot(block: Block) -> str:
    """Why a block does not run here; empty if it does."""
    if block.language == "shell" and any("bracket.step" in c for c in commands(block.code)):
        return "needs a part of the reader's"
    if re.search(r"\bmeasured/", block.code):
        return "needs data that are no part of stiffmap"
    if "fivebar.urdf" in block.code:
        return "tests/python/model/urdf runs it"
    if "skfem" in block.code or "bar.yaml" in block.code or "uncertainty=True" in block.code:
        return "" if importlib.util.find_spec("skfem") and linked() else "needs finite elements"
    return ""


@pytest.mark.parametrize(
    "name", [n if n in QUICK else pytest.param(n, marks=pytest.mark.slow) for n in WITH_CODE]
)
def test_page_runs(name: str, folder: Path) -> None:
    reader = Reader(folder, given(name))
    for text, stem in re.findall(
        r"```yaml\n(name: (\w+)\n.*?)```", WITH_CODE[name].read_text(encoding="utf-8"), re.DOTALL
    ):
        (folder / f"{stem}.yaml").write_text(text, encoding="utf-8")  # files that the page shows
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for block in blocks(WITH_CODE[name]):
            if not cannot(block):
                reader.follow(block)
    assert os.getcwd() == str(folder)


def test_most_blocks_run() -> None:
    """What is left out stays the exception."""
    every = [b for page in WITH_CODE.values() for b in blocks(page)]
    left = [b for b in every if cannot(b)]
    assert len(every) >= 20 and len(left) <= len(every) // 4, [(b.line, cannot(b)) for b in left]


def test_installing_is_left_to_the_test_command() -> None:
    assert own_part(
        "python3 -m venv .venv && .venv/bin/python -m pip install . && .venv/bin/stiffmap map a"
    ) == ("stiffmap map a")
    assert own_part("./test.sh") == own_part("./install.sh") == ""
