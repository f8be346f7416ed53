"""Where numbers come from, and how much of an answer rests on each."""

from __future__ import annotations

from pathlib import Path

import pytest

import stiffmap as sm
from stiffmap.model.description.machine import UNMARKED, in_words, source_of
from stiffmap.model.files.shipped import starter_text

STARTER = starter_text("m")


def starter(folder: Path, text: str = STARTER) -> sm.Machine:
    (folder / "m.yaml").write_text(text, encoding="utf-8")
    return sm.load_machine(folder / "m.yaml")


def test_numbers_elements_and_patterns(tmp_path: Path) -> None:
    d = starter(tmp_path).description
    assert source_of(d, "left.drive") == "measured"
    assert source_of(d, "left.bar") == UNMARKED
    marked = STARTER.replace(
        "\nhome:", '\nsources: {"*": catalogue, left.bar: computed, right: assumed}\nhome:', 1
    )
    d = starter(tmp_path, marked).description
    assert [source_of(d, n) for n in ("left.drive", "left.bar", "right.bar", "third.bar")] == [
        "measured", "computed", "assumed", "catalogue"]  # fmt: skip


def test_sources_are_saved(tmp_path: Path) -> None:
    m = sm.load_machine("orthoglide-revised")
    m.save(tmp_path / "o.yaml")
    again = sm.load_machine(tmp_path / "o.yaml")
    assert again.description.sources == m.description.sources
    assert source_of(again.description, "x.foot") == "assumed"


def test_an_unknown_source_is_refused(tmp_path: Path) -> None:
    with pytest.raises(sm.StiffmapError, match="assumed"):
        starter(tmp_path, STARTER.replace("source: measured", "source: guessed"))


def test_every_shipped_machine_is_marked() -> None:
    for name in sm.machine_names():
        m = sm.load_machine(name)
        force = [100.0, 0, 0, 0, 0, 0] if name == "five-bar" else [0, 0, 100.0, 0, 0, 0]
        budget = sm.deflection_budget(m, None, force)
        assert UNMARKED not in budget.sources, name
        assert sum(budget.by_source.values()) == pytest.approx(1.0)


def test_the_budget_says_what_it_rests_on() -> None:
    budget = sm.deflection_budget("orthoglide-revised", [0.3, 0.3, -0.2], [0, 300, 0, 0, 0, 0])
    sizes = {n: abs(s) for n, _, s in budget.ranked()}
    bars = sum(s for n, s in sizes.items() if n.endswith(".bar")) / sum(sizes.values())
    assert budget.by_source["computed"] == pytest.approx(bars)
    assert "rests on numbers that are assumed" in str(budget)
    assert in_words({UNMARKED: 1.0}) == ""
