"""Notebooks and scripts: reprs, names, words."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import stiffmap as sm
from stiffmap.common.short import MOST_ROWS, table
from stiffmap.model.effects import kinds
from stiffmap.model.effects.registry import SYNONYMS, found_by
from stiffmap.ui.cli import main

EXAMPLES = Path(__file__).parents[3] / "examples/experiments"


def test_dir_shows_the_public_names_only() -> None:
    assert dir(sm) == sorted(sm.__all__)
    for name in sm.__all__:
        assert getattr(sm, name) is not None


def test_a_name_stays_a_function_whatever_was_imported_before() -> None:
    script = (
        "import stiffmap.experiment.comparison.residual, stiffmap.experiment.virtual.plans, stiffmap.solve.budget, stiffmap as sm; "
        "assert callable(sm.residual) and callable(sm.simulate) and callable(sm.deflection_budget)"
    )
    assert subprocess.run([sys.executable, "-c", script], check=False).returncode == 0


def test_machines_may_be_given_as_text() -> None:
    assert "five-bar" in sm.machine_names()
    machine = sm.load_machine("five-bar")
    one, other = (sm.polar(m, [0, 0.4, 0], directions=4) for m in (machine, "five-bar"))
    assert one.identical(other)
    ds = sm.error_map("five-bar", x=0.0, y=0.4, z=0.0, wrench=[1.0, 0, 0, 0, 0, 0])
    assert ds.status.values.tolist() == [[[0]]]
    assert sm.deflection_budget("five-bar", None, [1.0, 0, 0, 0, 0, 0]).elements
    with pytest.raises(sm.StiffmapError, match="did you mean 'five-bar'"):
        sm.polar("five-baar", [0, 0.4, 0])


def test_millimetres_given_as_metres_are_named() -> None:
    with pytest.warns(UserWarning, match=r"positions up to 400 m.*metres are expected"):
        sm.error_map("five-bar", x=[-100.0, 100.0], y=[350.0, 400.0], z=0.0, wrench=[1.0, 0, 0, 0, 0, 0])


def test_reprs_and_data_frames() -> None:
    machine = sm.load_machine("orthoglide-revised")
    assert "workspace, mm" in machine._repr_html_()
    experiment = sm.load_experiment(EXAMPLES / "D-gravity")
    assert "D-gravity" in experiment._repr_html_()
    r = sm.residual(machine, experiment)
    assert "µm rms" in r._repr_html_() or "rms" in r._repr_html_()
    frame = r.to_dataframe()
    assert len(frame) == len(experiment)
    gap = frame["dx reading, µm"] - frame["dx prediction, µm"] - frame["dx residual, µm"]
    assert np.nanmax(np.abs(gap)) < 1e-9
    assert "share" in sm.deflection_budget(machine, None, [1.0, 0, 0, 0, 0, 0])._repr_html_()


def test_long_tables_fold_and_cells_are_escaped() -> None:
    short, long = (table(("a",), [("<b>",)] * n) for n in (MOST_ROWS, MOST_ROWS + 3))
    assert "<details>" not in short and "<summary>3 more</summary>" in long
    assert "<b>" not in short and "&lt;b&gt;" in short


@pytest.mark.parametrize(
    ("word", "kind"),
    [("backlash", "dead_zone"), ("play", "dead_zone"), ("Spiel", "dead_zone"), ("stiction", "friction"),
     ("sag", "gravity"), ("SQUARENESS", "tilt"), ("pitch error", "lead_error")],
)  # fmt: skip
def test_synonyms_find_effects(word: str, kind: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert found_by(word, kinds())[0] == kind
    assert main(["effects", word]) == 0
    assert kind in capsys.readouterr().out
    with pytest.raises(sm.StiffmapError, match=f"did you mean '{kind}'"):
        sm.load_machine("orthoglide-revised").with_effect(word)


def test_synonyms_are_of_kinds_that_exist() -> None:
    assert set(SYNONYMS) <= set(kinds())


def test_metres_are_expected_wherever_positions_are_given() -> None:
    machine = sm.load_machine("five-bar")
    for call in (
        lambda: machine.solve((0.0, 400.0, 0.0)),
        lambda: machine.solve([[0.0, 400.0, 0.0], [50.0, 400.0, 0.0]], method="reference"),
        lambda: sm.inverse_kinematics(machine, [0.0, 400.0, 0.0]),
        lambda: sm.polar("five-bar", [0.0, 400.0, 0.0]),
        lambda: sm.sweep(machine, [0.0, 400.0, 0.0], [1, 0, 0], [10.0]),
        lambda: sm.sweep(machine, [0.0, 400.0, 0.0], [1, 0, 0], limit=10.0),
    ):
        with pytest.warns(UserWarning, match="metres are expected") as told:
            call()
        assert {w.filename for w in told} == {__file__}
    with pytest.raises(sm.StiffmapError, match=r"unreachable: positions up to 400 m.*metres are expected"):
        sm.deflection_budget(machine, [0.0, 400.0, 0.0], [10.0, 0, 0, 0, 0, 0])


def test_a_machine_is_a_name_or_a_file_everywhere() -> None:
    """Every public function whose first argument is a machine takes text as well."""
    import inspect

    taking = {
        n: inspect.signature(f)
        for n in sm.__all__
        if inspect.isfunction(f := getattr(sm, n)) and "machine" in list(inspect.signature(f).parameters)[:1]
    }
    assert len(taking) > 15
    for name, signature in taking.items():
        said = str(signature.parameters["machine"].annotation)
        assert hasattr(getattr(sm, name), "__wrapped__") or "str" in said or "Source" in said, name
    k = sm.inverse_kinematics("five-bar", [0.0, 0.4, 0.0])
    again = sm.forward_kinematics("five-bar", k.actuators)
    np.testing.assert_allclose(again.position[:2], [0.0, 0.4], atol=1e-12)
    assert sm.map_estimate("five-bar", x=[0.0], y=[0.4], z=[0.0], wrench=[1, 0, 0, 0, 0, 0]).poses == 1
