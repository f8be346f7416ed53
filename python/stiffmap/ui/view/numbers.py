"""The numbers of a machine as controls: found by a part of their address, typed, scaled, put back."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from stiffmap.model.addresses import listed
from stiffmap.ui.view.model import addresses
from stiffmap.ui.view.moment import Moment
from stiffmap.ui.view.state import ViewState

if TYPE_CHECKING:
    from viser import GuiApi

DECADE = 1.0


class ChangedNumbers:
    """One number at a time, and a list of those that are changed."""

    def __init__(self, controls: Any, gui: GuiApi, moment: Moment) -> None:
        self._put, names = controls.put, self._list(moment)
        self._find = gui.add_text("Find", "", hint="part of an address")
        self._address = gui.add_dropdown("Number", names, initial_value=names[0])
        self._value = gui.add_number("Value, SI", 0.0)
        self._scale = gui.add_slider("Power of ten on the file's value", -DECADE, DECADE, 0.01, 0.0)
        controls.typed(self._value, lambda m, v: m.change(self._address.value, float(v)))
        controls.typed(
            self._scale,
            lambda m, v: m.change(
                self._address.value, self.all[self._address.value] * 10 ** float(v), keep=False
            ),
            keep=False,
        )
        put_back = controls.does(lambda m: m.change(self._address.value, None))
        gui.add_button("As in the file").on_click(put_back)
        gui.add_button("All as in the file").on_click(controls.does(lambda m: m.put(changes=())))
        self._changed = gui.add_text("Changed", "nothing", multiline=True, disabled=True)

        self._find.on_update(lambda e: None if e.client_id is None else self._search(e.target.value))
        self._address.on_update(lambda e: controls.viewer.worker.ask())

    def _search(self, part: str) -> None:
        self._address.options = tuple(a for a in self.all if part.lower() in a.lower()) or tuple(self.all)

    def show(self, state: ViewState) -> None:
        """The chosen number as it is now, and all that are changed."""
        address, given = self._address.value, dict(state.changes)
        plain = self.all.get(address, 0.0)
        now = given.get(address, plain)
        self._put(self._value, now)
        power = float(np.log10(now / plain)) if plain and now / plain > 0 else 0.0
        self._put(self._scale, round(float(np.clip(power, -DECADE, DECADE)), 2))
        lines = [
            f"{a} = {v:.6g} {self._units.get(a, 'SI')}"
            + (f", file: {self.all[a]:.6g}" if a in self.all else "")
            for a, v in given.items()
        ]
        write(self._changed, "value", "\n".join(lines) or "nothing")

    def renew(self, moment: Moment) -> None:
        """The machine's file has changed."""
        self._address.options = self._list(moment)

    def _list(self, moment: Moment) -> tuple[str, ...]:
        """Addresses that may be changed; what the file says of each is kept."""
        d = moment.machine.description
        self.all = addresses(d)
        self._units = {n.address: n.unit for n in listed(d.declared or d)}
        return tuple(self.all)


def write(handle: object, field: str, value: object) -> None:
    """Only what differs is sent."""
    if getattr(handle, field) != value:
        setattr(handle, field, value)
