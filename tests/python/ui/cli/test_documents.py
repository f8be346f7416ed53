"""The pages that show results: their code runs, their table is what the program prints."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from stiffmap.ui.cli.commands import COMMANDS
from stiffmap.ui.paper import all_statements, compute
from stiffmap.ui.paper.forces import force_statements, workspace_statements

DOCS = Path(__file__).parents[4] / "docs"


def test_the_tutorials_python_runs_and_prints_what_it_says(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    (code,) = re.findall(
        r"```python\n(.*?)```", (DOCS / "tutorial.md").read_text(encoding="utf-8"), re.DOTALL
    )
    said = [np.array(list(map(float, m.split()))) for m in re.findall(r"# \[(.*?)\] mm", code)]
    exec(compile(code, "tutorial", "exec"), {})
    printed = [
        np.array(list(map(float, m.split()))) for m in re.findall(r"\[(.*?)\]", capsys.readouterr().out)
    ]
    assert len(said) == len(printed) == 2
    for a, b in zip(said, printed, strict=True):
        np.testing.assert_allclose(b, a, atol=5e-4)
    assert (tmp_path / "map.png").exists()


def test_the_tutorials_commands_exist() -> None:
    text = (DOCS / "tutorial.md").read_text(encoding="utf-8")
    used = set(re.findall(r"^(?:\.venv/bin/)?stiffmap (\w+)", text, re.MULTILINE))
    assert {"map", "polar", "sweep", "solve", "show", "machines"} <= used
    assert used <= {c.name for c in COMMANDS}


def test_the_papers_page_holds_the_statements() -> None:
    page = (DOCS / "paper.md").read_text(encoding="utf-8")
    results = compute(5, progress=False)
    # Numbers that are extremes over the maps need the fine grid of the page.
    coarse = [*workspace_statements(results), *(s for s in force_statements(results) if "planes" in s.ours)]
    for s in all_statements(results):
        (row,) = [line for line in page.splitlines() if line.startswith(f"| {s.section} | {s.words} |")]
        cells = row.split(" | ")
        assert (cells[2], cells[4], cells[5]) == (s.printed, s.verdict, "yes" if s.own_input else "no")
        if s not in coarse:
            assert cells[3] == s.ours


def test_pictures_of_the_pages_are_there_and_small() -> None:
    for page in ("tutorial.md", "paper.md"):
        for name in re.findall(r"\]\((img/.*?)\)", (DOCS / page).read_text(encoding="utf-8")):
            assert 0 < (DOCS / name).stat().st_size < 150_000
