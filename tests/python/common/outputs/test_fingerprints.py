"""A digest is the same for the same values, in every process, and another for any other."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from stiffmap.common.fingerprints import digest, named_files


@dataclass(frozen=True)
class Two:
    a: object
    b: object = None


DIFFERENT = [
    1, 1.0, True, "1", b"1", None, [1], [[1]], (1, 2), [2, 1], {"1": 1}, {1: "1"}, Two(1), Two(1, 1), Two(Two(1)), ["1", "1"], ["11"],
    np.zeros(2), np.zeros((2, 1)), np.zeros((1, 2)), np.zeros(2, np.float32), np.zeros(2, int), np.full(2, -0.0), np.nan,
]  # fmt: skip


def test_different_values_differ() -> None:
    long = [np.zeros(5000), np.r_[np.zeros(2500), 1e-300, np.zeros(2499)]]  # numpy prints both alike
    assert len({digest(v) for v in [*DIFFERENT, *long]}) == len(DIFFERENT) + 2
    assert digest(1, 2) != digest([1, 2]) != digest([[1], 2])


def test_the_same_in_every_process() -> None:
    code = (
        "from stiffmap.common.fingerprints import digest; print(digest({'a': [1.5, None]}, {'x', 'y', 'z'}))"
    )
    seen = {
        subprocess.run(
            [sys.executable, "-c", code],
            env={"PYTHONHASHSEED": s, "PYTHONPATH": ":".join(sys.path)},
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        for s in "12"
    }
    assert seen == {digest({"a": [1.5, None]}, {"z", "y", "x"}) + "\n"}


def test_files_that_data_names(tmp_path: Path) -> None:
    (tmp_path / "a.yaml").write_text("x")
    data = {"legs": [{"link": "a.yaml"}, "a.yaml", "missing.yaml", "n" * 5000, "a\0b", 3.0]}
    ((name, first),) = named_files(data, tmp_path)
    assert name == "a.yaml"
    (tmp_path / "a.yaml").write_text("y")
    assert named_files(data, tmp_path) != [(name, first)]


@pytest.mark.parametrize(
    "value", [np.arange(6.0).reshape(2, 3).T, np.asfortranarray(np.arange(6.0).reshape(3, 2))]
)
def test_memory_order_does_not_matter(value: np.ndarray) -> None:
    assert digest(value) == digest(np.ascontiguousarray(value))
