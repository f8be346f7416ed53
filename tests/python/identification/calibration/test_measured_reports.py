"""The reports on public data: said to be skipped without them; their models against closed forms."""

from __future__ import annotations

import subprocess
import sys
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

EXAMPLES = Path(__file__).parents[4] / "examples"
REPORTS = (
    "measured_delta_files",
    "measured_arm",
    "measured_ur5",
    "measured_actuator",
    "measured_actuator_files",
)


def loaded(name: str) -> ModuleType:
    spec = spec_from_file_location(name, EXAMPLES / f"{name}.py")
    assert spec is not None and spec.loader is not None
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("name", REPORTS)
def test_without_data_it_says_so(name: str, tmp_path: Path) -> None:
    command = [sys.executable, str(EXAMPLES / f"{name}.py"), str(tmp_path)]
    run = subprocess.run(command, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr
    assert run.stdout.startswith("skipped: no measured data")


def test_the_play_operator_remembers() -> None:
    actuator = loaded("measured_actuator")
    up = np.linspace(0, 10, 101)
    path = np.concatenate([up, up[::-1]])
    out = actuator.operator(path, 2.0)
    assert out[100] == pytest.approx(8.0)  # behind by the half width
    assert out[100 + 30] == pytest.approx(8.0)  # on the way back it waits until 4 are used up
    assert out[-1] == pytest.approx(2.0)
