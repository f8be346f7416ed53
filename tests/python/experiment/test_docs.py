"""The example files of docs/experiments.md load, and are predicted."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import stiffmap as sm
from stiffmap.experiment import Predictor
from stiffmap.experiment.files.fields import MATRIX, TURNED2, known
from stiffmap.experiment.files.schema import ExperimentFile

PAGE = (Path(__file__).parents[3] / "docs" / "experiments.md").read_text(encoding="utf-8")
EXAMPLES = re.findall(r"```yaml\n([^`]*)```\n```csv\n([^`]*)```", PAGE)


@pytest.mark.parametrize("number", range(10))
def test_examples(number: int, tmp_path: Path) -> None:
    head, rows = EXAMPLES[number]
    (tmp_path / "experiment.yaml").write_text(head, encoding="utf-8")
    (tmp_path / "data.csv").write_text(rows, encoding="utf-8")
    e = sm.load_experiment(tmp_path)
    predictor = Predictor(sm.load_machine(e.machine), e)
    assert not predictor.experiment.out_of_reach
    assert np.isfinite(predictor()[predictor.experiment.read]).all()


def test_all_examples_are_tried() -> None:
    assert len(EXAMPLES) == 10


def test_every_key_and_column_is_explained() -> None:
    for key in ExperimentFile.model_fields:
        if key not in ("title", "data", "axes", "notes"):
            assert f"`{key}`" in PAGE or f"{key}:" in PAGE, key
    for column in known():
        if not column.startswith(("u_", *TURNED2, *MATRIX[2:])):
            assert re.search(rf"[` ]{column}[` ]", PAGE), column
