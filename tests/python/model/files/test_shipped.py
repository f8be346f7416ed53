"""The shipped machines hold the declared numbers."""

from __future__ import annotations

import math

import numpy as np
import pytest

from stiffmap.model.description import Block, Body, Joint, MachineDescription, Spring
from stiffmap.model.description.tree import all_elements
from stiffmap.model.files import load_description, shipped_machines
from stiffmap.solve.compiled.lowering import home_gaps

NAMES = ["orthoglide-original", "orthoglide-revised", "tripteron"]


def by_name(description: MachineDescription) -> dict[str, object]:
    # a body may share its name with a spring; these tests ask for bodies by hand
    return {name: e for name, e in all_elements(description) if not isinstance(e, Body)}


def test_the_list_has_titles_and_sources() -> None:
    shipped = {machine.name: machine for machine in shipped_machines()}
    assert set(NAMES) <= set(shipped)
    for machine in shipped.values():
        assert machine.title
        assert machine.source
        assert load_description(machine.name).name == machine.name


@pytest.mark.parametrize("name", NAMES)
def test_home_closes(name: str) -> None:
    for gap in home_gaps(load_description(name)):
        assert gap.translation < 1e-15
        assert gap.rotation < 1e-15


# table 1 of the paper (mm, N, rad), bar length, width, r, foot h, EIz, EIx, GJ, EA (N mm²)
CASES = {
    "orthoglide-revised": (
        (3.10e-5, 3.54e-1, 6.91e-2, 0.39e-5, 0.33e-6, 1.74e-6),
        (775, 250, 77.5),
        (250, 2.0e10, 2.0e9, 1.5e10, 2.0e8),
        (2.4, 5.0, 6.0),
        (-1.060, -0.390, 2.0, 2000.0),
    ),
    "orthoglide-original": (
        (4.55e-5, 2.33e-1, 5.08e-2, 2.88e-5, 1.50e-6, 7.19e-6),
        (310, 100, 31),
        (100, 2.0e9, 2.0e8, 1.5e9, 1.0e8),
        (0.38, 0.8, 1.0),
        (-0.430, -0.155, 1.2, 600.0),
    ),
}
BLOCK_SCALE = np.array([1e-3, 1e-3, 1e-3, 1.0, 1.0, 1.0])  # mm -> m per translation index
LOAD_SCALE = np.array([1.0, 1.0, 1.0, 1e3, 1e3, 1e3])  # 1/(N mm) -> 1/(N m) per rotation index


def si(matrix: np.ndarray) -> np.ndarray:
    """Compliance in mm, N, rad, N mm to SI."""
    return matrix * np.outer(BLOCK_SCALE, LOAD_SCALE)


@pytest.mark.parametrize("name", CASES)
def test_orthoglide_springs(name: str) -> None:
    table, _, (h, eiz, eix, gj, ea), _, _ = CASES[name]
    bar = np.diag(table)
    bar[1, 5] = bar[5, 1] = math.sqrt(3) / 2 * math.sqrt(table[1] * table[5])
    bar[2, 4] = bar[4, 2] = -math.sqrt(3) / 2 * math.sqrt(table[2] * table[4])
    foot = np.diag([h**3 / (3 * eiz), h / ea, h**3 / (3 * eix), h / eix, h / gj, h / eiz])
    foot[0, 5] = foot[5, 0] = h**2 / (2 * eiz)
    foot[2, 3] = foot[3, 2] = -(h**2) / (2 * eix)
    elements = by_name(load_description(name))
    for leg in "xyz":
        for branch in ("low", "high"):
            spring = elements[f"{leg}.{branch}.bar"]
            assert isinstance(spring, Spring)
            np.testing.assert_allclose(np.array(spring.compliance), si(bar), rtol=1e-14)
        spring = elements[f"{leg}.foot"]
        assert isinstance(spring, Spring)
        np.testing.assert_allclose(np.array(spring.compliance), si(foot), rtol=1e-14)


@pytest.mark.parametrize("name", CASES)
def test_orthoglide_geometry_and_drives(name: str) -> None:
    _, (length, width, r), _, _, (low, high, speed, force) = CASES[name]
    description = load_description(name)
    elements = by_name(description)
    assert [leg.name for leg in description.legs] == ["x", "y", "z"]
    columns = {"x": "xyz", "y": "yzx", "z": "zxy"}
    for leg, permutation in columns.items():
        frame = elements[f"{leg}.frame"].nominal  # type: ignore[attr-defined]
        np.testing.assert_array_equal(frame.r, np.eye(3)[:, ["xyz".index(c) for c in permutation]])
        drive = elements[f"{leg}.actuator"]
        assert isinstance(drive, Joint)
        assert drive.home == (-(r + length) / 1000,)
        assert drive.law is not None
        assert drive.law.stiffness == pytest.approx(1 / 1.4e-7, rel=1e-15)
        assert drive.drive is not None
        assert drive.drive.range == (low, high)
        assert (drive.drive.speed, drive.drive.force) == (speed, force)
        assert drive.drive.encoder_error == 2e-6
        assert (drive.drive.coulomb_friction, drive.drive.viscous_friction) == (30.0, 50.0)
        assert elements[f"{leg}.low.length"].nominal.translation == (length / 1000, 0, 0)  # type: ignore[attr-defined]
        assert elements[f"{leg}.low.spread"].nominal.translation == (0, 0, -width / 2000)  # type: ignore[attr-defined]
        assert elements[f"{leg}.high.spread"].nominal.translation == (0, 0, width / 2000)  # type: ignore[attr-defined]


@pytest.mark.parametrize("name", CASES)
def test_orthoglide_bodies_stand_where_declared(name: str) -> None:
    _, (length, _, _), _, (bar, carriage, platform), _ = CASES[name]
    description = load_description(name)
    leg = description.legs[0].elements
    order = [element.name for element in leg]
    assert order.index("carriage") == order.index("foot") + 1
    block = next(e for e in leg if isinstance(e, Block))
    for branch in block.branches:
        sorts = [type(e).__name__ for e in branch.elements]
        assert sorts.index("Body") < sorts.index("Spring")
        body = next(e for e in branch.elements if isinstance(e, Body))
        assert body.mass == bar
        assert body.com == (length / 2000, 0, 0)
        assert body.inertia[1][1] == pytest.approx(bar * (length / 1000) ** 2 / 12, rel=1e-15)
    masses = {e.name: e.mass for _, e in all_elements(description) if isinstance(e, Body)}
    assert masses == {"bar": bar, "carriage": carriage, "platform": platform}


def test_tripteron_links_and_frames() -> None:
    length, diameter, young, shear = 0.75, 0.15, 7.0e10, 2.55e10
    area, second = math.pi * diameter**2 / 4, math.pi * diameter**4 / 64
    k = np.diag([young * area / length, *[12 * young * second / length**3] * 2, shear * 2 * second / length])
    k = np.pad(k, (0, 2)) + np.diag([0, 0, 0, 0, *[4 * young * second / length] * 2])
    k[1, 5] = k[5, 1] = -6 * young * second / length**2
    k[2, 4] = k[4, 2] = 6 * young * second / length**2
    description = load_description("tripteron")
    elements = by_name(description)
    half = math.pi / 2
    frames = {
        "1": (np.eye(3), (0, 0, 0)),
        "2": (turn("y", half) @ turn("z", math.pi), (0, 0.9, 0)),
        "3": (turn("x", -half), (0, 0, 0.9)),
    }
    for leg, (rotation, origin) in frames.items():
        frame = elements[f"{leg}.frame"].nominal  # type: ignore[attr-defined]
        np.testing.assert_allclose(frame.r, rotation, atol=1e-15)
        assert frame.translation == origin
        drive = elements[f"{leg}.actuator"]
        assert isinstance(drive, Joint)
        assert drive.law is not None
        assert drive.law.stiffness == 1e6
        for link in ("proximal_link", "distal_link"):
            spring = elements[f"{leg}.{link}"]
            assert isinstance(spring, Spring)
            np.testing.assert_allclose(np.linalg.inv(np.array(spring.compliance)), k, rtol=1e-12, atol=1e-6)
    assert description.workspace == ((0, 0, 0), (0.9, 0.9, 0.9))


def turn(axis: str, angle: float) -> np.ndarray:
    """Rotation matrix about a base axis."""
    i = "xyz".index(axis)
    j, k = (i + 1) % 3, (i + 2) % 3
    matrix = np.eye(3)
    matrix[j, j] = matrix[k, k] = math.cos(angle)
    matrix[k, j], matrix[j, k] = math.sin(angle), -math.sin(angle)
    return matrix
