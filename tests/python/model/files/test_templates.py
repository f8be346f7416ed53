"""Templates with parameters are what they are written out to be; every problem of a file is told at once."""

from __future__ import annotations

import pytest

from stiffmap.common.arithmetic import sum_of_numbers
from stiffmap.common.errors import FileError, FileErrors, StiffmapError
from stiffmap.model.files import description_from_text, description_text

HEAD = """
name: pair
units: {length: mm, force: N, angle: deg}
home: {translation: [500, 0, 0]}
materials: {steel: {E: 2.1e5, nu: 0.3}}
"""
TEMPLATE = (
    HEAD
    + """
templates:
  strut:
    parameters: {rod: 500, tube: {value: 40, u: 0.05}, mass: null}
    elements:
      - {actuator: drive, kind: prismatic, axis: x, home: 500 - $rod, compliance: 1.0e-5}
      - {offset: length, translation: [$rod, 0, 0]}
      - {body: rod, mass: $mass, com: [-$rod/2, 0, 0]}
      - spring: tube
        beam: {length: $rod, tube: {outer: $tube, inner: $tube - 2*4}, material: steel}
legs:
  a: {template: strut, with: {mass: 3}}
  b: {template: strut, with: {rod: 480, tube: 45, mass: 2.5}}
"""
).replace("home: 500 - $rod", 'home: "500 - $rod"')


def leg(rod: float, outer: str, inner: float, mass: float) -> str:
    return f"""
    elements:
      - {{actuator: drive, kind: prismatic, axis: x, home: {500 - rod}, compliance: 1.0e-5}}
      - {{offset: length, translation: [{rod}, 0, 0]}}
      - {{body: rod, mass: {mass}, com: [{-rod / 2}, 0, 0]}}
      - spring: tube
        beam: {{length: {rod}, tube: {{outer: {outer}, inner: {inner}}}, material: steel}}"""


WRITTEN = (
    HEAD + "\nlegs:\n  a:" + leg(500, "{value: 40, u: 0.05}", 32, 3) + "\n  b:" + leg(480, "45", 37, 2.5)
)


def test_a_template_is_what_it_is_written_out_to_be() -> None:
    d = description_from_text(TEMPLATE)
    assert d == description_from_text(WRITTEN)
    assert dict(d.uncertainty) == {"a.tube/beam.tube.outer": pytest.approx(5e-5)}
    assert description_from_text(description_text(d)) == d
    assert description_from_text(TEMPLATE.replace("strut", "1")) == d  # a name that reads as a number


def problems(text: str) -> list[FileError]:
    with pytest.raises(FileError) as caught:
        description_from_text(text, "pair.yaml")
    error = caught.value
    return list(error.problems) if isinstance(error, FileErrors) else [error]


@pytest.mark.parametrize(
    ("old", "new", "line", "words"),
    [
        ("with: {mass: 3}", "note: none", 17, "needs mass"),
        (
            "rod: 480",
            "rood: 480",
            18,
            r"no parameter 'rood' \(did you mean 'rod'\?\); there are: rod, tube, mass",
        ),
        ("mass: $mass", "mass: $mas", 13, r"no parameter 'mas' \(did you mean 'mass'\?\)"),
        ("-$rod/2", "-$rod/", 13, r"expected \$name, or numbers and \$names"),
        ("-$rod/2", "$rod**2", 13, r"expected \$name, or numbers and \$names"),
        ("    elements:", "    element:", 10, "unknown key 'element'"),
    ],
)
def test_mistakes_have_their_line(old: str, new: str, line: int, words: str) -> None:
    assert TEMPLATE.count(old) == 1
    found = problems(TEMPLATE.replace(old, new))
    assert any(p.line == line for p in found), [str(p) for p in found]
    with pytest.raises(FileError, match=words):
        raise found[0] if len(found) == 1 else FileErrors(found)


def test_a_leg_without_parameters_takes_no_with() -> None:
    with pytest.raises(StiffmapError, match="has no parameters"):
        description_from_text(WRITTEN.replace("  a:\n", "  a:\n    with: {rod: 3}\n"))


@pytest.mark.parametrize(("text", "value"), [("-500/2", -250.0), ("2*(40 - 8.5)", 63.0), ("1e3+1", 1001.0)])
def test_formulas(text: str, value: float) -> None:
    assert sum_of_numbers(text) == value


@pytest.mark.parametrize(
    "text", ["__import__('os')", "a", "2**3", "f(1)", "True", "[1]", "1 if 2 else 3", "'a'"]
)
def test_formulas_are_numbers_only(text: str) -> None:
    with pytest.raises(SyntaxError):
        sum_of_numbers(text)


def test_all_mistakes_of_the_schema_at_once() -> None:
    bad = WRITTEN.replace("axis: x", "axis: q").replace("mass: 3", "mas: 3").replace("home: {tr", "hom: {tr")
    found = problems(bad)
    keys = [p.key for p in found]
    assert "" in keys  # hom
    assert sum("axis" in k for k in keys) == 2
    assert any("mas" in p.reason for p in found)
    assert [p.line for p in found] == sorted(p.line or 0 for p in found)


def test_all_mistakes_of_the_numbers_at_once() -> None:
    bad = (
        WRITTEN.replace("inner: 32", "inner: 52")
        .replace("inner: 37", "inner: 57")
        .replace("mass: 3", "mass: -3")
    )
    found = problems(bad)
    assert len(found) == 3 and len({p.line for p in found}) == 3
    assert str(FileErrors(found)).count("\n") == 2
    assert {p.key.split(".")[1] for p in found} == {"a", "b"}


def test_all_legs_that_misuse_templates_at_once() -> None:
    legs = "  a: {template: strut}\n  b: {template: strud}\n  c: {template: strut, with: {tub: 3, mass: 1}}\n"
    found = problems(TEMPLATE[: TEMPLATE.index("  a: {")] + legs)
    assert [p.key for p in found] == ["legs.a", "legs.b.template", "legs.c.with.tub"]
    assert "no template 'strud' (did you mean 'strut'?); there are: strut" in found[1].reason


def test_a_template_is_named_by_a_word() -> None:
    (found,) = problems(TEMPLATE.replace("a: {template: strut,", "a: {template: [strut],"))
    assert found.key == "legs.a.template" and "expected text" in found.reason
