"""What is drawn beside a machine: rows before and after, what a diagnosis named, a path and its ribbon."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import stiffmap as sm
from stiffmap.common.errors import FileError, StiffmapError
from stiffmap.common.number_text import length_text
from stiffmap.ui.cli import main
from stiffmap.ui.plot.skeleton import element_links
from stiffmap.ui.view.data import ShownFindings, findings, ribbon
from stiffmap.ui.view.open import View, data_of, model_of

pytest.importorskip("viser", reason="viser is not installed (pip install stiffmap[view])")
ROWS = Path(__file__).parents[4] / "examples" / "experiments" / "A-servo"


@pytest.fixture(scope="module")
def machine() -> sm.Machine:
    return sm.load_machine("orthoglide-revised")


def written(folder: Path, machine: sm.Machine, kind: str = "compliance") -> Path:
    """A folder as `stiffmap diagnose -o` writes it."""
    effect = {
        "kind": kind, "element": "actuator", "legs": ["z"], "aliases": [{"kind": kind, "element": "foot", "legs": ["z"]}],
        "parameters": {"scale": [2.148, 2.137, 2.159, "1"]},
    }  # fmt: skip
    folder.mkdir(exist_ok=True)
    (folder / "diagnosis.json").write_text(json.dumps({"verdict": "effects", "effects": [effect]}))
    machine.with_effect("compliance", element="actuator", legs=["z"], scale=2.148).save(
        folder / "machine.yaml"
    )
    return folder


def rms(machine: sm.Machine) -> float:
    r = sm.residual(machine, ROWS).values[:, :3]
    return float(1e6 * np.sqrt(np.nansum(r**2) / np.isfinite(r).any(axis=1).sum()))


def test_a_diagnosis_is_lit_and_its_residuals_are_drawn(machine: sm.Machine, tmp_path: Path) -> None:
    data = data_of(machine, ROWS, written(tmp_path / "result", machine))
    assert data is not None and data.diagnosis is not None
    with View(model_of(machine), data=data) as v:
        assert v._viewer.worker.idle(60) and not v._viewer.error
        scene = v._viewer.scene
        lit = scene._lines["/diagnosis/element"].points.copy()
        assert scene._lines["/diagnosis/element"].visible and len(lit) == 1
        legs = [scene.rest.legs[i] for i in scene.diagnosed]
        assert legs == ["z"]  # the links of other legs are not lit
        np.testing.assert_allclose(lit, scene.rest.links[scene.diagnosed], atol=1e-6)
        text = v._viewer.controls._why.content
        assert (
            "compliance of actuator, leg z: scale 2.148 [2.137, 2.159] (these readings cannot distinguish it from compliance of foot"
            in text
        )
        after = data.diagnosis.machine
        assert f"red as opened {length_text(1e-6 * rms(machine))} rms" in text
        assert f"pink with the diagnosis {length_text(1e-6 * rms(after))} rms" in text
        assert rms(after) < 0.3 * rms(machine)
        shown = {n: h.visible for n, h in scene._lines.items() if n.startswith("/rows")}
        assert shown == {"/rows/before": True, "/rows/now": False, "/rows/diagnosed": True}
        v.set(changes=(("x.foot/beam.EIx", 500.0),))
        assert v._viewer.worker.idle(60) and scene._lines["/rows/now"].visible
        changed = machine.with_number("x.foot/beam.EIx", 500.0)
        assert (
            f"blue as changed here {length_text(1e-6 * rms(changed))} rms" in v._viewer.controls._why.content
        )
        v.set(position=(0.1, 0.0, 0.0))
        assert v._viewer.worker.idle(60)
        moved = scene._lines["/diagnosis/element"].points
        np.testing.assert_allclose(moved, scene.rest.links[scene.diagnosed], atol=1e-6)
        assert np.abs(moved - lit).max() > 1e-3


def test_texts_of_files_are_escaped(machine: sm.Machine, tmp_path: Path) -> None:
    folder = written(tmp_path / "result", machine, kind="<img src=x onerror=alert(1)>")
    out = tmp_path / "out.html"
    assert main(["view", "orthoglide-revised", "--diagnosis", str(folder), "--html", str(out)]) == 0
    text = out.read_text(encoding="utf-8")
    assert "&lt;img src=x onerror=alert(1)&gt; of actuator" in text and "<img src=x" not in text


def test_elements_of_both_branches_are_found(machine: sm.Machine) -> None:
    links = model_of(machine).moment.rest()
    of_bar = element_links(machine, "bar.k33", ("y",))
    assert len(of_bar) == 2 and {links.legs[i] for i in of_bar} == {"y"}
    assert {links.legs[i] for i in element_links(machine, "bar")} == {"x", "y", "z"}
    assert element_links(machine, "gauge") == []


def test_what_cannot_be_read_is_one_error(machine: sm.Machine, tmp_path: Path) -> None:
    with pytest.raises(FileError, match=r"diagnosis\.json: .*No such file"):
        findings(tmp_path)
    (tmp_path / "diagnosis.json").write_text('{"verdict": 1, "effects": 3}')
    with pytest.raises(
        FileError, match=r"diagnosis\.json: .*expected a diagnosis as `stiffmap diagnose --json` writes it"
    ):
        findings(tmp_path)
    with pytest.raises(StiffmapError, match=r"path: expected positions \(n, 3\) m"):
        data_of(machine, path=[[0.0, 1.0]])
    assert data_of(machine) is None


def test_a_ribbon_leaves_out_what_has_no_equilibrium() -> None:
    one = np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0], [3, 0, 0]])
    other = one + [0, 0, 1.0]
    points, faces = ribbon(one, other)
    sides = points[faces]
    area = np.linalg.norm(np.cross(sides[:, 1] - sides[:, 0], sides[:, 2] - sides[:, 0]), axis=1).sum() / 2
    assert area == pytest.approx(3.0)
    other[3] = np.nan
    assert len(ribbon(one, other)[1]) == 4


def test_a_path_says_how_much_it_errs(machine: sm.Machine) -> None:
    path = np.linspace([-0.1, 0.0, 0.0], [0.2, 0.1, 0.0], 20)
    model = model_of(machine, force=(0.0, 0.0, -300.0))
    with View(model, data=data_of(machine, path=path)) as v:
        assert v._viewer.worker.idle(60) and not v._viewer.error
        off = machine.solve(path, model.state.wrench).displacement[:, :3]
        text = v._viewer.controls._why.content
        assert f"as cut red (most {length_text(np.linalg.norm(off, axis=1).max())})" in text


def test_machine_view_takes_data(machine: sm.Machine) -> None:
    e = sm.load_experiment(ROWS)
    found = ShownFindings("none", (), machine)
    data = data_of(machine, e, None, np.zeros((2, 3)) + [[0.0], [0.01]])
    assert data is not None and data.experiment is e and found.effects == ()
    v = machine.view(browser=False, experiment=ROWS)
    try:
        assert v._viewer.data.experiment.name == e.name
    finally:
        v.close()
