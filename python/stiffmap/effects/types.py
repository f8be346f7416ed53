"""What an effect is: a named deviation of the real machine, with bounded parameters."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from stiffmap.description import MachineDescription

Place = tuple[str, tuple[str, ...]]


@dataclass(frozen=True)
class Parameter:
    """One number of an effect, in SI.

    ``null`` is the value at which the effect vanishes (``None``: there is no fixed one), ``scale`` a
    typical size for steps and plots, ``default`` the value of a parameter that is left out (``None``:
    it must be given). A parameter that is not ``fitted`` says how the effect is meant (a pivot, a
    recorded temperature) and is known beforehand. ``angular`` is the unit on a joint that turns, with an upper
    bound and a typical size of its own where those of a length mean nothing.
    """

    name: str
    unit: str
    lower: float
    upper: float
    null: float | None
    scale: float
    doc: str
    default: float | None = None
    fitted: bool = True
    angular: str = ""
    angular_upper: float | None = None
    angular_scale: float | None = None


@dataclass(frozen=True)
class Option:
    """A choice in words; the first one is the default."""

    name: str
    choices: tuple[str, ...]
    doc: str


@dataclass(frozen=True)
class Placed:
    """An effect on one machine: where, with all values (SI) and options filled in."""

    kind: str
    element: str
    legs: tuple[str, ...]
    values: Mapping[str, float]
    options: Mapping[str, str]


Apply = Callable[[MachineDescription, Placed], MachineDescription]
Places = Callable[[MachineDescription], list[Place]]
ParametersAt = Callable[[MachineDescription, str, tuple[str, ...]], tuple[Parameter, ...]]
Derived = Callable[[MachineDescription, Placed], dict[str, float]]


@dataclass(frozen=True)
class EffectType:
    """One kind of effect.

    doc, pivot, frame, moves
        Definition; the point about which it turns; the axes its numbers are in; what goes with it.
    places
        Every (element, legs) of a machine where it makes physical sense: each leg alone, then all.
    apply
        The machine with the effect; a pure function. ``None`` for what lives in the measurement
        (``measurement``), which the diagnosis applies to the readings.
    one_of
        Parameters of which exactly one is given. ``vector``: at least one is given, the rest are null.
    excludes
        Kinds that cannot share an element and leg with it; with its own name it cannot be repeated.
    stage
        Effects are applied by ascending stage, so that the order in which they were added is no matter.
    needs
        What an experiment must record beside pose, load and reading (``temperature``, ``order``).
    at
        Parameters with the units and bounds of one place (a revolute drive counts in rad).
    tried
        Places that a diagnosis tries as an explanation; None: all of them.
    derived
        Further numbers that a report shows, computed from the parameters.
    """

    kind: str
    title: str
    doc: str
    parameters: tuple[Parameter, ...]
    places: Places
    apply: Apply | None
    pivot: str = "none"
    frame: str = "none"
    moves: str = "nothing"
    options: tuple[Option, ...] = ()
    one_of: tuple[str, ...] = ()
    vector: tuple[str, ...] = ()
    excludes: tuple[str, ...] = ()
    stage: int = 0
    needs: tuple[str, ...] = ()
    measurement: bool = False
    at: ParametersAt | None = None
    derived: Derived | None = None
    tried: Places | None = None
    default_element: str | None = field(default=None)

    def parameter(self, name: str) -> Parameter:
        """The parameter of that name; KeyError where there is none."""
        return {p.name: p for p in self.parameters}[name]

    def parameters_at(
        self, description: MachineDescription, element: str, legs: tuple[str, ...]
    ) -> tuple[Parameter, ...]:
        """Parameters with the units and bounds that hold at this place."""
        return self.at(description, element, legs) if self.at else self.parameters

    def units_of(self, name: str) -> tuple[str, ...]:
        """The unit of a parameter, and the one that it has on a joint that turns."""
        p = self.parameter(name)
        return (p.unit, p.angular) if p.angular else (p.unit,)

    @property
    def fitted(self) -> tuple[Parameter, ...]:
        """Parameters that a fit may move; of alternatives the first one."""
        return tuple(p for p in self.parameters if p.fitted and p.name not in self.one_of[1:])
