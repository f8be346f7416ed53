"""Compensation tables: read back, applied to the machine, and their interpolation error measured."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import stiffmap as sm
from stiffmap.common.errors import FileError
from stiffmap.machining.compensation import axis_errors, axis_errors_of_map, read_table, write_table
from stiffmap.machining.compensation.tables import FORMATS
from stiffmap.ui.cli.app import main

LINE = np.linspace(0.65, 1.25, 7)
WEIGHT = [0, 0, -9.81]


def column() -> sm.Machine:
    """A periodic and a proportional error of the ram's drive, which a table must follow."""
    machine = sm.load_machine("travelling-column")
    machine = machine.with_effect("lead_error", element="ram_drive", legs=["machine"], slope=2e-4)
    return machine.with_effect(
        "periodic_error", element="ram_drive", legs=["machine"], amplitude=2e-6, period=0.5
    )


def test_errors_are_those_of_the_machine() -> None:
    machine = column()
    load = [100, 200, -800, 0, 0, 0]
    e = axis_errors(machine, "y", LINE, wrench=load, gravity=WEIGHT)
    p = np.column_stack([0 * LINE, LINE, np.full(7, machine.description.home.p[2])])
    wanted = machine.solve(p, load, gravity=WEIGHT).displacement
    np.testing.assert_allclose(e.forward, wanted, atol=1e-12)
    np.testing.assert_allclose(e.backward, wanted, atol=1e-12)
    assert e.names == ("E_XY", "E_YY", "E_ZY", "E_AY", "E_BY", "E_CY")


@pytest.mark.parametrize("form", FORMATS)
def test_a_table_is_read_back(form: str, tmp_path: Path) -> None:
    machine = column().with_effect("dead_zone", element="ram_drive", legs=["machine"], half_width=5e-6)
    e = axis_errors(machine, "y", LINE)  # under its weight the play would lie on one side
    assert np.abs(e.reversal).max() > 5e-6
    path = write_table(e, tmp_path / "table", form)
    x, forward, backward = read_table(path, form)
    np.testing.assert_allclose(x, LINE, atol=1e-10)
    wanted = e.positioning
    if form == "siemens":
        wanted = ((wanted[0] + wanted[1]) / 2,) * 2
    np.testing.assert_allclose(forward, wanted[0], atol=2e-10)
    np.testing.assert_allclose(backward, wanted[1], atol=2e-10)
    text = path.read_text(encoding="ascii")
    assert f"leaves up to {1e6 * e.interpolation:.3f} um" in text
    assert "E_YY of ISO 230-1" in text


def test_a_controller_with_the_table_stands_within_its_interpolation_error(tmp_path: Path) -> None:
    machine = column()
    e = axis_errors(machine, "y", LINE, gravity=WEIGHT)
    x, forward, _ = read_table(write_table(e, tmp_path / "y.comp", "linuxcnc"), "linuxcnc")
    wanted = np.linspace(LINE[0], LINE[-1], 97)
    command = wanted - np.interp(wanted, x, forward)
    np.testing.assert_allclose(command, e.corrected(wanted), atol=1e-9)
    p = np.column_stack([0 * wanted, command, np.full(97, machine.description.home.p[2])])
    stands = command + machine.solve(p, gravity=WEIGHT).displacement[:, 1]
    left = np.abs(stands - wanted).max()
    # half way is not where the error is largest: the stated figure is met within a tenth
    assert 0.5 * e.interpolation < left < 1.1 * e.interpolation
    plain = np.column_stack([0 * wanted, wanted, p[:, 2]])
    assert np.abs(machine.solve(plain, gravity=WEIGHT).displacement[:, 1]).max() > 20 * left


def test_a_map_gives_the_same_line() -> None:
    machine, line, load = (
        sm.load_machine("orthoglide-revised"),
        np.linspace(-0.2, 0.3, 11),
        [300, 0, 0, 0, 0, 0],
    )
    ds = sm.error_map(machine, x=line, y=[0.1], z=[-0.1, 0.1], wrench={"F": load}, plane=None, progress=False)
    e = axis_errors_of_map(ds, "x", through=[0, 0.1, 0.1])
    direct = axis_errors(machine, "x", line, wrench=load, through=[0, 0.1, 0.1])
    np.testing.assert_allclose(e.forward, direct.forward, atol=1e-12)
    assert direct.interpolation > 1e-8
    assert 0.5 * direct.interpolation < e.interpolation < 2 * direct.interpolation
    assert not e.interpolation_checked


def test_zero_at_the_reference_point() -> None:
    e = axis_errors(column(), "y", LINE).zeroed(LINE[2])
    assert e.positioning[0][2] == pytest.approx(0, abs=1e-18)


def test_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    call = ["compensate", "travelling-column", "--axis", "y", "--force", "0,300,0", "--points", "5"]
    assert main([*call, "--format", "siemens", "-o", str(tmp_path / "y.mpf")]) == 0
    assert "linear interpolation leaves, um: " in capsys.readouterr().out
    x, _, _ = read_table(tmp_path / "y.mpf", "siemens")
    assert x.size == 5
    assert main([*call, "--format", "fanuc"]) == 2
    assert main(["compensate", "five-bar", "--axis", "z"]) == 2
    (tmp_path / "bad").write_text("nonsense", encoding="utf-8")
    for form in FORMATS:
        with pytest.raises(FileError):
            read_table(tmp_path / "bad", form)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["ur10", "--axis", "x", "--dh", "dh.csv"], "--dh: not with --axis"),
        (["ur10", "poses.csv", "--axis", "x"], "--poses: not with --axis"),
        (["ur10", "poses.csv", "--through", "0,0,1"], "--through: not without --axis"),
        (["ur10", "poses.csv", "--case", "Fx"], "--case: not without --axis"),
        (["ur10", "--axis", "x", "--case", "Fx"], "--case: not with --axis"),
        (
            ["map.nc", "--axis", "x", "--effect", "friction elbow force=1N"],
            "--effect: not with --axis of a map",
        ),
        (["map.nc", "--axis", "x", "--force", "1,0,0"], "--force: not with --axis of a map"),
        (["map.nc", "--axis", "x", "--gravity", "0,0,0"], "--gravity: not with --axis of a map"),
        (["map.nc", "--axis", "x", "--points", "5"], "--points: not with --axis of a map"),
        (["ur10", "poses.csv", "--zero", "0"], "--zero: not without --axis"),
        (["ur10", "poses.csv", "--format", "csv"], "--format: not without --axis"),
        (["ur10", "poses.csv", "--points", "21"], "--points: not without --axis"),
        (["ur10", "--dh", "dh.csv", "--force", "0,0,-100"], "--force: not without --axis or --poses"),
        (
            ["ur10", "--check", "held_out", "--gravity", "0,0,-9.81"],
            "--gravity: not without --axis or --poses",
        ),
        (["ur10", "--check", "held_out", "-o", "c.csv"], "--output: not without --axis or --poses or --urdf"),
        (["ur10", "--dh", "dh.csv", "-o", "c.csv"], "--output: not without --axis or --poses or --urdf"),
        (["orthoglide-revised", "--axis", "x", "--points", "1"], "points, position: expected two or more"),
        (["orthoglide-revised", "--axis", "x", "--points", "-3"], "points, position: expected two or more"),
    ],
)
def test_an_option_that_would_be_dropped_is_refused(words, message, capsys) -> None:
    assert main(["compensate", *words]) == 2
    assert message in capsys.readouterr().err


def test_lists_that_must_rise_name_the_entry_that_does_not() -> None:
    machine = sm.load_machine("travelling-column")
    with pytest.raises(sm.StiffmapError, match=r"two or more rising numbers .* entry 3 is 0.8 after 0.9"):
        axis_errors(machine, "z", [0.7, 0.9, 0.8])
    with pytest.raises(sm.StiffmapError, match=r"two or more rising numbers .* got one"):
        axis_errors(machine, "z", [0.7])
    with pytest.raises(sm.StiffmapError, match="through: expected a position"):
        axis_errors(machine, "z", through=[0.1, 0.2])
    flat = sm.error_map(
        machine, x=[0.0], y=[0.97], z=[0.7, 0.8, 0.9], wrench=[0, 0, -100, 0, 0, 0], plane=None
    )
    with pytest.raises(sm.StiffmapError, match="through: expected a position"):
        axis_errors_of_map(flat, "z", through=[0.1, 0.2])
    with pytest.raises(
        sm.StiffmapError, match=r"speeds: expected rising numbers above zero .* entry 1 is -1"
    ):
        sm.stability_lobes([(80.0, 0.02, 5.0, "x")], "slot", speeds=[-1.0, 2.0])
    with pytest.raises(sm.StiffmapError, match=r"depths: expected rising .* entry 2 is 0.001 after 0.002"):
        sm.stability_lobes([(80.0, 0.02, 5.0, "x")], "slot", depths=[0.002, 0.001])
    with pytest.raises(sm.StiffmapError, match=r"depths: expected rising .* entry 2 is 0.002 after 0.002"):
        sm.stability_lobes([(80.0, 0.02, 5.0, "x")], "slot", depths=[0.002, 0.002])
