"""A machine of other dimensions, closed anew: on the assembly branch that the machine has now."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

from stiffmap.common.errors import HomeError
from stiffmap.common.units import ANGLE, LENGTH
from stiffmap.model.addresses import Listed, known_values, listed, with_values
from stiffmap.model.addresses.setting import single_addresses
from stiffmap.model.description import Cable, Joint, MachineDescription
from stiffmap.model.description.tree import all_elements, core_name
from stiffmap.model.effects import apply_records
from stiffmap.solve.compiled import CompiledMachine
from stiffmap.solve.compiled.ball import charted

SMALLEST_STEP = 1 / 256
CHANGED = 1e-9  # m, rad


def redesigned(description: MachineDescription, values: Mapping[str, float]) -> MachineDescription:
    """The description with other numbers (SI) at these addresses, its effects added again.

    Where the home coordinates do not close the new machine, they are followed there: the numbers go over in small steps, each
    closed from the one before it, so that the machine stays on its assembly branch. A home that is searched for is the one that
    was found: a search with other numbers might end on another branch.
    StiffmapError for an unknown address or a bad value; HomeError where the numbers reach no machine that closes.
    """
    declared = settled(description.declared or description)
    target = with_values(declared, values)
    try:
        CompiledMachine(target)
    except HomeError as problem:
        target = _followed(declared, values, problem)
    return apply_records(target, description.effects) if description.effects else target


def on_branch_of(base: MachineDescription, other: MachineDescription) -> MachineDescription:
    """`other`, which differs from `base` in numbers alone, with its home on the assembly branch that a search finds for `base`; as it
    is where its home is declared. HomeError where the numbers reach no machine that closes."""
    if not other.search_home:
        return other
    start, end = settled(base.declared or base), other.declared or other
    now = {row.address: row.value for row in listed(start)}
    changes = {
        row.address: row.value
        for row in listed(end)
        if not _of_home(row) and row.address in now and row.value != now[row.address]
    }
    there = redesigned(start, changes)
    homes = {row.address: row.value for row in listed(there) if _of_home(row) and row.address in now}
    end = replace(with_values(end, homes), search_home=False)
    return apply_records(end, other.effects) if other.effects else end


def _of_home(row: Listed) -> bool:
    return row.address.partition("/")[2].startswith("home")


def settled(description: MachineDescription) -> MachineDescription:
    """The description whose home is declared by the coordinates that a search found."""
    if not description.search_home:
        return description
    return replace(closed(description, CompiledMachine(description)), search_home=False)


def _followed(
    start: MachineDescription, values: Mapping[str, float], problem: HomeError
) -> MachineDescription:
    ends = {one: float(v) for address, v in values.items() for one in single_addresses(start, address)}
    begins = {one: known_values(start, one)[0] for one in ends}
    at, step, now = 0.0, 0.5, start
    while at < 1.0:
        share = min(1.0, at + step)
        between = {k: v if share == 1.0 else begins[k] + share * (v - begins[k]) for k, v in ends.items()}
        try:
            tried = with_values(now, between)
            now = closed(tried, CompiledMachine(tried))
        except HomeError:
            step /= 2
            if step < SMALLEST_STEP:
                raise HomeError(
                    f"{problem}; followed from the machine's present numbers, it closes up to "
                    f"{100 * at:.0f} % of the change"
                ) from None
            continue
        at = share
    return now


def closed(description: MachineDescription, machine: CompiledMachine) -> MachineDescription:
    """The description with the home coordinates that close it."""
    return with_values(description, {change.address: change.closed for change in home_changes(machine)})


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
        if not isinstance(e, Joint) or isinstance(e, Cable):
            continue
        if charted(e)[1] is not None or name in machine.spun_balls:
            continue  # a free ball joint in axes of our own
        for i, declared in enumerate(e.home):
            part = "" if len(e.home) == 1 else f".{i + 1}"
            now = closed[name + part]
            if abs(now - declared) > CHANGED:
                address = f"{full_name}/home{part}"
                changes.append(HomeChange(name + part, address, declared, now, e.kind != "prismatic"))
    return changes
