"""What an effect is: a named deviation of the real machine, with bounded parameters."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from stiffmap.model.description import Joint, MachineDescription, Spring
from stiffmap.model.description.tree import all_elements
from stiffmap.model.effects.evidence import (
    Drive,
    Load,
    Option as Option,
    Parameter as Parameter,
    Plan,
    Reading,
    Signatures,
)

Place = tuple[str, tuple[str, ...]]


@dataclass(frozen=True)
class Placed:
    """An effect on one machine: where, with all values (SI) and options filled in."""

    kind: str
    element: str
    legs: tuple[str, ...]
    values: Mapping[str, float]
    options: Mapping[str, str]


def is_revolute(description: MachineDescription, element: str) -> bool:
    """Whether the joint of that name, or the spring's direction (``foot.k44``), turns."""
    whole, entry = entry_of(element)
    named = [e for _, e in all_elements(description) if e.name == whole.rpartition(".")[2]]
    if entry is not None and any(isinstance(e, Spring) for e in named):
        return entry > 2
    return any(isinstance(e, Joint) and e.kind != "prismatic" for e in named)


def same_part(one: str, other: str) -> bool:
    """Whether two names stand for the same element, or one of them for that of all branches of which the other names one."""
    return one == other or one.endswith(f".{other}") or other.endswith(f".{one}")


def entry_of(element: str) -> tuple[str, int | None]:
    """The name of a spring and the number of the diagonal entry that ``foot.k22`` names; None: none of them."""
    match = re.fullmatch(r"(.+)\.k([1-6])\2", element)
    return (match[1], int(match[2]) - 1) if match else (element, None)


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
        The machine with the effect; a pure function. ``None`` for what lives in the measurement.
    load, reading
        What it does to the wrench that acts, and to what is read (`evidence`).
    drive
        A drive's deflection while its force runs, for effects that remember earlier rows.
    one_of
        Parameters of which exactly one is given. ``vector``: at least one is given, the rest are null.
    excludes
        Kinds that cannot share an element and leg with it; with its own name it cannot be repeated.
    stage
        Effects are applied by ascending stage, so that the order in which they were added is no matter.
    precedence
        Of two kinds that readings cannot distinguish the lower one is named; kinds are listed in this order.
    needs
        What an experiment must record besides pose, load and reading, from `evidence.RECORDS`. ``better_with``: what
        it should record.
    hidden
        Whether a plan cannot show it: its metrology loop leaves it out, or an unknown frame takes it up.
    behind_platform
        Whether its elements sit between the platform, which may carry the target, and the tool.
    reverses
        Whether it shows as itself only where a load changes its sign; under one that never does it reads as a
        constant offset, and the offset is named before it.
    instrument_scale
        Parameter that is the instrument's scale, which a calibration leaves uncertain as its certificate says.
    signature
        How it shows in readings; None: by differences, with parameters that have no null on a grid.
    at
        Parameters with the units and bounds of one place; None: those with an angular unit have it where a joint turns.
    tried
        Places that a diagnosis tries as an explanation; None: all of them.
    moved
        Parameters that a diagnosis fits, the others at their defaults; empty: all that are `fitted`.
    compared
        Words for a `scale` above and below 1: (``soft``, ``stiff``) makes "2.15 times as soft as in your file".
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
    precedence: int = 1000
    needs: tuple[str, ...] = ()
    better_with: tuple[str, ...] = ()
    load: Load | None = None
    reading: Reading | None = None
    drive: Drive | None = None
    signature: Signatures | None = None
    hidden: Callable[[Plan], bool] | None = None
    behind_platform: bool = False
    reverses: bool = False
    instrument_scale: str = ""
    at: ParametersAt | None = None
    derived: Derived | None = None
    tried: Places | None = None
    moved: tuple[str, ...] = ()
    compared: tuple[str, str] | None = None

    @property
    def measurement(self) -> bool:
        """Whether it lives in the measurement, not in the machine."""
        return self.apply is None

    def parameter(self, name: str) -> Parameter:
        """The parameter of that name; KeyError where there is none."""
        return {p.name: p for p in self.parameters}[name]

    def parameters_at(
        self, description: MachineDescription, element: str, legs: tuple[str, ...]
    ) -> tuple[Parameter, ...]:
        """Parameters with the units and bounds that hold at this place."""
        if self.at:
            return self.at(description, element, legs)
        turns = any(p.angular for p in self.parameters) and is_revolute(description, element)
        return tuple(p.turning for p in self.parameters) if turns else self.parameters
