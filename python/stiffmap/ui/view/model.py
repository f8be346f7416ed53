"""A machine that is looked at: its state, what follows from it, and what a hand does to it. Knows no browser."""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from dataclasses import replace
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import StiffmapError
from stiffmap.common.kept import Kept
from stiffmap.common.number_text import place_text
from stiffmap.model.addresses import listed
from stiffmap.model.description import AppliedEffect, MachineDescription
from stiffmap.model.effects import apply_records
from stiffmap.solve.compiled import Status
from stiffmap.solve.kinematics import follow, inverse_kinematics
from stiffmap.solve.machine import Machine, load_machine
from stiffmap.ui.view.moment import Moment, moves
from stiffmap.ui.view.state import History, ViewState, state_of

KEPT_MACHINES = 16


class ViewModel:
    """State, history and what they mean; every method that changes anything says what went wrong by StiffmapError."""

    def __init__(
        self,
        machine: Machine,
        state: ViewState | None = None,
        *,
        file: str | PathLike[str] | None = None,
        meshes: Path | None = None,
    ) -> None:
        """`file`: where the machine was read from, for commands that make the same picture and for reloading; `meshes`: the URDF
        whose meshes are drawn."""
        self.file = None if file is None else Path(file)
        self.meshes = meshes
        self.declared = machine
        self._machines: Kept[Hashable, Machine] = Kept(KEPT_MACHINES)
        self.history = History(state or first_state(machine))
        self.message = ""
        self._check(self.state)

    @property
    def state(self) -> ViewState:
        """What is on the screen."""
        return self.history.now

    @property
    def machine(self) -> Machine:
        """The machine with its changed numbers."""
        return self._with(self.state.changes)

    @property
    def moment(self) -> Moment:
        """What is on the screen now."""
        return Moment(self.machine, self.state, self.meshes)

    def _with(self, changes: tuple[tuple[str, float], ...]) -> Machine:
        declared = self.declared
        key = (id(declared), changes)
        return self._machines.made(key, lambda: changed(declared, dict(changes)))

    def _check(self, state: ViewState) -> None:
        k = inverse_kinematics(
            self._with(state.changes), state.position, state.turned, start=state.start_array, threads=1
        )
        if int(k.status) != Status.CONVERGED:
            where = place_text(state.position)
            raise StiffmapError(f"{self.declared.name} cannot reach {where} with this orientation")

    def put(self, *, keep: bool = True, **values: Any) -> ViewState:
        """New values of the state; all or none. The message on the screen is cleared."""
        new = state_of(**(vars(self.state) | values))
        if {"position", "rotation", "start", "changes"} & set(values):
            self._check(new)
        self.message = ""
        self.history.put(new, keep=keep)
        return new

    def change(self, address: str, value: float | None, *, keep: bool = True) -> ViewState:
        """A number of the machine (SI) by its address; None: as in the file."""
        if value is not None and not np.isfinite(value):
            raise StiffmapError(f"{address}: expected a finite number, got {value}")
        return self.put(changes=self.state.changed(address, value).changes, keep=keep)

    def drag(self, position: Floats, rotation: Floats | None = None) -> ViewState:
        """The tool follows a hand (m; (3, 3), None: as it is) as far as the machine goes; `message` says what stops it.

        Not kept for undo: call `history.mark` when a drag begins.
        """
        m, s = self.machine, self.state
        now = self.moment.rotation
        wanted = np.array(position, dtype=float)
        if not np.isfinite(wanted).all():
            raise StiffmapError(f"position: expected 3 finite numbers, got {wanted.tolist()}")
        for i, axis in enumerate("xyz"):
            if axis not in m.description.task:
                wanted[i] = s.position[i]
        turned = now if rotation is None else np.asarray(rotation)
        reached, taken, self.message = follow(m, (np.array(s.position), now), (wanted, turned), s.start_array)
        x, y, z = (float(v) for v in reached)
        turn = s.rotation
        if rotation is not None:
            a, b, c = (float(v) for v in Rotation.from_matrix(taken).as_rotvec())
            turn = (a, b, c)
        self.history.put(replace(s, position=(x, y, z), rotation=turn), keep=False)
        return self.state

    def undo(self) -> ViewState:
        """Back by one step."""
        self.message = ""
        return self.history.undo()

    def reset(self) -> ViewState:
        """As it was opened."""
        self.message = ""
        return self.history.reset()

    def reload(self) -> None:
        """Read the machine's file again; FileError with its line where it is wrong, and nothing changes then."""
        if self.file is None:
            return
        new = load_machine(self.file)
        before, self.declared = self.declared, new
        try:
            self._check(self.state)
        except StiffmapError:
            self.declared = before
            raise


def first_state(machine: Machine) -> ViewState:
    """At home, on the plane with the most commanded axes: z before y before x."""
    x, y, z = map(float, machine.description.home.p)
    free = moves(machine)
    plane = max("zyx", key=lambda a: sum(free[i] for i in range(3) if "xyz"[i] != a))
    return ViewState((x, y, z), plane=plane)


EFFECTS = "effects"
"""How the address of a parameter of an effect begins, ``effects/NUMBER/parameter``; all others are those of `Machine.numbers`."""


def addresses(description: MachineDescription) -> dict[str, float]:
    """Every address that may be changed, with its value."""
    own = {n.address: n.value for n in listed(description.declared or description)}
    return own | _of_effects(description.effects)


def _of_effects(records: tuple[AppliedEffect, ...]) -> dict[str, float]:
    return {f"{EFFECTS}/{i}/{name}": value for i, r in enumerate(records) for name, value in r.parameters}


def changed(machine: Machine, changes: Mapping[str, float]) -> Machine:
    """The machine with numbers changed; StiffmapError for an unknown address or an impossible machine."""
    own = {a: v for a, v in changes.items() if a.partition("/")[0] != EFFECTS}
    of_effects = {a: v for a, v in changes.items() if a not in own}
    if own:
        machine = machine.with_numbers(own)
    return _with_effects(machine, of_effects) if of_effects else machine


def _with_effects(machine: Machine, changes: Mapping[str, float]) -> Machine:
    d = machine.description
    values = _of_effects(d.effects)
    for address in changes:
        if address not in values:
            known = ", ".join(values) or "no address of effects: there are none"
            raise StiffmapError(f"{address}: expected {known}")
    values |= changes
    records = tuple(
        replace(r, parameters=tuple((n, values[f"{EFFECTS}/{i}/{n}"]) for n, _ in r.parameters))
        for i, r in enumerate(d.effects)
    )
    bare = replace(d.declared or d, effects=(), declared=None)
    return Machine(apply_records(bare, records), like=machine)
