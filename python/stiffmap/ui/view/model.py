"""A machine that is looked at: its state, what follows from it, and what a hand does to it. Knows no browser."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import StiffmapError
from stiffmap.common.recent import Recent
from stiffmap.solve.compiled import Status
from stiffmap.solve.kinematics import inverse_kinematics
from stiffmap.solve.machine import Machine, load_machine
from stiffmap.ui.view.changes import changed
from stiffmap.ui.view.moment import Moment
from stiffmap.ui.view.place import first_plane, orientation, rotation_of
from stiffmap.ui.view.reach import follow
from stiffmap.ui.view.state import History, State, checked, with_change

KEPT_MACHINES = 16


class Model:
    """State, history and what they mean; every method that changes anything says what went wrong by StiffmapError."""

    def __init__(
        self, machine: Machine, state: State | None = None, *, file: str | Path | None = None
    ) -> None:
        """`file`: where the machine was read from, for commands that make the same picture and for reloading."""
        self.file = None if file is None else Path(file)
        self.declared = machine
        self._machines: Recent[Machine] = Recent(KEPT_MACHINES)
        home = machine.description.home.p
        first = State((float(home[0]), float(home[1]), float(home[2])), plane=first_plane(machine))
        self.history = History(checked(state) if state else first)
        self.message = ""
        self._check(self.state)

    @property
    def state(self) -> State:
        """What is on the screen."""
        return self.history.now

    @property
    def machine(self) -> Machine:
        """The machine with its changed numbers."""
        return self._with(self.state.changes)

    @property
    def moment(self) -> Moment:
        """What is on the screen now."""
        return Moment(self.machine, self.state)

    def _with(self, changes: tuple[tuple[str, float], ...]) -> Machine:
        declared = self.declared
        key = (id(declared), changes)
        return self._machines.get(key, lambda: changed(declared, dict(changes)))

    def _check(self, state: State) -> None:
        k = inverse_kinematics(
            self._with(state.changes), state.position, orientation(state), start=state.start_array, threads=1
        )
        if int(k.status) != Status.CONVERGED:
            where = ", ".join(f"{1e3 * v:g}" for v in state.position)
            raise StiffmapError(f"{self.declared.name} cannot reach ({where}) mm with this orientation")

    def put(self, *, keep: bool = True, **values: Any) -> State:
        """New values of the state; all or none. The message on the screen is cleared."""
        new = checked(replace(self.state, **values))
        if {"position", "rotation", "start", "changes"} & set(values):
            self._check(new)
        self.message = ""
        self.history.put(new, keep=keep)
        return new

    def change(self, address: str, value: float | None, *, keep: bool = True) -> State:
        """A number of the machine (SI) by its address; None: as in the file."""
        if value is not None and not np.isfinite(value):
            raise StiffmapError(f"{address}: expected a finite number, got {value}")
        return self.put(changes=with_change(self.state, address, value).changes, keep=keep)

    def drag(self, position: Floats, rotation: Floats | None = None) -> State:
        """The tool follows a hand (m; (3, 3), None: as it is) as far as the machine goes; `message` says what stops it.

        Not kept for undo: call `history.mark` when a drag begins.
        """
        m, s = self.machine, self.state
        now = rotation_of(m, s)
        wanted = np.array(position, dtype=float)
        if not np.isfinite(wanted).all():
            raise StiffmapError(f"position: expected 3 finite numbers, got {wanted.tolist()}")
        for i, axis in enumerate("xyz"):
            if axis not in m.description.task:
                wanted[i] = s.position[i]
        turned = now if rotation is None else np.asarray(rotation)
        reached = follow(m, (np.array(s.position), now), (wanted, turned), s.start_array)
        x, y, z = (float(v) for v in reached.position)
        turn = s.rotation
        if rotation is not None:
            a, b, c = (float(v) for v in Rotation.from_matrix(reached.rotation).as_rotvec())
            turn = (a, b, c)
        self.message = reached.stopped_by
        self.history.put(replace(s, position=(x, y, z), rotation=turn), keep=False)
        return self.state

    def undo(self) -> State:
        """Back by one step."""
        self.message = ""
        return self.history.undo()

    def reset(self) -> State:
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
