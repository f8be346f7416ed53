"""Joints that a controller shows otherwise than the machine counts them are found by the places that were seen."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import stiffmap as sm
from stiffmap.ui.cli.app import main

DH = ((10.0, 320.0, 60.0, 90.0), (0.0, 0.0, 430.0, 0.0), (20.0, 30.0, 120.0, 90.0), (0.0, 410.0, 0.0, -90.0),
      (5.0, 0.0, 0.0, 90.0), (0.0, 80.0, 0.0, 0.0))  # fmt: skip
Q = np.random.default_rng(8).uniform(-70, 70, (40, 6))
TARGETS = ((90.0, -20.0, 40.0), (-60.0, 70.0, 10.0))


def places(q: np.ndarray) -> np.ndarray:
    """(n, 2, 3) mm of two targets, from the arm's transformations by hand, in the axes of an instrument that stands aside."""
    out = np.zeros((len(q), len(TARGETS), 3))
    aside = Rotation.from_rotvec([0.2, -0.4, 2.1])
    for k, row in enumerate(q):
        p, r = np.zeros(3), Rotation.identity()
        for (zero, d, a, alpha), angle in zip(DH, row, strict=True):
            r = r * Rotation.from_euler("z", zero + angle, degrees=True)
            p, r = p + r.apply([a, 0, d]), r * Rotation.from_euler("x", alpha, degrees=True)
        out[k] = aside.apply(p + r.apply(TARGETS)) + [2500.0, -300.0, 800.0]
    return out + 0.3 * np.random.default_rng(9).normal(size=out.shape)


def said(
    folder: Path, shown: np.ndarray, capsys: pytest.CaptureFixture[str], *more: str, true: np.ndarray = Q
) -> str:
    """What is said of a sheet of the joints as a controller shows them, deg."""
    rows = np.hstack([shown, places(true).reshape(len(true), -1)])
    heads = ",".join(
        [*(f"J{k} [deg]" for k in range(1, 7)), *(f"N{t}{a} [mm]" for t in (1, 2) for a in "xyz")]
    )
    np.savetxt(folder / "sheet.csv", rows, fmt="%.4f", delimiter=",", header=heads, comments="")
    np.savetxt(
        folder / "dh.csv", DH, delimiter=",", header="theta [deg],d [mm],a [mm],alpha [deg]", comments=""
    )
    made = ["--dh", str(folder / "dh.csv")] if "--machine" not in more else []
    noise = [o for a in ("dx", "dy", "dz") for o in ("--noise", f"{a}=0.3")]
    files = ["experiment", "new", str(folder / "sheet.csv"), *made, "-o", str(folder / "e"), "--overwrite"]
    assert main([*files, *noise, *more]) == 0
    return " ".join(capsys.readouterr().out.split())


def otherwise(*changes: tuple[int, str, float]) -> np.ndarray:
    """The joints with some of them multiplied, shifted, or less a share of the joint before."""
    out = Q.copy()
    for k, what, size in changes:
        if what == "times":
            out[:, k] = size * Q[:, k]
        else:
            out[:, k] = Q[:, k] - size * (Q[:, k - 1] if what == "less" else 1.0)
    return out


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ([(3, "times", -1)], ["joint_4 goes the other way: --map joint_4='-J4 [deg]'"]),
        ([(2, "less", 1)], ["`coupled: {joint_2: 1}` at joint_3"]),
        ([(2, "less", -1)], ["`coupled: {joint_2: -1}` at joint_3"]),
        ([(1, "zero", 90)], ["the zero of joint_2 is 90 deg elsewhere"]),
        ([(1, "times", -1), (4, "times", -1)], ["joint_2 goes the other way", "joint_5 goes the other way"]),
    ],
)
def test_it_is_said_how_the_joints_are_shown(
    changes: list[tuple[int, str, float]],
    words: list[str],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    text = said(tmp_path, otherwise(*changes), capsys)
    for one in words:
        assert one in text


def test_joints_that_move_one_after_the_other_show_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """As for circles about each axis: the tool's own point stands still while the wrist turns about it."""
    true = np.vstack(
        [[20, 30, -40, 50, -60, 70] + np.outer(np.linspace(-30, 30, 9), row) for row in np.eye(6)]
    )
    shown = true - true[:, [1]] * np.eye(6)[2]
    assert "`coupled: {joint_2: 1}` at joint_3" in said(tmp_path, shown, capsys, true=true)


def test_nothing_is_said_of_joints_as_they_are_or_of_errors_of_an_arm(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert "places seen are" not in said(tmp_path, Q, capsys)
    assert "places seen are" not in said(tmp_path, otherwise((1, "zero", 0.5), (2, "times", 1.004)), capsys)


def test_nothing_is_said_where_no_way_of_reading_explains_the_places(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert "places seen are" not in said(tmp_path, Q[::-1], capsys)


def test_what_is_said_of_a_turned_joint_mends_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    shown = otherwise((3, "times", -1))
    said(tmp_path, shown, capsys)
    before = sm.residual(tmp_path / "e/machine.yaml", tmp_path / "e")
    assert "places seen are" not in said(tmp_path, shown, capsys, "--map", "joint_4=-J4 [deg]")
    after = sm.residual(tmp_path / "e/machine.yaml", tmp_path / "e")
    assert np.nanstd(after.values) < 4e-4 < 0.01 < np.nanstd(before.values)


def test_what_is_said_of_a_coupled_joint_mends_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    shown = otherwise((2, "less", 1))
    said(tmp_path, shown, capsys)
    head, name, tail = (tmp_path / "e/machine.yaml").read_text().partition("- actuator: joint_3\n")
    (tmp_path / "arm.yaml").write_text(f"{head}{name}      coupled: {{joint_2: 1}}\n{tail}")
    assert "places seen are" not in said(tmp_path, shown, capsys, "--machine", str(tmp_path / "arm.yaml"))
    assert np.nanstd(sm.residual(tmp_path / "arm.yaml", tmp_path / "e").values) < 4e-4
