"""Twins made at the command line."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

import stiffmap as sm
from stiffmap.ui.cli.app import main

Twin = Callable[..., sm.Experiment]


@pytest.fixture(scope="session")
def orthoglide() -> sm.Machine:
    return sm.load_machine("orthoglide-revised")


@pytest.fixture
def twin(tmp_path: Path) -> Twin:
    """``stiffmap simulate`` of the arguments, read back."""

    def make(*arguments: str, machine: str = "orthoglide-revised", folder: str = "twin") -> sm.Experiment:
        assert main(["simulate", machine, "-o", str(tmp_path / folder), *arguments]) == 0
        return sm.load_experiment(tmp_path / folder)

    return make
