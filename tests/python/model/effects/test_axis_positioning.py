"""Axis positioning errors: (coordinate, error) knots of a drive, straight between them and level beyond."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import stiffmap as sm
from stiffmap.experiment.prediction.joints import _error as error_in_python
from stiffmap.model.with_errors import edited

FORCE = np.array([120.0, -80.0, 200.0, 0.0, 0.0, 0.0])
# of the drive of leg x of the Orthoglide, m; its coordinate is -0.8525 m at home
KNOTS = ((-0.95, 1e-4), (-0.9, -2e-4), (-0.85, 3e-4), (-0.8, 0.5e-4))


def machine() -> sm.Machine:
    return sm.Machine(edited(sm.load_machine("orthoglide-revised").description, {}, {"x.actuator": KNOTS}))


@pytest.mark.parametrize("method", ["fast", "reference"])
def test_the_drive_stands_off_by_what_the_knots_say_at_its_command(method: str) -> None:
    off = machine()
    for x in (
        -0.2,
        -0.06,
        -0.05,
        0.013,
        0.0025,
        0.1,
    ):  # from level before the first knot to level behind the last
        position = np.array([x, 0.02, -0.03])
        u = sm.inverse_kinematics(off, position).actuators[0]
        error = float(np.interp(u, *zip(*KNOTS, strict=True)))
        plain = sm.load_machine("orthoglide-revised").with_effect(
            "zero_offset", element="actuator", legs=["x"], error=error
        )
        a, b = (m.solve(position, FORCE, method=method) for m in (off, plain))
        assert a.displacement == pytest.approx(b.displacement, rel=1e-12, abs=1e-16)
        assert a.stiffness == pytest.approx(b.stiffness, rel=1e-11)


def test_many_poses_in_lanes_as_one_by_one() -> None:
    off = machine()
    rng = np.random.default_rng(0)
    positions = rng.uniform(-0.2, 0.3, (40, 3))
    fast, reference = (off.solve(positions, FORCE, method=m) for m in ("fast", "reference"))
    assert fast.displacement == pytest.approx(reference.displacement, rel=1e-10, abs=1e-15)


def test_files_keep_them(tmp_path: Path) -> None:
    off = machine()
    off.save(tmp_path / "off.yaml")
    again = sm.load_machine(tmp_path / "off.yaml")
    position = [0.05, 0.02, -0.03]
    assert again.solve(position, FORCE).displacement == pytest.approx(
        off.solve(position, FORCE).displacement, rel=1e-9
    )
    text = (tmp_path / "off.yaml").read_text()
    assert "knots" in text
    (tmp_path / "bad.yaml").write_text(text.replace("-0.95", "-0.89"))
    with pytest.raises(sm.StiffmapError, match="rising coordinates"):
        sm.load_machine(tmp_path / "bad.yaml")


def test_readings_of_a_motor_add_the_same_error() -> None:
    joint = next(e for e in machine().description.legs[0].elements if e.name == "actuator")
    (error,) = joint.command_errors  # type: ignore[union-attr]
    u = np.linspace(-1.0, -0.7, 7)
    expected = np.interp(u, *zip(*KNOTS, strict=True))
    assert error_in_python(error, u, -0.8525) == pytest.approx(expected)
    both = replace(error, offset=1e-3, slope=0.1, reference=-0.9)
    assert error_in_python(both, u, 0.0) == pytest.approx(expected + 1e-3 + 0.1 * (u + 0.9))
