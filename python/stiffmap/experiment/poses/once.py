"""What is found out once for a plan and all machines of one nominal geometry."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from typing import Any, Generic, TypeVar
from weakref import WeakKeyDictionary

from numpy.typing import NDArray

from stiffmap.common.kept import Kept
from stiffmap.experiment.experiment import Experiment
from stiffmap.model.description.rigid import nominal_geometry
from stiffmap.solve.machine import Machine

Array = TypeVar("Array", bound=NDArray[Any])


KEPT = 32
"""Arrays of one plan: a fit that moves a nominal point makes another geometry with every trial."""


class Once(Generic[Array]):
    """Arrays by plan, geometry and name, the last ones as long as the plan lives; not to be written to."""

    def __init__(self) -> None:
        self._known: WeakKeyDictionary[Experiment, Kept[Hashable, Array]] = WeakKeyDictionary()

    def get(self, plan: Experiment, machine: Machine, make: Callable[[], Array], name: str = "") -> Array:
        """The array of these; `make` is called where it is not known."""
        key = name, nominal_geometry(machine.description)
        return self._known.setdefault(plan, Kept(KEPT)).made(key, lambda: _frozen(make()))


def _frozen(made: Array) -> Array:
    made.flags.writeable = False
    return made
