"""Shipped machines, loaded once."""

from __future__ import annotations

import pytest

import stiffmap as sm


@pytest.fixture(scope="session")
def orthoglide() -> sm.Machine:
    return sm.load_machine("orthoglide-revised")


@pytest.fixture(scope="session")
def tripteron() -> sm.Machine:
    return sm.load_machine("tripteron")
