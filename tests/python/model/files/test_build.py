"""What a file says, in SI."""

from __future__ import annotations

import math
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from tests.python.model.files.machine_text import BASE, ELEMENTS, changed, description, with_element

from stiffmap.common.units import Dimension, UnitSystem
from stiffmap.model.beams import rectangle_section
from stiffmap.model.description import Element, ExternalSpring, Joint, Law, Offset, Spring
from stiffmap.model.link import LinkFile, save_link


def last(text: str) -> Element:
    """Last element of the leg."""
    return description(text).legs[0].elements[-1]


@pytest.mark.parametrize("tenths", range(1, 10000, 37))
def test_millimetres_become_the_nearest_double(tenths: int) -> None:
    mm = UnitSystem("mm")
    assert mm.to_si(tenths / 10, Dimension(length=1)) == float(f"{tenths}e-4")


def test_derived_units() -> None:
    units = UnitSystem("mm", "kN", "deg", "g")
    assert units.to_si(1.0, Dimension(length=1, force=-1)) == 1e-6
    assert units.to_si(1.0, Dimension(force=1, length=-2)) == 1e9
    assert units.to_si(1.0, Dimension(mass=1, length=2)) == 1e-9
    assert units.to_si(90.0, Dimension(angle=1)) == math.pi / 2


def test_angles_and_lengths() -> None:
    small = description(BASE)
    pin = small.legs[0].elements[2]
    assert isinstance(pin, Joint)
    assert pin.home == (math.pi / 2,)
    assert small.home.translation == (0.775, 0.0, 0.0)
    assert small.home.rotation == ((0.0, -1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0))


def test_numbers_as_yaml_1_2_reads_them() -> None:
    text = BASE.replace("compliance: 1.0e-4", "stiffness: 1e4").replace("name: small", "name: no")
    drive = description(text).legs[0].elements[0]
    assert isinstance(drive, Joint)
    assert drive.law == Law(1e7)
    assert description(text).name == "no"


def test_uncertainty_of_a_compliance_becomes_that_of_the_stiffness() -> None:
    path = ("legs", "a", "elements", 0, "compliance")
    small = description(changed((path, {"value": 1e-4, "u": 1e-6, "note": "bench"})))
    ((key, u),) = small.uncertainty
    assert key == "a.drive/stiffness"
    assert u == pytest.approx(0.01 * 1e7)
    assert small.notes == (("a.drive/stiffness", "bench"),)


def test_uncertainties_are_keyed_by_full_names() -> None:
    element = {"offset": "o", "translation": [1, {"value": 2, "u": 0.5}, 3], "note": "drawing"}
    small = description(with_element(element))
    assert small.uncertainty == (("a.o/translation.y", 0.0005),)
    assert small.notes == (("a.o", "drawing"),)


@pytest.mark.parametrize("along", ["x", "y", "z", "-x", "-y", "-z"])
def test_a_beam_along_any_axis_is_the_turned_beam_along_x(along: str) -> None:
    def compliance(beam: dict[str, object]) -> np.ndarray:
        spring = last(with_element({"spring": "b", "beam": {"length": 500, **beam}}))
        assert isinstance(spring, Spring)
        return np.array(spring.compliance)

    a = "xyz".index(along[-1])
    order = [a, (a + 1) % 3, (a + 2) % 3]
    products = dict(zip(["EI" + "xyz"[i] for i in order[1:]], [3.0e9, 5.0e9], strict=True))
    turned = compliance({"along": along, "EA": 1e8, "GJ": 2e9, **products})
    straight = compliance({"EA": 1e8, "GJ": 2e9, "EIy": 3.0e9, "EIz": 5.0e9})
    rotation = np.eye(3)[:, order]
    if along.startswith("-"):  # half a turn about the beam's second axis
        rotation = rotation @ np.diag([-1.0, 1.0, -1.0])
    both = np.kron(np.eye(2), rotation)
    np.testing.assert_allclose(turned, both @ straight @ both.T, rtol=1e-14, atol=1e-30)


def test_beam_closed_form_against_its_energy() -> None:
    """Compliance of the end = integral of the section forces' energy (Castigliano), by quadrature."""
    length, ea, gj, eiy, eiz = 0.5, 1e8, 2e3, 3e3, 5e3
    element = {"length": 500, "EA": 1e8, "GJ": 2e9, "EIy": 3e9, "EIz": 5e9}
    spring = last(with_element({"spring": "b", "beam": element}))
    assert isinstance(spring, Spring)
    total = np.zeros((6, 6))
    nodes, weights = np.polynomial.legendre.leggauss(4)
    for s, w in zip((nodes + 1) * length / 2, weights * length / 2, strict=True):
        arm = np.array([[0, 0, 0], [0, 0, -(length - s)], [0, length - s, 0]])  # r x f, r along x
        section = np.block([[np.eye(3), np.zeros((3, 3))], [arm, np.eye(3)]])
        total += w * section.T @ np.diag([1 / ea, 0, 0, 1 / gj, 1 / eiy, 1 / eiz]) @ section
    np.testing.assert_allclose(np.array(spring.compliance), total, rtol=1e-13, atol=1e-22)


def section_products(beam: dict[str, object]) -> np.ndarray:
    """EA, GJ, EIy, EIz in SI of a beam 1 m long with E = 1, G = 1 N/m²."""
    material = {"E": 1e-6, "G": 1e-6}
    spring = last(with_element({"spring": "b", "beam": {"length": 1000, "material": material, **beam}}))
    assert isinstance(spring, Spring)
    return 1.0 / np.diag(np.array(spring.compliance))[[0, 3, 4, 5]]


def test_sections() -> None:
    d = 0.04
    circle = [math.pi * d**2 / 4, math.pi * d**4 / 32, math.pi * d**4 / 64, math.pi * d**4 / 64]
    np.testing.assert_allclose(section_products({"round": {"diameter": 40}}), circle, rtol=1e-14)
    small = section_products({"round": {"diameter": 30}})
    tube = section_products({"tube": {"outer": 40, "inner": 30}})
    np.testing.assert_allclose(tube, np.array(circle) - small, rtol=1e-13)
    w, h = 0.03, 0.02
    rectangle = section_products({"rectangle": {"width": 30, "height": 20}})
    np.testing.assert_allclose(rectangle[[0, 2, 3]], [w * h, w * h**3 / 12, h * w**3 / 12], rtol=1e-14)
    hollow = section_products({"hollow": {"width": 30, "height": 20, "wall": 2}})
    np.testing.assert_allclose(hollow[0], w * h - 0.026 * 0.016, rtol=1e-13)
    np.testing.assert_allclose(hollow[2], (w * h**3 - 0.026 * 0.016**3) / 12, rtol=1e-13)


def test_torsion_of_a_square_and_of_a_strip() -> None:
    """0.140577 a^4 and a b^3 (1/3 - 0.21 b/a): the textbook values (Timoshenko & Goodier, art. 109)."""
    square = section_products({"rectangle": {"width": 10, "height": 10}})
    assert square[1] == pytest.approx(0.140577 * 0.01**4, rel=1e-5)
    strip = section_products({"rectangle": {"width": 1, "height": 100}})
    assert strip[1] == pytest.approx(0.1 * 0.001**3 * (1 / 3 - 0.21 * 0.01), rel=1e-4)


@pytest.mark.parametrize("ratio", [1.0, 1.07, 2.5, 40.0, 3000.0])
def test_torsion_of_a_rectangle_is_the_whole_series(ratio: float) -> None:
    """Saint-Venant's series, 10^4 terms of it, along either side: both are exact."""

    def series(a: float, b: float) -> float:
        terms = math.fsum(math.tanh(n * math.pi * a / (2 * b)) / n**5 for n in range(1, 20001, 2))
        return a * b**3 / 3 * (1 - 192 / math.pi**5 * b / a * terms)

    found = rectangle_section(0.01, 0.01 * ratio).torsion
    assert found == pytest.approx(series(0.01 * ratio, 0.01), rel=1e-15)
    if ratio < 3:  # the series along the short side loses digits in a strip
        assert found == pytest.approx(series(0.01, 0.01 * ratio), rel=2e-14)


def test_turns_follow_each_other() -> None:
    turns = [{"about": "y", "by": 90}, {"about": "z", "by": 180}]
    offset = last(with_element({"offset": "o", "turns": turns}))
    other = last(with_element({"offset": "o", "axes": "z-yx"}))
    assert isinstance(offset, Offset)
    assert offset.nominal == other.nominal  # type: ignore[union-attr]


def test_matrix_forms_agree() -> None:
    entries = {f"k{i}{i}": float(i) for i in range(1, 7)} | {"k62": 0.5}
    rows = np.diag([1.0, 2.0, 3.0, 4.0, 5.0, 6.0])
    rows[1, 5] = rows[5, 1] = 0.5
    assert last(with_element({"spring": "s", "stiffness": entries})) == last(
        with_element({"spring": "s", "stiffness": rows.tolist()})
    )


def test_templates_with_homes_inside_blocks() -> None:
    branch = [{"joint": "pin", "kind": "revolute", "axis": "y"}]
    template = [{"block": "pair", "branches": {"low": branch, "high": branch}}]
    legs = {"a": {"template": "t", "home": {"high.pin": 30.0}}, "b": {"template": "t"}}
    small = description(changed((("templates",), {"t": template}), (("legs",), legs)))
    (block,) = small.legs[0].elements
    homes = [branch.elements[0].home[0] for branch in block.branches]  # type: ignore[union-attr]
    assert homes == [0.0, math.radians(30.0)]


def test_link_files_give_their_compliance(tmp_path: object, monkeypatch: pytest.MonkeyPatch) -> None:
    import sys
    from pathlib import Path
    from types import ModuleType, SimpleNamespace

    from stiffmap.model.files import load_description

    module = ModuleType("stiffmap.model.link")
    link = SimpleNamespace(compliance=np.eye(6) * 1e-6, covariance=np.zeros((36, 36)))
    module.load_link = lambda path: link  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "stiffmap.model.link", module)
    folder = Path(str(tmp_path))
    (folder / "bar.yaml").write_text("{}", encoding="utf-8")
    (folder / "m.yaml").write_text(with_element({"spring": "b", "link": "bar.yaml"}), encoding="utf-8")
    machine = load_description(folder / "m.yaml")
    spring = machine.legs[0].elements[-1]
    assert isinstance(spring, Spring)
    np.testing.assert_array_equal(np.array(spring.compliance), np.eye(6) * 1e-6)
    assert machine.notes == (("a.b/link", "bar.yaml"),)


LOADED = """
import sys, stiffmap as sm
sm.load_machine(sys.argv[1])
print(*sorted(m for m in sys.modules if m.startswith("stiffmap.model.link.")))
"""


@pytest.mark.parametrize("named", [False, True], ids=["no link file", "a link file"])
def test_links_are_read_but_not_identified(named: bool, tmp_path: Path) -> None:
    """Only a machine that names a link file loads `model.link`, and then what reads files and moves matrices alone."""
    link = LinkFile(np.eye(6) * 1e-6, np.zeros((36, 36)), np.zeros(3), {})
    save_link(link, tmp_path / "bar.yaml")
    text = with_element(
        {"spring": "b", "link": "bar.yaml"} if named else {"spring": "b", "compliance": [1e-6] * 6}
    )
    (tmp_path / "m.yaml").write_text(text, encoding="utf-8")
    done = subprocess.run(
        [sys.executable, "-c", LOADED, tmp_path / "m.yaml"], capture_output=True, text=True, check=False
    )
    loaded = [name.rpartition(".")[2] for name in done.stdout.split()]
    assert loaded == (["linkfile", "transport"] if named else []), done.stderr


@pytest.mark.parametrize("point", ["tcp", "a.tip", "platform.nose"])
def test_springs_outside_pull_at_the_tool_or_at_named_points(point: str) -> None:
    at = {"tip": (*ELEMENTS, 4), "nose": ("platform",)}
    spring = {"point": point, "anchor": [0, 0, 100], "stiffness": 2.0, "length": 50}
    d = description(
        changed(
            (at["tip"], {"point": "tip"}),
            (at["nose"], [{"point": "nose"}]),
            (("external_springs",), {"hose": spring}),
        )
    )
    assert d.external_springs == (ExternalSpring("hose", point, (0.0, 0.0, 0.1), 2000.0, 0.05),)
