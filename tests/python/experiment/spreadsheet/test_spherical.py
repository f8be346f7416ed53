"""Two angles and a distance of a tracker or total station are the places that it saw."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import stiffmap as sm
from stiffmap.ui.cli.app import main

Q = np.random.default_rng(3).uniform(-60, 60, (20, 6)) + [0, -70, 0, 0, 0, 0]
DEG = np.pi / 180


def seen(at: np.ndarray) -> np.ndarray:
    """Places, m, in the axes of an instrument that stands aside."""
    return Rotation.from_rotvec([0.1, -0.3, 1.4]).apply(at) + [1.5, -0.4, 0.3]


def angles(places: np.ndarray) -> np.ndarray:
    """(n, 3) azimuth and elevation, rad, distance, m."""
    far = np.linalg.norm(places, axis=1)
    return np.column_stack([np.arctan2(places[:, 1], places[:, 0]), np.arcsin(places[:, 2] / far), far])


def experiment(folder: Path, names: list[str], columns: np.ndarray, *more: str) -> int:
    np.savetxt(folder / "sheet.csv", columns, delimiter=",", header=",".join(names), comments="")
    noise = [o for a in ("dx", "dy", "dz") for o in ("--noise", f"{a}=0.02")]
    made = ["experiment", "new", str(folder / "sheet.csv"), "--machine", "ur10", "-o", str(folder / "e")]
    return main([*made, *noise, *more])


@pytest.mark.parametrize(
    ("names", "scale", "zenith", "clockwise"),
    [
        (["Azimuth [deg]", "Elevation [deg]", "Distance [mm]"], (DEG, DEG, 1e-3), False, False),
        (["Hz [gon]", "V [gon]", "Slope distance [m]"], (0.9 * DEG, 0.9 * DEG, 1.0), True, True),
        (["Horizontal angle [rad]", "Vertical angle [rad]", "Range [m]"], (1.0, 1.0, 1.0), True, False),
        (["Horizontalwinkel [deg]", "Höhenwinkel [deg]", "Strecke [m]"], (DEG, DEG, 1.0), False, True),
        (["Tracker Az [mrad]", "Tracker El [mrad]", "Tracker R [mm]"], (1e-3, 1e-3, 1e-3), False, False),
    ],
)
@pytest.mark.parametrize("joints", [True, False])
def test_places_are_read_of_angles_and_distance(
    names: list[str], scale: tuple[float, ...], zenith: bool, clockwise: bool, joints: bool, tmp_path: Path
) -> None:
    """Which way the first angle turns is seen by what was commanded."""
    at = sm.forward_kinematics(sm.load_machine("ur10"), Q * DEG).position
    read = angles(seen(at))
    read[:, 0] *= -1.0 if clockwise else 1.0
    read[:, 1] = np.pi / 2 - read[:, 1] if zenith else read[:, 1]
    heads = [f"J{k} [deg]" for k in range(1, 7)] if joints else ["x [mm]", "y [mm]", "z [mm]"]
    commanded = Q if joints else 1e3 * at
    assert experiment(tmp_path, [*heads, *names], np.hstack([commanded, read / scale])) == 0
    e = sm.load_experiment(tmp_path / "e")
    assert e.seen is not None
    np.testing.assert_allclose(e.seen, seen(at), atol=1e-9)


def test_angles_without_a_unit_are_asked_for(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    read = angles(seen(sm.forward_kinematics(sm.load_machine("ur10"), Q * DEG).position))
    names = [*(f"J{k} [deg]" for k in range(1, 7)), "Azimuth", "Elevation", "Distance [m]"]
    assert experiment(tmp_path, names, np.hstack([Q, read])) == 2
    assert "'Azimuth' (Azimuth) has no unit" in capsys.readouterr().err
    assert experiment(tmp_path, names, np.hstack([Q, read]), "--unit", "Azimuth=rad", "--unit", "Elevation=rad") == 0  # fmt: skip


def test_angles_next_to_other_readings_are_notes(tmp_path: Path) -> None:
    at = sm.forward_kinematics(sm.load_machine("ur10"), Q * DEG).position
    names = [*(f"J{k} [deg]" for k in range(1, 7)), "px [mm]", "py [mm]", "pz [mm]", "Azimuth [deg]", "Elevation [deg]", "Distance [m]"]  # fmt: skip
    assert experiment(tmp_path, names, np.hstack([Q, 1e3 * at, angles(seen(at)) / [DEG, DEG, 1.0]])) == 0
    e = sm.load_experiment(tmp_path / "e")
    assert e.seen is not None
    np.testing.assert_allclose(e.seen, at, atol=1e-9)
