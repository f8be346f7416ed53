"""What a search asks the machine."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.python.experiment.prediction.test_history import ONE_JOINT, ramp_folder

import stiffmap as sm
from stiffmap.experiment import Predictor, load_experiment
from stiffmap.identification.candidates.sensitivity import plan_of
from stiffmap.identification.inference import columns, names
from stiffmap.identification.inference.chosen import Chosen


@pytest.mark.parametrize("kind", ["compliance", "hysteresis"])
def test_of_many_readings_those_in_use_are_predicted_as_among_all(
    kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What a drive remembers is of all rows before, those that are not in use among them."""
    (tmp_path / "gear.yaml").write_text(ONE_JOINT)
    machine, data = sm.load_machine(tmp_path / "gear.yaml"), load_experiment(ramp_folder(tmp_path / "ramps"))
    predictor = Predictor(machine, data)
    plan = plan_of(predictor)
    asked: dict[str, Any] = {}
    monkeypatch.setattr(columns, "MOST_READINGS", 37)
    monkeypatch.setattr(names, "searched", lambda _, predict, *a, **k: asked.update(predict=predict))
    found = names.infer(predictor, plan).columns
    assert len(np.unique(found.rows)) < len(data)
    place = next(p for p in found.places if p.candidate.kind == kind)
    bare = Chosen.at(place, 0)
    chosen = [Chosen(place, 0, bare.part, np.full(bare.rotated(found).shape[1], 3.0))]
    change = predictor([c.term for c in chosen]) - plan.base
    expected = found.rotated(change[found.rows, found.channel])
    assert np.abs(expected).max() > 1.0
    assert asked["predict"](chosen) == pytest.approx(expected, rel=1e-9, abs=1e-9)
