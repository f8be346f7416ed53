"""At its null value an effect changes nothing, anywhere that it may be put; the same elements stay."""

from __future__ import annotations

import numpy as np
import pytest

import stiffmap as sm
from stiffmap.common.errors import StiffmapError
from stiffmap.model.description import Block, MachineDescription
from stiffmap.model.effects import EffectType, add_effect, get, kinds

MACHINE_KINDS = [k for k in kinds() if not get(k).measurement]
POSES = {
    "orthoglide-revised": [[0.12, -0.08, 0.21], [-0.15, 0.06, -0.09]],
    "tripteron": [[0.3, 0.4, 0.5], [0.2, 0.6, 0.35]],
}
WRENCH = [250.0, -100.0, 60.0, 0.0, 0.0, 0.0]


def given(effect: EffectType, parameters: tuple, away: float) -> dict[str, float]:
    """Fitted parameters ``away`` typical sizes from null; known ones at any value."""
    fitted = {p.name: (p.null or 0.0) + away * p.scale for p in parameters if p.fitted and p.null is not None}
    free = {p.name: p.scale for p in parameters if p.fitted and p.null is None and p.default is None}
    known = {
        p.name: 0.3 for p in parameters if not p.fitted and p.default is None and p.name not in effect.one_of
    }
    return {**fitted, **free, **known}


def some_places(effect: EffectType, description: MachineDescription) -> list:
    """The first leg's and the last of each name: every name once alone and once for all."""
    by_name: dict[str, list] = {}
    for place in effect.places(description):
        by_name.setdefault(place[0], []).append(place)
    return [p for places in by_name.values() for p in {places[0], places[-1]}]


def names(elements: tuple) -> list[str]:
    out = []
    for e in elements:
        out.append(f"{type(e).__name__} {e.name}")
        if isinstance(e, Block):
            out += [n for b in e.branches for n in names(b.elements)]
    return out


def topology(d: MachineDescription) -> list[str]:
    chains = [d.base, *(leg.elements for leg in d.legs), d.platform]
    return [n for c in chains for n in names(c)] + [s.name for s in d.external_springs]


@pytest.mark.parametrize("name", POSES)
@pytest.mark.parametrize("kind", MACHINE_KINDS)
def test_null_is_the_plain_machine_with_the_elements_of_any_value(kind, name, request):
    plain = request.getfixturevalue(name.split("-")[0])
    effect, description = get(kind), plain.description
    expected = {method: plain.solve(POSES[name], WRENCH, method=method) for method in ("fast", "reference")}
    for element, legs in some_places(effect, description):
        parameters = effect.parameters_at(description, element, legs)
        null, some = (
            add_effect(
                description, kind, element=element, legs=legs or None, **given(effect, parameters, away)
            )
            for away in (0.0, 1.0)
        )
        machine = sm.Machine(null)
        got = machine.solve(POSES[name], WRENCH)
        by_reference = bool((got.flags & sm.Flag.REFERENCE_PATH).any())  # some effects leave the fast path
        same = expected["reference" if by_reference or machine.fast else "fast"]
        # m and rad; the last Newton step of the one may be one more than that of the other
        assert np.abs(got.displacement - same.displacement).max() < 1e-14, (element, legs)
        assert topology(null) == topology(some)
        assert null.effects[0].element == element and null.effects[0].legs == legs


CABLES = {"cable_anchor", "cable_mass", "cable_stretch", "guide_friction"}


@pytest.mark.parametrize(
    "kind", [k for k in MACHINE_KINDS if k not in CABLES]
)  # tests/python/workspace/cables/test_effects.py
def test_each_kind_does_something(kind, orthoglide):
    effect, description = get(kind), orthoglide.description
    element, legs = effect.places(description)[0]
    parameters = effect.parameters_at(description, element, legs)
    changed = orthoglide.with_effect(
        kind, element=element, legs=legs or None, **given(effect, parameters, 1.0)
    )
    difference = (
        changed.solve(POSES["orthoglide-revised"], WRENCH).displacement
        - orthoglide.solve(POSES["orthoglide-revised"], WRENCH).displacement
    )
    assert np.abs(difference[:, :3]).max() > 1e-8


@pytest.mark.parametrize("kind", [k for k in kinds() if get(k).measurement])
def test_kinds_of_the_measurement_are_not_put_into_a_machine(kind, orthoglide):
    with pytest.raises(StiffmapError, match="lives in the measurement"):
        orthoglide.with_effect(kind, **{get(kind).parameters[0].name: 1.0})
