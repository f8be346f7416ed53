"""What is found out once for a plan and all machines of one nominal geometry."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from typing import Any, Generic, TypeVar
from weakref import WeakKeyDictionary

from numpy.typing import NDArray

from stiffmap.description.rigid import nominal_geometry
from stiffmap.experiment.experiment import Experiment
from stiffmap.machine import Machine

Array = TypeVar("Array", bound=NDArray[Any])


class Once(Generic[Array]):
    """Arrays by plan, geometry and name, as long as the plan lives; not to be written to."""

    def __init__(self) -> None:
        self._known: WeakKeyDictionary[Experiment, dict[Hashable, Array]] = WeakKeyDictionary()

    def get(self, plan: Experiment, machine: Machine, make: Callable[[], Array], name: str = "") -> Array:
        """The array of these; `make` is called where it is not known."""
        known = self._known.setdefault(plan, {})
        key = name, nominal_geometry(machine.description)
        if key not in known:
            made = make()
            made.flags.writeable = False
            known[key] = made
        return known[key]
