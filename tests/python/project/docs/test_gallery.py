"""The notebooks of the gallery: each runs, shows pictures, and says what it is."""

from __future__ import annotations

import importlib.util
import os
import subprocess
import sys
from pathlib import Path

import pytest

GALLERY = Path(__file__).parents[4] / "docs" / "gallery"
NAMES = sorted(p.stem for p in GALLERY.glob("*.py") if p.stem != "build")
QUICK = "where_from"


def test_the_page_lists_them() -> None:
    page = (GALLERY / "index.md").read_text(encoding="utf-8")
    assert all(f"]({name}.py)" in page for name in NAMES)
    assert len(NAMES) >= 4


@pytest.mark.parametrize("name", NAMES)
def test_it_runs_as_it_stands(name: str, tmp_path: Path) -> None:
    """As plain Python: its own assertions hold."""
    subprocess.run(
        [sys.executable, GALLERY / f"{name}.py"],
        check=True,
        cwd=tmp_path,
        env=os.environ | {"MPLBACKEND": "Agg"},
    )


def test_a_notebook_is_executed_with_its_pictures() -> None:
    for needed in ("jupytext", "nbclient", "ipykernel"):
        pytest.importorskip(needed)
    spec = importlib.util.spec_from_file_location("gallery_build", GALLERY / "build.py")
    assert spec is not None
    assert spec.loader is not None
    build = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(build)
    book = build.executed(GALLERY / f"{QUICK}.py")
    kinds = {k for cell in book.cells for o in cell.get("outputs", []) for k in o.get("data", {})}
    assert {"image/png", "text/html"} <= kinds
