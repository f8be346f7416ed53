"""Every bad file gives one clear error: file, key, what was expected and what was found."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest
from tests.python.model.files.machine_text import BASE, ELEMENTS, changed, description, with_element

from stiffmap.common.errors import FileError, FileErrors, StiffmapError, UnknownMachineError
from stiffmap.model.files import load_description


def message(text: str) -> str:
    """The error of a text; it names the file and is one line."""
    with pytest.raises(StiffmapError) as caught:
        description(text)
    told = str(caught.value)
    assert told.startswith("small.yaml")
    assert "\n" not in told
    return told


def test_the_base_is_sound() -> None:
    assert description(BASE).name == "small"
    assert description(changed()) == description(BASE)


def test_unknown_machine_lists_and_suggests() -> None:
    with pytest.raises(UnknownMachineError, match=r"did you mean 'tripteron'.*orthoglide-revised"):
        load_description("tripterom")


def test_missing_file() -> None:
    with pytest.raises(UnknownMachineError, match=r"no file 'nowhere/machine.yaml'"):
        load_description("nowhere/machine.yaml")


def test_syntax_error_has_its_line() -> None:
    told = message("name: small\nunits: {length: mm\nlegs: 3\n")
    assert "not valid YAML" in told
    assert "line 3" in told


@pytest.mark.parametrize(
    ("text", "words"), [("", "empty"), ("- 1\n", "is a mapping"), ("a: *b", "not valid")]
)
def test_not_a_machine(text: str, words: str) -> None:
    assert words in message(text)


def test_not_text(tmp_path: Path) -> None:
    (tmp_path / "m.yaml").write_bytes(b"\xff\xfe\x00name")
    with pytest.raises(FileError, match="not UTF-8"):
        load_description(tmp_path / "m.yaml")


SPRING = (*ELEMENTS, 1)
BAD: list[tuple[str, tuple[tuple[Any, ...], Any], list[str]]] = [
    ("wrong type", ((*ELEMENTS, 3, "translation"), "long"), ["elements[3].translation", "'long'"]),
    ("text for a number", ((*ELEMENTS, 0, "compliance"), "stiff"), ["[0].compliance", "expected a number"]),
    ("true for a number", ((*ELEMENTS, 0, "compliance"), True), ["[0].compliance", "expected a number"]),
    ("missing key", ((*ELEMENTS, 2, "kind"), ...), ["elements[2]", "missing key 'kind'"]),
    ("missing units", (("units",), ...), ["missing key 'units'"]),
    ("missing unit", (("units", "angle"), ...), ["units", "missing key 'angle'"]),
    ("unknown key", ((*ELEMENTS, 0, "stifness"), 1.0), ["stifness", "did you mean 'stiffness'"]),
    ("unknown key at the top", (("gravitty",), 1.0), ["gravitty", "did you mean 'gravity'"]),
    ("unknown unit", (("units", "length"), "furlong"), ["units.length", "furlong", "'mm'"]),
    ("unknown kind", ((*ELEMENTS, 2, "kind"), "revolut"), ["[2].kind", "did you mean 'revolute'"]),
    ("zero axis", ((*ELEMENTS, 2, "axis"), [0, 0, 0]), ["[2].axis", "zero-length axis"]),
    ("strange axis", ((*ELEMENTS, 2, "axis"), "w"), ["[2].axis", "expected an axis", "'w'"]),
    ("nan", ((*ELEMENTS, 3, "translation"), [0.0, math.nan, 0.0]), ["translation[1]", "finite", "nan"]),
    ("infinity", ((*ELEMENTS, 0, "compliance"), {"value": math.inf}), ["[0].compliance", "finite"]),
    ("negative u", ((*ELEMENTS, 0, "compliance"), {"value": 1.0, "u": -1.0}), ["compliance.u"]),
    ("two numbers", ((*ELEMENTS, 3, "translation"), [0, 1]), ["translation", "expected 3 entries; found 2"]),
    ("duplicate name", ((*ELEMENTS, 3, "offset"), "pin"), ["elements[3]", "'pin' is taken"]),
    ("bad name", ((*ELEMENTS, 3, "offset"), "a.b"), ["[3].offset", "letters, digits"]),
    ("no law", ((*ELEMENTS, 0, "compliance"), ...), ["elements[0]", "exactly one of", "found none"]),
    ("zero compliance", ((*ELEMENTS, 0, "compliance"), 0.0), ["[0].compliance", "positive"]),
    ("two sorts", ((*ELEMENTS, 3, "joint"), "x"), ["elements[3]", "exactly one of the keys offset"]),
    ("empty range", ((*ELEMENTS, 0, "range"), [10, 5]), ["[0].range", "not below"]),
    ("gravity in mm", (("gravity",), [0, 0, -9810]), ["gravity", "m/s^2"]),
    ("no legs", (("legs",), {}), ["legs"]),
    ("unknown template", (("legs", "a"), {"template": "arm"}), ["legs.a.template", "no template 'arm'"]),
    ("unknown joint", (("legs", "a", "home"), {"pim": 1.0}), ["legs.a.home.pim", "did you mean 'pin'"]),
    ("loose rotation", (("home",), {"rotation": [[1, 0.1, 0], [0, 1, 0], [0, 0, 1]]}), ["off by 0.1"]),
    ("left-handed", (("home",), {"axes": "yxz"}), ["home.axes", "left-handed"]),
    *((f"{key} twice", ((key,), ["x", "y", "x"]), [key, "expected different names, got 'x' twice"]) for key in ("task", "freedoms")),
    ("leg twice", (("effects",), [{"kind": "dead_zone", "element": "drive", "legs": ["a", "a"]}]), ["effects[0].legs", "expected different names, got 'a' twice"]),
    ("axes twice", (("home",), {"axes": "xxz"}), ["home.axes", "yzx"]),
    ("two rotations", (("home", "axes"), "yzx"), ["home", "only one of axes, turns"]),
    ("five terms", ((*SPRING, "compliance"), [1, 1, 1, 1, 1]), ["[1].compliance", "6 entries; found 5"]),
    ("no diagonal term", ((*SPRING, "compliance"), {"k11": 1.0}), ["[1].compliance", "k22"]),
    ("no such entry", ((*SPRING, "compliance"), {"k71": 1.0}), ["[1].compliance", "k71"]),
    ("no such point", (("external_springs",), {"hose": {"point": "a.tip", "anchor": [0, 0, 0],
      "stiffness": 1, "length": 1}}), ["external_springs.hose.point", "a.tip"]),
    ("no link file", ((*ELEMENTS, 1), {"spring": "foot", "link": "f.yaml"}), ["[1].link", "no link file"]),
]  # fmt: skip


@pytest.mark.parametrize(("change", "words"), [b[1:] for b in BAD], ids=[b[0] for b in BAD])
def test_bad_files(change: tuple[tuple[Any, ...], Any], words: list[str]) -> None:
    told = message(changed(change))
    for word in words:
        assert word in told, told


def test_asymmetric_spring_tells_the_size() -> None:
    rows = [[1e-4 if i == j else 0.0 for j in range(6)] for i in range(6)]
    rows[1][2], rows[2][1] = 2e-5, 1.5e-5
    told = message(changed(((*SPRING, "compliance"), rows)))
    assert "not symmetric" in told
    assert "k23 and k32 differ by 0.05 " in told


def test_indefinite_spring_tells_the_eigenvalue() -> None:
    entries = {f"k{i}{i}": 1e-4 for i in range(1, 7)} | {"k12": 1.5e-4}
    told = message(changed(((*SPRING, "compliance"), entries)))
    assert "indefinite" in told
    assert "-0.5" in told


def test_coupling_to_a_rigid_direction_is_indefinite() -> None:
    entries = {f"k{i}{i}": 1e-4 for i in range(1, 6)} | {"k66": 0.0, "k26": 1e-9}
    assert "indefinite" in message(changed(((*SPRING, "compliance"), entries)))


def test_negative_diagonal_is_indefinite() -> None:
    assert "indefinite" in message(changed(((*SPRING, "compliance"), [1, 1, -1e-9, 1, 1, 1])))


def test_key_given_twice_names_the_line() -> None:
    told = message(BASE + "legs: {}\n")
    assert "'legs' is given twice" in told
    assert "line 12" in told


def test_body_may_share_a_spring_name_but_not_a_body_name() -> None:
    description(with_element({"body": "foot", "mass": 1.0}))
    text = changed(
        ((*ELEMENTS, 4), {"body": "b", "mass": 1.0}),
        ((*ELEMENTS, 5), {"body": "b", "mass": 1.0}),
    )
    assert "'b' is taken by an earlier body" in message(text)


def test_line_of_a_wrong_value() -> None:
    told = message(BASE.replace("axis: z", "axis: q"))
    assert "line 9" in told


def test_beam_says_which_products_it_needs() -> None:
    told = message(with_element({"spring": "b", "beam": {"length": 1.0, "along": "-y", "EA": 1.0}}))
    assert "EA, GJ, EIz, EIx" in told
    assert "found EA" in told


def test_unknown_material() -> None:
    beam = {"length": 1.0, "round": {"diameter": 1.0}, "material": "steel"}
    assert "unknown material 'steel'" in message(with_element({"spring": "b", "beam": beam}))


@pytest.mark.parametrize(
    ("material", "said"),
    [
        ({"E": "210 000", "nu": 0.3}, "material.E: expected a number; found text ('210 000')"),
        ({"E": 2, "1e5": None, "nu": 0.3}, "material: unknown key '1e5' (decimals stand behind a point: 0.5); known keys: E, G, nu, density"),
        ({"E": 1.0}, "material: give exactly one of G and nu"), ({"nu": 0.3}, "material: missing key 'E'"),
        ({"E": 1.0, "nu": 30.0}, "material.nu: must be above -1 and at most 0.5 (a laminate with more: give G); found 30.0"),
        ([1.0, 0.3], "material: expected a mapping with keys among E, G, nu, density; found a list ([1.0, 0.3])"),
    ],
)  # fmt: skip
def test_a_mistake_in_one_form_of_a_value_is_told_alone(material: object, said: str) -> None:
    beam = {"length": 1.0, "round": {"diameter": 1.0}, "material": material}
    assert message(with_element({"spring": "b", "beam": beam})).endswith(said)


def test_law_on_a_coupled_direction() -> None:
    entries = {f"k{i}{i}": 1e-4 for i in range(1, 7)} | {"k26": 1e-5}
    spring = {"spring": "s", "compliance": entries, "laws": {"ty": {"stiffness": 1.0}}}
    told = message(with_element(spring))
    assert "laws.ty" in told
    assert "couples" in told


@pytest.mark.parametrize("mass", [10**400, {"value": 10**400}])
def test_numbers_beyond_double(mass: object) -> None:
    message(with_element({"body": "b", "mass": mass}))


def test_numbers_that_units_carry_beyond_double() -> None:
    assert "too large" in message(with_element({"spring": "s", "compliance": [1, 1, 1, 1e308, 1, 1]}))


def test_leg_called_base() -> None:
    assert "cannot be a leg's name" in message(BASE.replace("  a:\n", "  base:\n"))


def test_a_wrong_value_beside_an_unknown_key_is_told_as_well() -> None:
    with pytest.raises(FileErrors) as caught:
        description(
            BASE.replace("gravity:", "gravitty:").replace("compliance: 1", "compliance: x") + "zzz: 1\n"
        )
    told = [str(p) for p in caught.value.problems]
    assert len(told) == 2, told


def test_twenty_problems_are_told_and_the_rest_counted() -> None:
    with pytest.raises(FileErrors) as caught:
        description(BASE + "".join(f"wrong{i}: 1\n" for i in range(50)))
    assert len(caught.value.problems) == 50
    lines = str(caught.value).split("\n")
    assert len(lines) == 21
    assert lines[-1] == "... and 30 more problems in this file"
