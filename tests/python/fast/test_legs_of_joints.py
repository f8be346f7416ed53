"""Legs of six joints alone that end in a ball: their tangent by blocks (docs/fast_path.md F12)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from agreement import TOLERANCE, compare
from tests.python.oracle.classes import Classes
from tests.python.oracle.unseen import cable_suspension

import stiffmap as sm
from stiffmap import _core
from stiffmap.description import Joint, Law, MachineDescription


def struts() -> MachineDescription:
    """The suspension's cables as struts that push as well, their drives on both sides of the balls' order."""
    d = cable_suspension()

    def pushes(leg_elements: tuple) -> tuple:
        return tuple(
            replace(e, law=Law(9e5)) if isinstance(e, Joint) and e.actuated else e for e in leg_elements
        )

    return replace(d, legs=tuple(replace(leg, elements=pushes(leg.elements)) for leg in d.legs))


MACHINES = {"struts": struts(), "locked balls": Classes(5).task("locked balls").description}


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
