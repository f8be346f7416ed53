"""Evaluations on disk belong to one design: whatever an answer depends on makes it another."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from stiffmap.common.errors import FileError
from stiffmap.workspace.design import load_design
from stiffmap.workspace.design.judging import Judged
from stiffmap.workspace.design.problem import DesignProblem
from stiffmap.workspace.design.search import Evaluations, fingerprint
from stiffmap.workspace.performance.requirements import Bound


@pytest.fixture
def design(tmp_path: Path) -> DesignProblem:
    path = tmp_path / "small.yaml"
    path.write_text(
        "name: small\nmachine: orthoglide-revised\nvariables: {carriage: {low: 1, high: 9}}\n"
        "numbers:\n  templates.leg.body[carriage].mass: carriage\nobjectives: [mass]\n",
        encoding="utf-8",
    )
    return load_design(path)


@pytest.mark.parametrize(
    "change",
    [
        {"box": (0.1, 0.1, 0.1)},
        {"plane": "xz"},
        {"force": 300.0},
        {"bounds": (("mass", Bound(None, 40.0)),)},
        {"clearance": 0.01},
        {"deflection": 1e-4},
    ],
    ids=lambda change: next(iter(change)),
)
def test_another_requirement_is_another_design(
    design: DesignProblem, tmp_path: Path, change: dict[str, Any]
) -> None:
    other = replace(design, requirements=replace(design.requirements, **change))
    assert fingerprint(other) != fingerprint(design) == fingerprint(replace(design))
    path = tmp_path / "evaluations.jsonl"
    x = np.array([[4.0]])
    Evaluations(design, path).add(x, [Judged(np.array([1.0]), np.zeros(0), {}, "")])
    assert Evaluations(design, path).missing(x) == []
    with pytest.raises(FileError, match="another design"):
        Evaluations(other, path)
