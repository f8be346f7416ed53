"""Machine files of common classes: each passes the check and agrees with a calculation by hand."""

from __future__ import annotations

from math import pi, sqrt
from pathlib import Path

import numpy as np
import pytest

import stiffmap as sm
from stiffmap.common.errors import StiffmapError
from stiffmap.solve.starters import CLASSES, machine_text
from stiffmap.ui.cli.app import main

E, NU = 2.1e11, 0.3  # Pa
Defaults = dict[str, float]


def made(kind: str, **given: float) -> tuple[sm.Machine, Defaults]:
    """The machine, and its dimensions in SI (drives: N/m or N·m/rad)."""
    machine = sm.load_machine(machine_text(kind, kind, given))
    d = {**CLASSES[kind].defaults, **given}
    slides = kind in ("3-prr", "xy-table", "hexapod", "linear-delta", "orthoglide", "gantry", "five-axis")
    si = {k: v / 1e3 for k, v in d.items() if k != "drive"}
    return machine, {**si, "drive": d["drive"] * (1e6 if slides else 1e3)}


def section(d: Defaults) -> tuple[float, float]:
    """Area and second moment of the tube."""
    o, i = d["tube"], d["tube"] - 2 * d["wall"]
    return pi / 4 * (o**2 - i**2), pi / 64 * (o**4 - i**4)


def axial(length: float, d: Defaults) -> float:
    """Compliance of a bar along itself, m/N."""
    return length / (E * section(d)[0])


def bending(length: float, d: Defaults) -> float:
    """Compliance of a cantilever across its end, m/N."""
    return length**3 / (3 * E * section(d)[1])


def compliance_at_home(machine: sm.Machine) -> np.ndarray:
    """(6, 6) without load."""
    return machine.solve(machine.description.home.p).compliance


def crank_and_rod(base: np.ndarray, pin: np.ndarray, d: Defaults, bend: float) -> tuple[np.ndarray, float]:
    """Direction of a forearm that carries axial force only, and the leg's compliance along it (planar, by hand)."""
    way = pin - base
    r = np.linalg.norm(way)
    a, b = d["arm"], d["forearm"]
    # elbow: intersection of two circles
    along = (a**2 - b**2 + r**2) / (2 * r)
    off = sqrt(a**2 - along**2)
    elbow = base + along * way / r + bend * off * np.array([way[1], -way[0]]) / r
    u = (pin - elbow) / b
    t = (elbow - base) / a
    across = u[1] * t[0] - u[0] * t[1]
    leg = (
        (a * across) ** 2 / d["drive"] + bending(a, d) * across**2 + axial(a, d) * (u @ t) ** 2 + axial(b, d)
    )
    return u, leg


def planar_stiffness(legs: list[tuple[np.ndarray, np.ndarray, float]]) -> np.ndarray:
    """(3, 3) fx, fy, mz of legs: point of attack, direction, compliance along it."""
    k = np.zeros((3, 3))
    for p, u, c in legs:
        w = np.array([u[0], u[1], p[0] * u[1] - p[1] * u[0]])
        k += np.outer(w, w) / c
    return k


PLANE = np.ix_([0, 1, 5], [0, 1, 5])


@pytest.mark.parametrize("given", [{}, {"radius": 350, "arm": 250, "tube": 30}])
def test_3_rrr(given: Defaults) -> None:
    machine, d = made("3-rrr", **given)
    legs = []
    for a in np.radians([-90, 30, 150]):
        e = np.array([np.cos(a), np.sin(a)])
        pin = d["platform"] * e
        legs.append((pin, *crank_and_rod(d["radius"] * e, pin, d, 1.0)))
    assert compliance_at_home(machine)[PLANE] == pytest.approx(
        np.linalg.inv(planar_stiffness(legs)), rel=1e-6, abs=1e-15
    )


def test_3_prr() -> None:
    machine, d = made("3-prr")
    legs = []
    gap = d["radius"] - d["platform"]
    side = sqrt(d["rod"] ** 2 - gap**2)
    for a in np.radians([-90, 30, 150]):
        inward, slide = -np.array([np.cos(a), np.sin(a)]), np.array([np.sin(a), -np.cos(a)])
        u = (gap * inward + side * slide) / d["rod"]
        c = axial(d["rod"], d) + (side / d["rod"]) ** 2 / d["drive"]
        legs.append((-d["platform"] * inward, u, c))
    assert compliance_at_home(machine)[PLANE] == pytest.approx(
        np.linalg.inv(planar_stiffness(legs)), rel=1e-6, abs=1e-15
    )


def test_five_bar() -> None:
    machine, d = made("five-bar")
    tip = np.array([0.0, d["height"]])
    k = np.zeros((2, 2))
    for x, bend in ((-1, -1.0), (1, 1.0)):
        u, c = crank_and_rod(np.array([x * d["radius"], 0.0]), tip, d, bend)
        k += np.outer(u, u) / c
    assert compliance_at_home(machine)[:2, :2] == pytest.approx(np.linalg.inv(k), rel=1e-6)


def test_xy_table() -> None:
    machine, d = made("xy-table")
    c = compliance_at_home(machine)
    assert c[0, 0] == pytest.approx(1 / d["drive"] + bending(d["height"], d), rel=1e-9)
    assert c[2, 2] == pytest.approx(axial(d["height"], d), rel=1e-9)


def test_hexapod() -> None:
    machine, d = made("hexapod")
    k = np.zeros((6, 6))
    base = [120 * i + s * 15 for i in range(3) for s in (-1, 1)]
    platform = [120 * i + s * 45 for i in range(3) for s in (-1, 1)]
    for b, p in zip(np.radians(base), np.radians(platform), strict=True):
        ball = d["platform"] * np.array([np.cos(p), np.sin(p), 0])
        way = ball + [0, 0, d["height"]] - d["radius"] * np.array([np.cos(b), np.sin(b), 0])
        length = np.linalg.norm(way)
        w = np.concatenate([way / length, np.cross(ball, way / length)])
        k += np.outer(w, w) / (1 / d["drive"] + axial(length / 2, d))
    assert compliance_at_home(machine) == pytest.approx(np.linalg.inv(k), rel=1e-6, abs=1e-15)


def test_delta() -> None:
    """A vertical force: each leg carries a third of it, in the plane of crank and rods."""
    machine, d = made("delta")
    inward = d["radius"] + d["arm"] - d["platform"]
    sine = sqrt(d["rod"] ** 2 - inward**2) / d["rod"]  # of the rods below the level crank
    cosine = inward / d["rod"]
    rods = axial(d["rod"], d) / 2
    crank = sine**2 * (d["arm"] ** 2 / d["drive"] + bending(d["arm"], d)) + cosine**2 * axial(d["arm"], d)
    by_hand = (rods + crank) / (3 * sine**2)
    assert compliance_at_home(machine)[2, 2] == pytest.approx(by_hand, rel=1e-6)


def test_linear_delta() -> None:
    machine, d = made("linear-delta")
    sine = sqrt(d["rod"] ** 2 - (d["radius"] - d["platform"]) ** 2) / d["rod"]
    by_hand = (axial(d["rod"], d) / 2 + sine**2 / d["drive"]) / (3 * sine**2)
    assert compliance_at_home(machine)[2, 2] == pytest.approx(by_hand, rel=1e-6)


def test_orthoglide() -> None:
    """At the isotropic pose each axis is one drive and two parallel bars."""
    machine, d = made("orthoglide")
    c = compliance_at_home(machine)
    by_hand = 1 / d["drive"] + axial(d["rod"], d) / 2
    assert np.diag(c)[:3] == pytest.approx([by_hand] * 3, rel=1e-6)


def test_scara() -> None:
    """A force along the arm bends it by the moment of the forearm, and the forearm as a cantilever; the quill below
    them bends the arm in the vertical plane and twists the forearm."""
    machine, d = made("scara")
    b, down = d["forearm"], d["stroke"] / 2
    ei = E * section(d)[1]
    gj = ei / (1 + NU)  # of a tube: G J = E / (2 (1 + nu)) 2 I
    by_hand = 2 * b**2 / d["drive"] + axial(d["arm"], d) + d["arm"] / ei * b**2 + bending(b, d)
    by_hand += down**2 * (d["arm"] / ei + b / gj)
    assert compliance_at_home(machine)[0, 0] == pytest.approx(by_hand, rel=1e-9)


def test_gantry() -> None:
    machine, d = made("gantry")
    c = np.diag(compliance_at_home(machine))
    side = 1 / d["drive"] + bending(d["height"], d)
    assert c[:3] == pytest.approx([side, side, 1 / d["drive"] + axial(d["height"], d)], rel=1e-9)


def test_five_axis() -> None:
    """The head adds the turn of the ram's end and of axis A, over the tool's reach."""
    machine, d = made("five-axis")
    ram, p = d["height"], d["reach"]
    ei = E * section(d)[1]
    bent = bending(ram, d) + 2 * p * ram**2 / (2 * ei) + p**2 * ram / ei
    along_x, along_y = np.diag(compliance_at_home(machine))[:2]
    a_axis = p**2 / 5e5  # N·m/rad
    assert sorted([along_x, along_y]) == pytest.approx(
        sorted([1 / d["drive"] + bent, 1 / d["drive"] + bent + a_axis]), rel=1e-9
    )


def test_arm() -> None:
    """A vertical force at the tool turns shoulder and elbow, and bends the forearm and the upright arm by its moment."""
    machine, d = made("arm")
    b = d["forearm"]
    ei = E * section(d)[1]
    by_hand = 2 * b**2 / d["drive"] + bending(b, d) + axial(d["arm"], d) + b**2 * d["arm"] / ei
    assert compliance_at_home(machine)[2, 2] == pytest.approx(by_hand, rel=1e-9)


@pytest.mark.parametrize("kind", CLASSES)
def test_files_pass_the_check(kind: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = str(tmp_path / f"my-{kind}.yaml")
    assert main(["new", "--from", kind, file]) == 0
    assert main(["check", file]) == 0, capsys.readouterr().out
    machine = sm.load_machine(file)
    low, high = machine.workspace
    corners = [[(low, high)[b >> i & 1][i] for i in range(3)] for b in range(8)]
    assert machine.solve(corners, [10, 5, -8, 0, 0, 0]).ok.all()


def test_dimensions_are_options() -> None:
    assert main(["new", "--list"]) == 0
    with pytest.raises(StiffmapError, match=r"no class '3-rr'.*did you mean '3-rrr'"):
        machine_text("3-rr", "m", {})
    with pytest.raises(StiffmapError, match="--rod: a scara has no such dimension; it has: --arm"):
        machine_text("scara", "m", {"rod": 3.0})
    with pytest.raises(StiffmapError, match="--rod: expected more than radius"):
        machine_text("delta", "m", {"rod": 100.0})
    with pytest.raises(StiffmapError, match="--wall"):
        machine_text("gantry", "m", {"wall": 80.0})


def test_dimensions_need_a_class(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["new", str(tmp_path / "m.yaml"), "--radius", "300"]) == 2
    assert "--radius: only with --from" in capsys.readouterr().err


def test_a_length_that_is_changed_by_hand_moves_the_home_coordinates() -> None:
    """The starter says ``solve: true``: its home coordinates are a first guess."""
    text = machine_text("3-rrr", "mine", {})
    longer = text.replace("translation: [200, 0, 0]", "translation: [220, 0, 0]")
    assert longer.count("translation: [220, 0, 0]") == 1
    machine = sm.load_machine(longer)
    assert machine.solve(machine.description.home.p, [100.0, 0, 0, 0, 0, 0]).ok
