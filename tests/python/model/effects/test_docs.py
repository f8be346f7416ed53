"""docs/effects.md says what the registry says, and its examples run."""

from __future__ import annotations

import re
import textwrap
from pathlib import Path

import pytest
from docs.effects_table import BEGIN, END, reference

from stiffmap.model.description import AppliedEffect
from stiffmap.model.effects import EffectType, get, kinds, parse_effect
from stiffmap.model.effects.apply import resolve

PAGE = (Path(__file__).parents[4] / "docs" / "effects.md").read_text(encoding="utf-8")


def test_page_holds_the_registry():
    written = PAGE.partition(BEGIN)[2].partition(END)[0].strip()
    assert written == reference(), "run: python docs/effects_table.py"


@pytest.mark.parametrize("kind", kinds())
def test_kind_says_its_definition(kind):
    effect = get(kind)
    assert effect.kind == kind and effect.doc.endswith(".") and effect.title
    assert effect.measurement == (effect.apply is None)
    for p in effect.parameters:
        assert p.unit and p.doc and p.lower < p.upper and p.scale > 0
        assert p.null is None or p.lower <= p.null <= p.upper
    turns = any(p.name.startswith("angle_") for p in effect.parameters)
    assert not turns or effect.frame != "none"


@pytest.mark.parametrize("text", re.findall(r'^--effect "(.*)"$', PAGE, re.MULTILINE))
def test_texts_of_the_page(orthoglide, text):
    r = parse_effect(text)
    given = {**dict(r.parameters), **dict(r.options)}
    orthoglide.with_effect(r.kind, element=r.element or None, legs=r.legs or None, **given)


def test_first_example_runs(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    exec(re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)[0], {})
    assert (tmp_path / "real.yaml").exists()


def test_effect_of_the_page_works(orthoglide):
    code = textwrap.dedent(re.findall(r"    ```python\n(.*?)    ```", PAGE, re.DOTALL)[0])
    space: dict = {}
    exec(code, space)
    effect: EffectType = space["EFFECT"]
    declared = orthoglide.description
    assert effect.places(declared)[0] == ("actuator", ("x",))
    record = AppliedEffect("stiffer", "actuator", ("x",), (("factor", 2.0),))
    changed = effect.apply(declared, resolve(effect, declared, record))
    before, after = (d.legs[0].elements[1].law.stiffness for d in (declared, changed))
    assert after == 2.0 * before
