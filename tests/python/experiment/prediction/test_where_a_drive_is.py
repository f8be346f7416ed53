"""Play stays behind wherever in the machine's tree its drive is: in a leg, in a branch of a block, under all legs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from stiffmap.experiment import predict, random_plan
from stiffmap.model.description import Block, Branch, Element, Joint, Law, Leg, MachineDescription, Pose
from stiffmap.solve.machine import Machine

AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
GAP = Law(1e6, knots=((1e-4, 0.0), (1e-2, 9.9e3)))


def drive(name: str, law: Law) -> Joint:
    return Joint(name, "prismatic", (AXES[name],), (0.0,), actuated=True, law=law)


X, REST = drive("x", GAP), (drive("y", Law(2e6)), drive("z", Law(3e6)))
FOLLOWS = replace(X, name="guide", actuated=False, law=None)
PLACES: dict[str, tuple[tuple[Element, ...], tuple[Element, ...]]] = {
    "leg": ((), (X, *REST)),
    "base": ((X,), REST),
    "branch": ((), (Block("pair", (Branch("one", (X,)), Branch("two", (FOLLOWS,)))), *REST)),
}


@pytest.mark.parametrize("where", PLACES)
def test_play_stays_behind_by_half_of_itself_on_the_side_it_came_from(where: str) -> None:
    base, elements = PLACES[where]
    box = ((-0.1,) * 3, (0.1,) * 3)
    machine = Machine(
        MachineDescription(
            "gantry", (Leg("a", elements),), base=base, home=Pose.of((0.0, 0.0, 0.0)), workspace=box
        )
    )
    plan = random_plan(machine, "position", poses=4, seed=1)
    way = np.array([[1.0, 0.5, 0.2], [-1.0, 0.5, 0.2]])[np.arange(len(plan)) % 2]
    shown = predict(machine, replace(plan, approach=way, wrench=np.zeros_like(plan.wrench)))
    np.testing.assert_allclose(shown[:, :3], -1e-4 * np.sign(way[:, :1]) * [1.0, 0.0, 0.0], atol=1e-12)
