"""Shares of a deflection: closed forms, and sums on every shipped machine."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import stiffmap as sm
from stiffmap import plot
from stiffmap.model.files.load import description_from_text
from stiffmap.model.files.shipped import machine_names
from stiffmap.ui.cli import main
from stiffmap.ui.plot.loaded import loaded_shape, round_factor

PUSHER = """
name: pusher
units: {length: mm, force: N, angle: deg}
home: {translation: [500, 0, 0]}
legs:
  arm:
    elements:
      - {actuator: drive, kind: prismatic, axis: x, compliance: 1.0e-4}
      - {offset: length, translation: [500, 0, 0]}
      - {spring: bar, beam: {length: 500, EA: 1.0e8, GJ: 1.0e9, EIy: 2.0e9, EIz: 1.0e9}}
"""


def test_drive_and_beam_in_series() -> None:
    machine = sm.Machine(description_from_text(PUSHER))
    small = 1e-3
    b = sm.deflection_budget(machine, None, small * np.array([1.0, 2.0, 4.0, 0, 0, 0]))
    parts = dict(zip(b.elements, b.contributions / small, strict=True))
    np.testing.assert_allclose(parts["arm.drive"], [1e-7, 0, 0, 0, 0, 0], rtol=1e-4, atol=1e-10)
    length, ea, eiy, eiz = 0.5, 1e8, 2e3, 1e3
    translation = [length / ea, 2 * length**3 / (3 * eiz), 4 * length**3 / (3 * eiy)]
    turn = [0.0, -4 * length**2 / (2 * eiy), 2 * length**2 / (2 * eiz)]
    np.testing.assert_allclose(parts["arm.bar"], [*translation, *turn], rtol=1e-4, atol=1e-10)
    assert b.shares.sum() == pytest.approx(1.0, abs=1e-5)


def test_each_axis_of_an_elastic_joint_has_its_share() -> None:
    neck = "      - {joint: neck, kind: universal, axes: [y, z], home: [0, 0], stiffness: [2.0e6, 5.0e6]}\n"
    lever = "      - {offset: nose, translation: [100, 0, 0]}\n"
    text = PUSHER.replace("[500, 0, 0]}\nlegs", "[600, 0, 0]}\nlegs") + neck + lever
    small = 1e-3
    b = sm.deflection_budget(
        sm.Machine(description_from_text(text)), None, small * np.array([0, 2.0, 4.0, 0, 0, 0])
    )
    parts = dict(zip(b.elements, b.contributions / small, strict=True))
    np.testing.assert_allclose(
        parts["arm.neck.1"], [0, 0, 4 * 0.1**2 / 2e3, 0, -4 * 0.1 / 2e3, 0], rtol=1e-4, atol=1e-10
    )
    np.testing.assert_allclose(
        parts["arm.neck.2"], [0, 2 * 0.1**2 / 5e3, 0, 0, 0, 2 * 0.1 / 5e3], rtol=1e-4, atol=1e-10
    )
    assert b.shares.sum() == pytest.approx(1.0, abs=1e-5)


@pytest.mark.parametrize("name", machine_names())
def test_shares_sum_to_the_deflection(name: str) -> None:
    machine = sm.load_machine(name)
    p = machine.description.home.p
    large, small = (
        sm.deflection_budget(machine, p, np.array([60.0, 40.0, -30.0, 0, 0, 0]) * k) for k in (1, 0.25)
    )
    assert abs(small.rest_share) < 2e-3
    # the remainder is of second order: a quarter of the load leaves a quarter of its share
    assert abs(small.rest_share) < abs(large.rest_share) / 3 + 1e-5
    frame = large.to_dataframe()
    assert frame["share, %"].sum() == pytest.approx(100 * (1 - large.rest_share), abs=1e-9)
    assert next(iter(frame.index)) == large.ranked()[0][0]


def test_an_unreachable_pose_has_no_budget() -> None:
    with pytest.raises(sm.StiffmapError, match="unreachable"):
        sm.deflection_budget(sm.load_machine("five-bar"), [9.0, 0, 0], [1.0, 0, 0, 0, 0, 0])


def test_without_load_nothing_has_a_share(tmp_path: Path) -> None:
    budget = sm.deflection_budget("ur10", wrench=[0.0] * 6)
    assert not budget.shares.any() and budget.rest_share == 0
    assert main(["show", "ur10", "--load", "0,0,0", "-o", str(tmp_path / "a.png")]) == 0


def test_the_loaded_picture_enlarges_what_was_solved() -> None:
    machine = sm.load_machine("orthoglide-revised")
    shape = loaded_shape(machine, [0.1, 0.0, 0.1], [0, 300.0, 0, 0, 0, 0])
    moved = shape.rest.enlarged(shape.loaded, 7.0).tcp - shape.rest.tcp
    np.testing.assert_allclose(moved, 7 * shape.displacement[:3], atol=1e-12)
    assert [round_factor(0.08, d) for d in (0.08, 0.03, 1e-4, 0.0)] == [1.0, 2.0, 500.0, 1.0]
    figure = plot.loaded_figure(machine, [0.1, 0.0, 0.1], [0, 300.0, 0, 0, 0, 0])
    assert "drawn ×" in figure.get_suptitle()


def test_the_loaded_picture_shows_what_gravity_does(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Free of load and gravity beside both: as far apart as the budget of the same pose says; in a map too."""
    machine, g = sm.load_machine("ur10"), [0.0, 0.0, -9.81]
    shape = loaded_shape(machine, None, np.zeros(6), gravity=g)
    budget = sm.deflection_budget(machine, None, np.zeros(6), gravity=g)
    np.testing.assert_allclose(shape.displacement, budget.displacement, rtol=1e-6, atol=1e-12)
    assert abs(shape.displacement[2]) > 1e-5
    np.testing.assert_allclose(
        shape.rest.enlarged(shape.loaded, 1.0).tcp - shape.rest.tcp, shape.displacement[:3], atol=1e-12
    )
    drawn = []
    real = plot.loaded_figure
    monkeypatch.setattr(plot, "loaded_figure", lambda *a, **k: drawn.append(real(*a, **k)) or drawn[-1])
    call = [
        "map",
        "orthoglide-revised",
        "--points",
        "2",
        "--z",
        "0",
        "--gravity",
        "0,0,-9.81",
        "-o",
        str(tmp_path),
    ]
    assert main([*call, "--json"]) == 0
    worst = json.loads(capsys.readouterr().out)["worst_pose"]
    size = f"{1e6 * worst['deflection']:.1f} µm"
    assert size in drawn[0].get_suptitle()


def test_show_load_writes_picture_and_shares(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "m.png"
    assert main(["show", "five-bar", "--load", "0", "-100", "0", "-o", str(out), "--json"]) == 0
    data = json.loads(capsys.readouterr().out)
    shares = {n: e["share"] for n, e in data["elements"].items()}
    assert sum(shares.values()) + data["second_order"] == pytest.approx(1.0)
    assert out.read_bytes().startswith(b"\x89PNG")


def test_a_map_says_where_its_worst_pose_gives_way(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    call = ["map", "travelling-column", "--force", "0,0,-1000", "--x", "0", "--plane", "yz", "--points", "5"]
    assert main([*call, "--no-pictures", "-o", str(tmp_path)]) == 0
    told = capsys.readouterr().out
    assert "worst pose of the map: (0, 1310, 1590) mm, 38.5 µm in space" in told
    assert "48 % from machine.ram" in told
    assert main([*call, "--no-pictures", "-o", str(tmp_path), "--json"]) == 0
    worst = json.loads(capsys.readouterr().out)["worst_pose"]
    assert sum(worst["shares"].values()) == pytest.approx(1, abs=1e-3)
