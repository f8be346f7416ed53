"""Makes `measured` importable from the tests beside it."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

import stiffmap as sm

sys.path.insert(0, str(Path(__file__).parent))


@pytest.fixture(scope="session")
def orthoglide() -> sm.Machine:
    return sm.load_machine("orthoglide-revised")


@pytest.fixture(scope="session")
def tripteron() -> sm.Machine:
    return sm.load_machine("tripteron")
