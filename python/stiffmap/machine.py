"""A machine that can be solved."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from os import PathLike
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from stiffmap._core import FastPlan, Mechanism, OneCall
from stiffmap.broadcasting import Floats
from stiffmap.derivatives import Prepared, Request, Requests, differentiate, prepare, read_requests
from stiffmap.description import MachineDescription
from stiffmap.errors import StiffmapError
from stiffmap.lowering import build_mechanism
from stiffmap.names import Names, names_of
from stiffmap.recent import Recent
from stiffmap.solution import Solution
from stiffmap.solving import Call, gravity_vector, solve_call

if TYPE_CHECKING:
    from stiffmap.inverse import HeldMachine

MOST_PREPARED = 4  # sets of derivatives whose machines are kept


class Machine:
    """An immutable machine; `load_machine` makes one from a shipped name or a file.

    Pickles, compares by its description, and may be shared by threads.
    """

    def __init__(self, description: MachineDescription) -> None:
        self._description = description
        self._core  # noqa: B018 - refuse an impossible machine when it is made, not when it is used

    @property
    def description(self) -> MachineDescription:
        """What the machine is made of."""
        return self._description

    @property
    def name(self) -> str:
        """Name of the machine."""
        return self._description.name

    @cached_property
    def _core(self) -> Mechanism:
        return build_mechanism(self._description)

    @cached_property
    def _names(self) -> Names:
        return names_of(self._core)

    @cached_property
    def _home_rotation(self) -> Floats:
        return self._description.home.r

    @cached_property
    def _plan(self) -> FastPlan:
        box = self._description.workspace
        low, high = box if box else ((1.0, 1.0, 1.0), (-1.0, -1.0, -1.0))
        return FastPlan(self._core, np.array(low), np.array(high))

    @cached_property
    def _one(self) -> OneCall:
        return OneCall(self._core, self._plan, self._home_rotation, gravity_vector(self, None))

    @cached_property
    def _derivable(self) -> Recent[Prepared]:
        return Recent(MOST_PREPARED)

    def _prepared(self, requests: Requests) -> Prepared:
        return self._derivable.get(requests.key, lambda: prepare(self, requests))

    @property
    def fast(self) -> str:
        """Empty if the fast path takes this machine, else what it lacks for it."""
        return self._plan.missing

    @property
    def actuators(self) -> tuple[str, ...]:
        """Full names of the actuators."""
        return self._names.actuators

    @property
    def legs(self) -> tuple[str, ...]:
        """Names of the legs."""
        return self._names.legs

    @property
    def points(self) -> tuple[str, ...]:
        """Names of the points that wrenches and readings may refer to."""
        return self._names.points

    @property
    def free_spins(self) -> tuple[str, ...]:
        """Passive coordinates that turn without any effect, held at their home value."""
        return self._names.free_spins

    @property
    def workspace(self) -> Floats:
        """(2, 3) m: lowest and highest corner of the workspace box."""
        if self._description.workspace is None:
            raise StiffmapError(f"{self.name}: the machine file declares no workspace box")
        return np.array(self._description.workspace)

    def solve(
        self,
        position: ArrayLike,
        wrench: ArrayLike | None = None,
        *,
        rotation: ArrayLike | None = None,
        point: str = "tcp",
        wrenches: Mapping[str, ArrayLike] | None = None,
        load_type: str | Mapping[str, str] = "dead",
        read_points: Sequence[str] = (),
        gravity: ArrayLike | None = None,
        method: str = "fast",
        load_steps: int | str = "auto",
        stiffness: bool = True,
        derivatives: Sequence[Request] = (),
        derivatives_of: Sequence[str] = ("displacement",),
        threads: int | None = None,
    ) -> Solution:
        """Equilibrium, stiffness and compliance at commanded poses under external wrenches.

        Parameters
        ----------
        position
            (..., 3) m, commanded TCP, base axes.
        wrench
            (..., 6) N, N·m, acting on the machine at `point`, base axes, moment about the point.
            None: no external wrench.
        rotation
            (..., 3, 3), commanded orientation; None: as at home.
        point
            Named point where `wrench` acts and `displacement`, `stiffness` and `compliance` are.
        wrenches
            More wrenches: point name -> (..., 6).
        load_type
            How `wrench` follows its body: ``dead``, ``follower`` or ``semitangential``
            (docs/conventions.md). A mapping says it for each loaded point; the others are dead.
        read_points
            Further points whose displacement is wanted: `Solution.readings` holds `point` first.
        gravity
            (3,) m/s², base axes; None: what the machine file says.
        method
            ``fast`` or ``reference``.
        load_steps
            ``auto`` (adaptive continuation) or the number of equal steps.
        stiffness
            False: displacements, status, flags and iterations only; everything else is NaN. Quicker,
            above all under gravity.
        derivatives
            Effects ``(kind, {"element": ..., "legs": [...], parameter: value, ...})``, and inputs
            ``"position"``, ``"rotation"``, ``"wrench"``. The machine is solved with all these effects, and
            differentiated at each of their numbers and along each component of the inputs. A null value
            (`stiffmap effects`) differentiates at the machine as it is. Names and schemes: docs/effects.md.
        derivatives_of
            ``displacement``, ``stiffness``, ``compliance``: see `Solution.derivatives`,
            `Solution.stiffness_derivatives`, `Solution.compliance_derivatives`. Displacement alone costs a few
            solves for many parameters, the others two solves for each.
        threads
            None: all cores that this process may use.

        Notes
        -----
        Poses never raise: see `Solution.status`. Raises StiffmapError for bad input.
        """
        if (
            rotation is None
            and wrenches is None
            and gravity is None
            and point == "tcp"
            and load_type == "dead"
            and method == "fast"
            and load_steps == "auto"
            and stiffness is True
            and (threads is None or threads == 1)
            and not read_points
            and not derivatives
        ):
            one = self._one.solve(position, wrench)
            if one is not None:
                return Solution(one, (), self._names, point)
        call = Call(
            position,
            wrench,
            rotation,
            point,
            wrenches,
            load_type,
            read_points,
            gravity,
            method,
            load_steps,
            stiffness,
            threads,
        )
        if derivatives:
            return differentiate(self, call, read_requests(derivatives, derivatives_of))
        return solve_call(self, call)[0]

    def wrench(self, position: ArrayLike, displacement: ArrayLike, **options: Any) -> HeldMachine:
        """Wrenches that hold the machine at a `displacement` (..., 6) from the commanded pose, eq. (10).

        Options: rotation, point, gravity, threads, as in `stiffmap.inverse.imposed_displacement`.
        """
        from stiffmap.inverse import imposed_displacement

        return imposed_displacement(self, position, displacement, **options)

    def with_effect(
        self, kind: str, *, element: str | None = None, legs: Sequence[str] | None = None, **parameters: Any
    ) -> Machine:
        """A new machine with an effect added; see `stiffmap.effects`."""
        from stiffmap.effects import add_effect

        return Machine(add_effect(self._description, kind, element=element, legs=legs, **parameters))

    def save(self, path: str | PathLike[str]) -> None:
        """Write a machine file that loads back equal."""
        from stiffmap.files import save_description

        save_description(self._description, path)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Machine) and other._description == self._description

    def __hash__(self) -> int:
        return hash((self.name, len(self._description.legs)))

    def __reduce__(self) -> tuple[type[Machine], tuple[MachineDescription]]:
        return (Machine, (self._description,))

    def __repr__(self) -> str:
        return f"Machine({self.name!r}: legs {', '.join(self.legs)}; actuators {', '.join(self.actuators)})"


def load_machine(name_or_path: str | PathLike[str]) -> Machine:
    """Machine from a shipped name (`stiffmap machines` lists them) or a YAML file.

    Raises StiffmapError naming file, key, what was expected and what was found.
    """
    from stiffmap.files import load_description

    return Machine(load_description(name_or_path))
