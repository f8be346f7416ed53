"""Makes the helpers beside the tests importable; shipped machines loaded once."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

import stiffmap as sm

sys.path.insert(0, str(Path(__file__).parent))

SHIPPED = ("orthoglide-revised", "orthoglide-original", "tripteron")


@pytest.fixture(scope="session")
def orthoglide() -> sm.Machine:
    return sm.load_machine("orthoglide-revised")


@pytest.fixture(scope="session")
def tripteron() -> sm.Machine:
    return sm.load_machine("tripteron")


@pytest.fixture(scope="session", params=SHIPPED)
def shipped(request: pytest.FixtureRequest) -> sm.Machine:
    return sm.load_machine(request.param)
