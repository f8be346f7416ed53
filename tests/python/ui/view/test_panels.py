"""What is said beside the scene: numbers as solved, texts escaped, the lines that make the same."""

from __future__ import annotations

import shlex
from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest

import stiffmap as sm
from stiffmap.common.errors import StiffmapError
from stiffmap.solve.status import Status
from stiffmap.ui.cli.view import _change, _state
from stiffmap.ui.plot.skeleton import element_links, skeleton
from stiffmap.ui.view import model_of
from stiffmap.ui.view.model import ViewModel
from stiffmap.ui.view.outputs import command_line, python_lines, view_figure
from stiffmap.ui.view.panels import (
    bars,
    colour_bar,
    compliance_panel,
    efforts_panel,
    frequencies_panel,
    probe_text,
    shares_panel,
    status_line,
)
from stiffmap.ui.view.state import ViewState

EVIL = '<img src=x onerror="alert(1)">&'


@pytest.fixture(scope="module")
def model() -> ViewModel:
    return model_of(sm.load_machine("orthoglide-revised"), (0.2, 0.1, 0.1), force=(100.0, 50.0, -200.0))


def well_formed(html: str) -> ElementTree.Element:
    return ElementTree.fromstring(f"<all>{html.replace('&nbsp;', ' ')}</all>")


def test_texts_of_people_and_files_are_escaped(model: ViewModel) -> None:
    moment, s = model.moment, model.moment.solve()
    evil = replace(moment, machine=sm.Machine(replace(moment.machine.description, name=EVIL)))
    for html in (status_line(evil, s, EVIL, EVIL), bars(EVIL, [(EVIL, 0.5, "red", EVIL)])):
        assert "<img" not in html
        assert not well_formed(html).findall(".//img")


def test_the_status_says_what_was_solved(model: ViewModel) -> None:
    moment, s = model.moment, model.moment.solve()
    html = status_line(moment, s, "", "")
    assert f"{1e6 * np.linalg.norm(s.displacement[:3]):.1f} µm" in html and 'role="status"' in html
    assert 'role="alert"' in status_line(moment, s, "", "file.yaml, line 3: wrong")


def test_panels_hold_the_numbers(model: ViewModel) -> None:
    moment, s = model.moment, model.moment.solve()
    budget = moment.shares()
    first, _, share = budget.ranked()[0]
    rows = [[c.text for c in r] for r in well_formed(shares_panel(budget, first)).iter("tr")]
    assert rows[0][0] == f"▶ {first}" and rows[0][2].endswith(f"{100 * share:.0f} %")
    top = np.linalg.eigvalsh(s.compliance[:3, :3])[-1]
    assert f"{1e6 * top:.4g} µm/N" in compliance_panel(s)
    efforts = efforts_panel(moment, s)
    assert f"{s.actuator_effort[0]:.1f} of 2000 N" in efforts
    assert "▶ mode 2" in frequencies_panel([10.0, 20.0, np.nan], 1)
    assert probe_text(moment, model.state.position).endswith(
        f"{1e6 * np.linalg.norm(s.displacement[:3]):.5g} µm"
    )


def test_the_colour_bar_shows_scale_and_tolerance(model: ViewModel) -> None:
    found = model.moment.plane(9)
    html = colour_bar(found, found.range, 1e-6 * float(np.mean(found.range)))
    svg = well_formed(html)[0]
    assert svg.attrib["role"] == "img" and "deflection under this load" in svg.attrib["aria-label"]
    assert html.count("#D55E00") == 1
    assert colour_bar(found, found.range, 1.0).count("#D55E00") == 0
    assert "not converged" in colour_bar(replace(found, quantity="status"), (0, 1), 1.0)


def test_machine_without_limits_says_so() -> None:
    m = ViewModel(sm.load_machine("tripteron"))
    assert "no limit declared" in efforts_panel(m.moment, m.moment.solve())


def test_the_command_makes_the_same_state(model: ViewModel) -> None:
    full = ViewState(
        (0.11, -0.05, 0.07), force=(10.0, 20.5, -30.0), moment=(1.0, 0.0, 0.0), gravity=(0.0, 0.0, -9.81), plane="free",
        normal=(1.0, 2.0, 2.0), quantity="worst", tolerance=1.25e-4, magnification=150.0, frequency=33.0,
        changes=(("x.foot/beam.EIx", 2500.0),),
    )  # fmt: skip
    words = shlex.split(command_line("my file.yaml", replace(model.moment, state=full)))
    assert words[:3] == ["stiffmap", "view", "my file.yaml"]
    given = {"rotation": None, "start": None, "changes": []}
    names = {"set": "changes", "magnify": "magnify"}
    for word in words[3:]:
        name, _, value = word.removeprefix("--").partition("=")
        if name == "set":
            given["changes"].append(value)  # type: ignore[union-attr]
        else:
            given[names.get(name, name)] = (
                float(value) if name in ("tolerance", "frequency", "magnify") else value
            )
    fields = _state(given)
    fields["changes"] = tuple(fields["changes"].items())
    for name, value in fields.items():
        want = getattr(full, name)
        assert (
            value == want
            if isinstance(want, str) or name == "changes"
            else np.allclose(value, want, rtol=1e-10)
        )


def test_python_lines_run(
    model: ViewModel, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    seen = {}
    monkeypatch.setattr(sm.Machine, "view", lambda self, p, **state: seen.update(position=p, **state))
    exec(python_lines("orthoglide-revised", model.moment), {})
    assert model_of(model.machine, seen.pop("position"), **seen).state == model.state
    s = model.moment.solve()
    assert str(s.displacement[0])[:8] in capsys.readouterr().out


@pytest.mark.parametrize("text", ["x.foot", "=3", "a=b", "a="])
def test_a_change_on_the_command_line_is_explained(text: str) -> None:
    with pytest.raises(StiffmapError, match="--set: expected ADDRESS=VALUE"):
        _change(text)


def test_the_picture_says_where_and_how_much(model: ViewModel) -> None:
    figure = view_figure(model.moment)
    d = 1e6 * np.linalg.norm(model.moment.solve().displacement[:3])
    words = figure.get_suptitle().replace("\n", " ")
    assert "orthoglide-revised at (200, 100, 100) mm" in words and f"{d:.1f} µm" in words
    assert any("deflection under this load, µm" in ax.get_xlabel() for ax in figure.axes)


@pytest.mark.parametrize("name", ["orthoglide-revised", "hexapod", "3-rps", "swing-table", "ur10"])
def test_every_share_is_lit_on_a_link_of_its_own_leg(name: str) -> None:
    machine = sm.load_machine(name)
    drawn = ViewModel(machine).moment.rest()
    for element in sm.deflection_budget(machine).elements:
        links = element_links(machine, element)
        assert links, element
        assert [drawn.legs[i] for i in links] == [element.split(".")[0]]
        assert np.linalg.norm(np.diff(drawn.links[links], axis=1), axis=-1).min() > 1e-3


def test_the_rim_of_a_platform_moves_with_it() -> None:
    machine = sm.load_machine("hexapod")
    model = ViewModel(machine)
    rest, s = model.moment.rest(), model.moment.solve()
    loaded = skeleton(machine, s.coordinates)
    assert len(rest.plate) == 6
    moved = loaded.plate - rest.plate
    np.testing.assert_allclose(moved.mean(axis=0), s.displacement[:3], atol=0.2 * np.abs(moved).max())
    rim = rest.links[len(rest.ends) :]
    assert len(rim) == 7 and set(rest.legs[len(rest.ends) :]) == {""}
    np.testing.assert_array_equal(rim[:6, 1], rim[np.arange(1, 7) % 6, 0])
    np.testing.assert_array_equal(rim[6, 1], rest.tcp)


def test_lengths_from_a_millimetre_on_are_in_millimetres(model: ViewModel) -> None:
    found = model.moment.plane(11)
    assert "deflection under this load, mm: 0.5 to 2.5 mm" in colour_bar(found, (500.0, 2500.0), 1e-3)
    assert ">1.5</text>" in colour_bar(found, (500.0, 2500.0), 1e-3)
    soft = ViewModel(model.declared, replace(model.state, force=(0.0, 0.0, -3000.0)))
    d = 1e3 * float(np.linalg.norm(soft.moment.solve().displacement[:3]))
    assert d > 1 and probe_text(soft.moment, soft.state.position).endswith(f": {d:.5g} mm")


def test_the_colour_bar_says_how_many_poses_are_hatched(model: ViewModel) -> None:
    found = model.moment.plane(5)
    assert "hatched" not in colour_bar(found, found.range, 1.0)
    status = found.status.copy()
    for row, words in ((1, "hatched: 1 pose without"), (2, "hatched: 2 poses without")):
        status[row, 2] = Status.UNREACHABLE
        assert words in colour_bar(replace(found, status=status), found.range, 1.0)
