"""The committed stub of the compiled core is the one that the core gives today."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import stiffmap

COMMITTED = Path(__file__).parents[3] / "python/stiffmap/_core.pyi"


def test_stub_is_current(tmp_path: Path) -> None:
    """Renew it by: python -m pybind11_stubgen stiffmap._core -o python"""
    command = [sys.executable, "-m", "pybind11_stubgen", "stiffmap._core", "-o", str(tmp_path)]
    subprocess.run(command, check=True, capture_output=True, text=True)
    assert (tmp_path / "stiffmap/_core.pyi").read_text() == COMMITTED.read_text()


def test_stub_is_shipped() -> None:
    package = Path(stiffmap.__file__).parent
    assert (package / "_core.pyi").is_file() and (package / "py.typed").is_file()
