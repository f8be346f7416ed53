"""Machines and maps that several tests use."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

import stiffmap as sm

BOX = np.array([-0.2, 0.05, 0.3])
CASES = {"Fx": [300.0, 0, 0, 0, 0, 0], "Fy": [0, 300.0, 0, 0, 0, 0]}


@pytest.fixture(scope="session")
def machine() -> sm.Machine:
    return sm.load_machine("orthoglide-revised")


@pytest.fixture(scope="session")
def ds(machine: sm.Machine) -> xr.Dataset:
    return sm.error_map(machine, x=BOX, y=BOX, z=[-0.2, 0.3], wrench=CASES, compliance=True, threads=1)


@pytest.fixture(scope="session")
def positions(ds: xr.Dataset) -> np.ndarray:
    z, y, x = np.meshgrid(ds.z, ds.y, ds.x, indexing="ij")
    return np.stack([x, y, z], axis=-1)
