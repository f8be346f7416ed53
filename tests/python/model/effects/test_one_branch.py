"""An effect on one bar of several in a block."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import stiffmap as sm
from stiffmap.identification.candidates.candidates import clash, of_kind
from stiffmap.model.description import Element, Spring
from stiffmap.model.description.tree import edit
from stiffmap.model.effects import apply_records, get, parse_effect

AT = np.array([[0.03, -0.02, 0.05], [-0.1, 0.08, 0.0]])
FORCE = np.array([120.0, -60.0, 90.0, 0.0, 0.0, 0.0])


def machine() -> sm.Machine:
    return sm.load_machine("orthoglide-revised")


def softened(branch: str, scale: float) -> sm.Machine:
    """The bar of one branch of leg y alone, its matrix multiplied by hand."""

    def change(e: Element) -> Element:
        if not isinstance(e, Spring):
            return e
        assert e.compliance is not None
        return replace(e, compliance=tuple(tuple(scale * v for v in row) for row in e.compliance))

    edited = edit(machine().description, f"y.{branch}.bar", change)
    assert edited is not None
    return sm.Machine(edited)


@pytest.mark.parametrize("branch", ["low", "high"])
def test_compliance_of_one_bar_is_that_of_its_matrix(branch: str) -> None:
    made = machine().with_effect("compliance", element=f"{branch}.bar", legs="y", scale=4.0)
    found, wanted = (m.solve(AT, FORCE).displacement for m in (made, softened(branch, 4.0)))
    np.testing.assert_array_equal(found, wanted)
    both = machine().with_effect("compliance", element="bar", legs="y", scale=4.0)
    assert np.abs(found - both.solve(AT, FORCE).displacement).max() > 1e-6


@pytest.mark.parametrize(
    ("kind", "numbers"), [("compliance", {"scale": 3.0}), ("joint_compliance", {"translation": 2e-8})]
)
def test_both_bars_one_after_the_other_are_the_pair(kind: str, numbers: dict[str, float]) -> None:
    made = machine()
    for branch in ("low", "high"):
        made = made.with_effect(kind, element=f"{branch}.bar", legs="z", **numbers)
    pair = machine().with_effect(kind, element="bar", legs="z", **numbers)
    found, wanted = (m.solve(AT, FORCE).displacement for m in (made, pair))
    np.testing.assert_allclose(found, wanted, rtol=1e-9, atol=1e-15)


def test_a_bar_and_the_pair_that_it_is_of_exclude_each_other() -> None:
    made = machine().with_effect("joint_compliance", element="bar", legs="x", translation=1e-8)
    with pytest.raises(sm.StiffmapError, match="exclude each other"):
        made.with_effect("joint_compliance", element="low.bar", legs="x", translation=1e-8)
    found = {c.place: c for c in of_kind(get("joint_compliance"), machine().description)}
    one = found["joint_compliance", "low.bar", ("x",)]
    assert clash(one, [found["joint_compliance", "bar", ("x",)]])
    assert not clash(one, [found["joint_compliance", "high.bar", ("x",)]])
    assert not clash(one, [found["joint_compliance", "bar", ("y",)]])


def test_single_bars_are_tried_in_one_leg_at_a_time() -> None:
    places = [c.place[1:] for c in of_kind(get("compliance"), machine().description)]
    branches = [p for p in places if p[0] in ("low.bar", "high.bar")]
    assert branches == [(f"{b}.bar", (leg,)) for leg in "xyz" for b in ("low", "high")]
    tree = [c.element for c in of_kind(get("compliance"), sm.load_machine("ur10").description)]
    assert not any(e.count(".") and not e.rpartition(".")[2].startswith("k") for e in tree)


def test_a_bar_that_one_branch_alone_has_needs_no_branch() -> None:
    named = edit(machine().description, "x.low.bar", lambda e: replace(e, name="rod"))
    assert named is not None
    places = [c.place[1:] for c in of_kind(get("compliance"), named)]
    assert ("rod", ("x",)) in places and ("bar", ("x",)) in places
    assert not [p for p in places if p in (("low.rod", ("x",)), ("low.bar", ("x",)), ("high.bar", ("x",)))]
    assert ("low.bar", ("y",)) in places


def test_a_file_and_a_line_have_it_too(tmp_path: Path) -> None:
    given = machine().with_effect("compliance", element="low.bar", legs="x", scale=2.5)
    given.save(tmp_path / "machine.yaml")
    again = sm.load_machine(tmp_path / "machine.yaml")
    line = parse_effect("compliance low.bar x scale=2.5", machine().description)
    words = sm.Machine(apply_records(machine().description, [line]))
    for m in (again, words):
        np.testing.assert_array_equal(m.solve(AT, FORCE).displacement, given.solve(AT, FORCE).displacement)


def test_an_unknown_branch_is_an_error_that_lists_the_names() -> None:
    with pytest.raises(sm.StiffmapError, match=r"no element 'left.bar'.*low.bar, high.bar"):
        machine().with_effect("compliance", element="left.bar", legs="x", scale=2.0)
