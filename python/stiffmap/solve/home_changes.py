"""What closing the home configuration changes in a machine file."""

from __future__ import annotations

from typing import NamedTuple

from stiffmap.common.units import ANGLE, LENGTH
from stiffmap.model.description import Cable, Joint, MachineDescription
from stiffmap.model.description.tree import all_elements, core_name
from stiffmap.solve.compiled import CompiledMachine
from stiffmap.solve.compiled.ball import charted

CHANGED = 1e-9  # m, rad


class HomeChange(NamedTuple):
    """A home coordinate as the file declares it and as it closes (m, rad), and the address of its number."""

    name: str
    address: str
    declared: float
    closed: float
    angular: bool

    def text(self, machine: MachineDescription) -> str:
        """In the units of the file."""
        dimension = ANGLE if self.angular else LENGTH
        say = machine.units.say
        return (
            f"{self.name}: {say(self.declared, dimension, 10)} becomes {say(self.closed, dimension, 10)} "
            f"(a change of {say(self.closed - self.declared, dimension)})"
        )


def home_changes(machine: CompiledMachine) -> list[HomeChange]:
    """Joint coordinates that the closed home configuration changes by more than round-off."""
    closed = dict(zip(machine.names.coordinates, machine.home_coordinates().tolist(), strict=True))
    changes = []
    for full_name, e in all_elements(machine.description):
        name = core_name(full_name)
        if (
            not isinstance(e, Joint)
            or isinstance(e, Cable)
            or charted(e)[1] is not None
            or name in machine.spun_balls
        ):
            continue  # a free ball joint in axes of our own
        for i, declared in enumerate(e.home):
            part = "" if len(e.home) == 1 else f".{i + 1}"
            now = closed[name + part]
            if abs(now - declared) > CHANGED:
                address = f"{full_name}/home{part}"
                changes.append(HomeChange(name + part, address, declared, now, e.kind != "prismatic"))
    return changes
