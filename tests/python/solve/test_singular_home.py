"""Homes at which a serial machine loses a direction, against slopes of its forward kinematics by differences."""

from __future__ import annotations

import re

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import stiffmap as sm
from stiffmap.experiment.spreadsheet.dh import DHRow, arm
from stiffmap.model.description import TASK, MachineDescription
from stiffmap.solve.advice import _reach
from stiffmap.solve.compiled import CompiledMachine
from stiffmap.solve.singular_home import serial_home, singular_words

# theta, d, a, alpha of a UR5: nominal, and one whose second to fourth axes are off parallel by less than a milliradian
NOMINAL = (
    (0.0, 0.0892, 0.0, np.pi / 2),
    (0.0, 0.0, -0.425, 0.0),
    (0.0, 0.0, -0.392, 0.0),
    (0.0, 0.1093, 0.0, np.pi / 2),
    (0.0, 0.09475, 0.0, -np.pi / 2),
    (0.0, 0.0825, 0.0, 0.0),
)
CALIBRATED = (
    (9.999999966666667e-05, 0.0892, 0.0, 1.5705963267985632),
    (-2.4668517118540456, -414.63423394556673, 0.33186923717354394, 0.0006403122789962877),
    (-0.11614165751577515, 634.8590515728235, 0.33241533291031716, -0.0009433979623856798),
    (-0.5584992742238017, -220.11575553109714, 2.1798909018995798e-05, -1.570896306790064),
    (9.997999316626682e-05, 0.09468910113364515, 9.471894094660133e-06, 1.5710963167888965),
    (3.1414926235881264, 0.08201893823309457, 0.0, 0.0),
)
WRIST = (  # three axes through one point
    (0.0, 0.67, 0.312, -np.pi / 2),
    (-np.pi / 2, 0.0, 1.075, 0.0),
    (0.0, 0.0, 0.225, -np.pi / 2),
    (0.0, 1.28, 0.0, np.pi / 2),
    (0.0, 0.0, 0.0, -np.pi / 2),
    (0.0, 0.215, 0.0, 0.0),
)
SEVEN = tuple(
    (0.0, d, 0.0, s * np.pi / 2)
    for d, s in zip((0.3, 0, 0.4, 0, 0.4, 0, 0.1), (1, -1, -1, 1, 1, -1, 0), strict=True)
)
TWO = ((0.0, 0.0, 0.4, 0.0), (0.0, 0.0, 0.3, 0.0))


def machine(rows: tuple[tuple[float, ...], ...], q: list[float] | None = None) -> MachineDescription:
    table = [DHRow(f"j{i + 1}", *r, False, None) for i, r in enumerate(rows)]
    return arm(table, "standard", "m", home=None if q is None else np.array(q, dtype=float))


def slopes(d: MachineDescription) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    m, step = sm.Machine(d), 1e-5
    q = np.array([e.home[0] for e in d.legs[0].elements if hasattr(e, "home")])
    out = np.zeros((6, len(q)))
    for i, shift in enumerate(step * np.eye(len(q))):
        a, b = (sm.forward_kinematics(m, q + s * shift) for s in (-1, 1))
        out[:3, i] = (b.position - a.position) / (2 * step)
        out[3:, i] = Rotation.from_matrix(b.rotation @ a.rotation.T).as_rotvec() / (2 * step)
    return out


HOMES = {
    "wrist straight": (WRIST, [0.2, 0.3, -0.4, 0.5, 0, 0.7], "axes of j4 and j6 are in line", "j5 bent"),
    "tool over the first axis": (WRIST, [0, -0.5404, 0.3, 0, -1.3304, 0.2], "", ""),
    "seven axes straight": (SEVEN, [0] * 7, "axes of j1 and j3 are in line", " and "),
    "UR at zero": (NOMINAL, [0] * 6, "the motions of j2, j3, j4 add up to none", "j3 and j5 bent"),
    "UR with straight elbow": (
        NOMINAL,
        [0.3, -0.9, 0, -0.5, 1.2, 0.4],
        "the motions of j2, j3, j4 add up to none",
        "j3 bent",
    ),
    "UR with straight wrist": (NOMINAL, [0.3, -0.9, 1.1, -0.5, 0, 0.4], "add up to none", "j5 bent"),
}


@pytest.mark.parametrize("name", HOMES)
def test_the_lost_direction(name: str) -> None:
    rows, q, cause, remedy = HOMES[name]
    d = machine(rows, q)
    said = singular_words(CompiledMachine(d), False)
    j = slopes(d)
    sizes = np.linalg.svd(j, compute_uv=False)
    assert bool(said) == (sizes[-1] < 1e-6 * sizes[0])
    assert cause in said
    assert remedy in said
    for names, numbers in re.findall(r"\(([a-z, ]+)\) = \(([-0-9., ]+)\)", said):
        lost = np.zeros(6)
        lost[[TASK.index(c) for c in names.split(", ")]] = [float(v) for v in numbers.split(", ")]
        assert np.abs(lost @ j).max() < 2e-3  # written to three digits


def test_two_links_in_line() -> None:
    from dataclasses import replace

    stretched = replace(machine(TWO, [0.3, 0]), task=("x", "y"))
    said = singular_words(CompiledMachine(stretched), False)
    assert f"({np.cos(0.3):.3f}, {np.sin(0.3):.3f})" in said
    assert "j2 bent" in said
    assert singular_words(CompiledMachine(replace(machine(TWO, [0.3, 0.8]), task=("x", "y"))), False) == ""
    # two drives for six components: no home helps
    assert singular_words(CompiledMachine(machine(TWO, [0.3, 0])), True) == ""


def test_frames_that_lie_far_off() -> None:
    """Between axes that are nearly parallel, lengths of hundreds of metres cancel; the arm is no larger for them."""
    far, near = machine(CALIBRATED), machine(NOMINAL)
    home = serial_home(CompiledMachine(far))
    assert home is not None
    assert 0.3 < home.arm < 1.2
    np.testing.assert_allclose(home.jacobian, slopes(far), atol=1e-6)
    assert not any("cannot move" in a or "limit of its own reach" in a for a in _reach(sm.Machine(far)))
    widths = [np.ptp(np.array(m.workspace), axis=0) for m in (far, near)]
    np.testing.assert_allclose(widths[0], widths[1], rtol=0.2)
    straight = machine(CALIBRATED, [0.3, -0.9, 1.1, -0.5, 0, 0.4])
    assert "home is nearly singular" in singular_words(CompiledMachine(straight), True)
    assert singular_words(CompiledMachine(far), True) == ""


def test_forward_kinematics_is_of_the_declared_geometry() -> None:
    """And the displacement without load leads from there to where the machine stands."""
    m = sm.load_machine("ur10")
    q = np.array([0.1, -1.0, 1.2, -0.3, 0.8, 0.2])
    bent = m.with_effect("zero_offset", element="shoulder", error=0.002)
    declared, there = (sm.forward_kinematics(m, v) for v in (q, q + [0, 0.002, 0, 0, 0, 0]))
    np.testing.assert_array_equal(sm.forward_kinematics(bent, q).position, declared.position)
    moved = bent.solve_joints(q).displacement
    np.testing.assert_allclose(declared.position + moved[:3], there.position, rtol=0, atol=1e-12)
    turned = Rotation.from_rotvec(moved[3:]).as_matrix() @ declared.rotation
    np.testing.assert_allclose(turned, there.rotation, rtol=0, atol=1e-12)
