"""Legs of six joints alone that end in a ball: their tangent by blocks (docs/fast_path.md F12)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.oracle.classes import Classes
from tests.oracle.unseen import cable_suspension
from tests.python.solve.compiled.agreement import TOLERANCE, compare

import stiffmap as sm
from stiffmap import _core
from stiffmap.model.description import Element, Joint, Law, Leg, MachineDescription


def struts(ball: Law | None = None) -> MachineDescription:
    """The suspension's cables as struts that push as well, their balls free or elastic."""
    d = cable_suspension()

    def changed(e: Element) -> Element:
        if not isinstance(e, Joint):
            return e
        if e.actuated:
            return replace(e, law=Law(9e5))
        return replace(e, law=ball) if e.kind == "spherical" else e

    def leg(of: Leg) -> Leg:
        return replace(of, elements=tuple(changed(e) for e in of.elements))

    return replace(d, legs=tuple(leg(of) for of in d.legs))


MACHINES = {
    "struts": struts(),
    "elastic balls": struts(Law(2e3)),
    "locked balls": Classes(5).task("locked balls").description,
}


@pytest.mark.parametrize("level", _core.kernel_levels())
@pytest.mark.parametrize("name", MACHINES)
def test_both_paths_agree(name: str, level: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("STIFFMAP_ISA", level)
    d = MACHINES[name]
    box = (tuple(d.home.p - 0.03), tuple(d.home.p + 0.03))
    machine = sm.Machine(replace(d, workspace=box))
    rng = np.random.default_rng(3)
    position = rng.uniform(*machine.workspace, (24, 3))
    wrench = rng.normal(size=(24, 6)) * [800, 800, 800, 30, 30, 30]
    wrench[::6] = 0
    for gravity in ((0, 0, 0), (1.0, 2.0, -9.0)):
        fast = machine.solve(position, wrench, gravity=gravity)
        assert fast.reference_share < 0.2
        gap = compare(fast, machine.solve(position, wrench, gravity=gravity, method="reference"))
        assert gap.statuses == 0
        assert gap.poses > 20
        assert gap.worst() < TOLERANCE
        assert np.median(fast.iterations) < 5
