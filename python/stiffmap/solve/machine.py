"""A machine that can be solved."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from functools import cached_property, wraps
from os import PathLike
from typing import TYPE_CHECKING, Concatenate, ParamSpec, TypeVar, Unpack

import numpy as np
from numpy.typing import ArrayLike

from stiffmap.common.arguments import checked
from stiffmap.common.broadcasting import Floats, instance_of
from stiffmap.common.errors import StiffmapError, frames_of_this_package
from stiffmap.common.from_above import from_above
from stiffmap.common.kept import Kept
from stiffmap.common.open_view import OpenView
from stiffmap.common.short import machine_html
from stiffmap.model.addresses import Listed, listed
from stiffmap.model.description import MachineDescription
from stiffmap.model.effects import add_effect
from stiffmap.model.files import load_description, save_description
from stiffmap.model.files.load import Source
from stiffmap.solve.compiled import CompiledMachine, Status
from stiffmap.solve.derivatives import DISPLACEMENT, Prepared, Request, differentiate, prepare, read_requests
from stiffmap.solve.holding_wrench import HoldingWrench, holding_wrench
from stiffmap.solve.options import SolveKeywords, SolveOptions, options_of, spelled_out
from stiffmap.solve.redesign import redesigned
from stiffmap.solve.solution import Solution
from stiffmap.solve.solving import Call, solve_call, solve_joints

if TYPE_CHECKING:
    import pandas as pd

MOST_PREPARED = 4  # sets of derivatives whose machines are kept


class Machine:
    """An immutable machine; `load_machine` makes one from a shipped name or a file.

    Pickles, compares by its description, and may be shared by threads.
    """

    def __init__(
        self, description: MachineDescription, *, start_nodes: int = 8, like: Machine | None = None
    ) -> None:
        """`start_nodes`: closures prepared along each edge of the workspace; fewer for a machine with few calls.
        `like`: a machine that differs in springs, errors, effects or bodies only, from it or from one made like it before, is made faster;
        the numbers are the same.
        """
        self._description = description
        compiled = like._compiled if like else None
        self._compiled: CompiledMachine = CompiledMachine(
            description, start_nodes, compiled
        )  # refuses an impossible machine

    @property
    def description(self) -> MachineDescription:
        """What the machine is made of."""
        return self._description

    @property
    def name(self) -> str:
        """Name of the machine."""
        return self._description.name

    @property
    def compiled(self) -> CompiledMachine:
        """The machine as the C++ core holds it; what the packages of stiffmap solve with."""
        return self._compiled

    @cached_property
    def _derivable(self) -> Kept[Hashable, Prepared]:
        return Kept(MOST_PREPARED)

    @property
    def fast(self) -> str:
        """Empty if the fast path takes this machine, else what it lacks for it."""
        return self._compiled.not_fast

    @property
    def actuators(self) -> tuple[str, ...]:
        """Full names of the actuators."""
        return self._compiled.names.actuators

    @property
    def legs(self) -> tuple[str, ...]:
        """Names of the legs."""
        return self._compiled.names.legs

    @property
    def points(self) -> tuple[str, ...]:
        """Names of the points that wrenches and readings may refer to."""
        return self._compiled.names.points

    @property
    def free_spins(self) -> tuple[str, ...]:
        """Passive coordinates that turn without any effect, held at their home value."""
        return self._compiled.names.free_spins

    @property
    def workspace(self) -> Floats:
        """(2, 3) m: lowest and highest corner of the workspace box."""
        if self._description.workspace is None:
            raise StiffmapError(
                f"{self.name}: the machine file declares no workspace box; write one into it, such as "
                "workspace: {x: [-100, 100], y: [-100, 100], z: [0, 200]}"
            )
        return np.array(self._description.workspace)

    @spelled_out(SolveKeywords)
    def solve(
        self,
        position: ArrayLike,
        wrench: ArrayLike | None = None,
        *,
        derivatives: Sequence[Request] = (),
        derivatives_of: Sequence[str] = DISPLACEMENT,
        **given: Unpack[SolveKeywords],
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
        start
            Joint coordinates that name the assembly mode (elbow up or down): a mapping joint name -> (...) m or
            rad (those left out are as at home), or (..., coordinates) as `Solution.coordinates` has them. They
            need not be closed: loops are closed with the actuators held, then continued to the pose. None: the
            mode of home.
        threads
            None: all cores that this process may use.

        Notes
        -----
        Poses never raise: see `Solution.status`. Raises StiffmapError for bad input.
        """
        if not isinstance(derivatives, tuple | list):
            derivatives = tuple(instance_of(derivatives, Iterable, "derivatives", "effects or inputs"))
        if not derivatives and derivatives_of is not DISPLACEMENT:
            read_requests(derivatives, derivatives_of)
        threads = given.get("threads", 0) if len(given) == 1 else 0
        if not derivatives and (not given or threads is None or (type(threads) is int and threads == 1)):
            one = self._compiled.solve_one(position, wrench)
            if one is not None:
                s = Solution(one, (), self._compiled.names, "tcp")
                if not sum(map(abs, position)) <= METRES_TOO_FAR * self._compiled.length:  # type: ignore[arg-type]  # plain numbers; nan too
                    hint_metres(self, position, bool(s.status == Status.UNREACHABLE))
                return s
        if not derivatives:
            return solve_with(self, position, wrench, options_of(given))
        requests = read_requests(derivatives, derivatives_of)
        ready = self._derivable.made(requests.key, lambda: prepare(self._compiled, requests))
        return differentiate(ready, Call(position, wrench, options_of(given)), requests)

    @spelled_out(SolveKeywords)
    def solve_joints(
        self, actuators: ArrayLike, wrench: ArrayLike | None = None, **given: Unpack[SolveKeywords]
    ) -> Solution:
        """Equilibrium and stiffness at commanded actuators (..., actuators) m or rad, in the order of `actuators`.

        The unloaded pose is where forward kinematics puts the TCP, by continuation from home or from `start`
        (as in `solve`); `Solution.unloaded` holds it, and displacements count from there. The other arguments
        are those of `solve`. UNREACHABLE where the actuators do not go together. StiffmapError for bad input.
        """
        home = self._description.home.p
        return solve_joints(self._compiled, actuators, Call(home, wrench, options_of(given)))

    def wrench(
        self,
        position: ArrayLike,
        displacement: ArrayLike,
        *,
        rotation: ArrayLike | None = None,
        point: str = "tcp",
        gravity: ArrayLike | None = None,
        threads: int | None = None,
    ) -> HoldingWrench:
        """Wrenches (N, N·m) and stiffness of the machine held off its commanded pose, eq. (10).

        Parameters
        ----------
        position
            (..., 3) m, commanded TCP, base axes.
        displacement
            (..., 6) m, rad: of the point from where the command puts it; rotation as a rotation vector.
        rotation
            (..., 3, 3), commanded orientation; None: as at home.
        point
            Named point that is held; a free one is not touched.
        gravity
            (3,) m/s², base axes; None: what the machine file says.

        Notes
        -----
        Loaded equilibrium, not stiffness times displacement. A displacement that rigid parts forbid is
        NOT_CONVERGED. Raises StiffmapError for bad input.
        """
        return holding_wrench(self._compiled, position, displacement, rotation, point, gravity, threads)

    @checked
    def with_effect(
        self,
        kind: str,
        *,
        element: str | None = None,
        legs: Sequence[str] | None = None,
        **parameters: object,
    ) -> Machine:
        """A new machine with an effect added; see `stiffmap.model.effects`."""
        return Machine(
            add_effect(self._description, kind, element=element, legs=legs, **parameters), like=self
        )

    def numbers(self) -> pd.DataFrame:
        """Every number of the machine as it is declared, as a table (SI): one row per address.

        Columns: value, unit, u (standard uncertainty, NaN where none is given), source (where the description says it:
        assumed, measured, computed, catalogue), note. The address ``x.bar/beam.length`` is what `with_number` takes and the
        key under which a file keeps uncertainties. docs/machine_files.md lists the fields.
        """
        import pandas as pd  # half a second, for tables alone

        rows = listed(self._description.declared or self._description)
        table = pd.DataFrame(rows, columns=[*Listed._fields]).set_index("address")
        return table.astype({"value": float, "u": float})

    def with_number(self, address: str, value: float) -> Machine:
        """A machine with another number (SI) at an address: see `with_numbers`."""
        return self.with_numbers({instance_of(address, str, "address", "text"): value})

    def with_numbers(self, values: Mapping[str, float]) -> Machine:
        """A new machine of another design: numbers (SI: m, rad, N, kg) at addresses ``name/field``.

        `numbers` lists addresses of single numbers. A name without its leg (``bar/length``) stands for all legs, one without
        its branches (``x.bar/length``) for both bars of a parallelogram. ``length`` is that of an offset, or
        of a link: the offset before its spring and, where the spring is a beam of that length, the beam (a compliance that the
        file gives as a matrix stays). ``beam.length``, ``beam.tube.outer``, ``beam.material.E`` are numbers of a
        beam alone, from which its compliance is computed anew. The controller knows the new numbers (a
        deviation from them is an effect: `with_effect`). Home is closed again on the same assembly branch. Masses, centres
        and uncertainties are numbers of their own, which do not follow.

        Raises StiffmapError for an address that the machine has not (the nearest is named), a value that cannot be, or
        numbers with which the machine does not close.
        """
        return Machine(redesigned(self._description, values), like=self)

    def view(
        self,
        position: ArrayLike | None = None,
        *,
        port: int | None = None,
        browser: bool = True,
        rotation: ArrayLike | None = None,
        force: ArrayLike | None = None,
        moment: ArrayLike | None = None,
        gravity: ArrayLike | None = None,
        plane: str | None = None,
        normal: ArrayLike | None = None,
        quantity: str = "deflection",
        tolerance: float | None = None,
        magnification: float | None = None,
        frequency: float | None = None,
        start: ArrayLike | None = None,
        changes: Mapping[str, float] | None = None,
        experiment: object = None,
        diagnosis: object = None,
        path: object = None,
        meshes: str | PathLike[str] | None = None,
    ) -> OpenView:
        """Look at the machine and its map live in a browser; the view that is open is returned (``close()`` ends it).

        All in SI and base axes; what is None is as `stiffmap.ui.view.ViewState` has it. In a notebook the view is shown where it is
        the last value of a cell. docs/view.md.

        position (3,) m, None: home; rotation (3,) rad, rotation vector. port: of 127.0.0.1; None: a free one from 8080 on.
        browser: whether to open one. force (3,) N and moment (3,) N·m on the tool; gravity (3,) m/s². plane: the axis across
        which it lies (x, y, z), or ``free`` with a `normal` (3,). quantity: deflection, worst, stiffness, margin, status,
        frequency, dynamic. tolerance m; magnification of the deflected machine; frequency (Hz) of the dynamic stiffness.
        start: all coordinates that name an assembly mode. changes: numbers by their addresses, such as
        ``{"x.foot/beam.EIx": 4000.0}``. Drawn as well: an experiment (or its folder), a diagnosis (or the folder of
        one), a path of the tool (a `Toolpath`, its file, or positions (n, 3) m), `meshes`: the URDF that the machine was
        imported from, whose meshes are drawn.

        Raises MissingPartError without the extra ``[view]`` (viser), StiffmapError for bad input and for a pose that the
        machine cannot take.
        """
        given = {
            "rotation": rotation, "force": force, "moment": moment, "gravity": gravity, "plane": plane, "normal": normal,
            "quantity": quantity, "tolerance": tolerance, "magnification": magnification, "frequency": frequency,
            "start": start, "changes": changes, "experiment": experiment, "diagnosis": diagnosis, "path": path,
            "meshes": meshes,
        }  # fmt: skip
        opened: OpenView = from_above("Machine.view")(
            self, position, port=port, browser=browser, **{k: v for k, v in given.items() if v is not None}
        )
        return opened

    def save(self, path: str | PathLike[str]) -> None:
        """Write a machine file that loads back equal."""
        save_description(self._description, path)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Machine) and other._description == self._description

    def __hash__(self) -> int:
        return hash((self.name, len(self._description.legs)))

    def __reduce__(self) -> tuple[type[Machine], tuple[MachineDescription]]:
        return (Machine, (self._description,))

    def _repr_html_(self) -> str:
        return machine_html(self._description, self.actuators, self.points)

    def __repr__(self) -> str:
        return f"Machine({self.name!r}: legs {', '.join(self.legs)}; actuators {', '.join(self.actuators)})"


def load_machine(source: Source) -> Machine:
    """Machine from a shipped name (`stiffmap machines` lists them), a YAML file, its text, or its plain data as a dict.

    source
        Text is what has several lines. A dict has the keys of a machine file and the units that its ``units`` say; link
        files that it names are looked for in the working directory.

    Raises StiffmapError naming file, key, what was expected and what was found.
    """
    return Machine(load_description(source))


def as_machine(machine: Machine | Source) -> Machine:
    """The machine itself, or the one of that shipped name, file, text or plain data."""
    return machine if isinstance(machine, Machine) else load_machine(machine)


P = ParamSpec("P")
R = TypeVar("R")


def takes_machine(
    function: Callable[Concatenate[Machine, P], R],
) -> Callable[Concatenate[Machine | Source, P], R]:
    """Let the first argument of a public function also be a shipped name or a machine file."""

    @wraps(function)
    def with_machine(machine: Machine | Source, *args: P.args, **options: P.kwargs) -> R:
        return function(as_machine(machine), *args, **options)

    return with_machine  # type: ignore[return-value]  # the name of the first argument is kept


METRES_TOO_FAR = 100.0


def solve_with(
    machine: Machine, position: ArrayLike, wrench: ArrayLike | None, options: SolveOptions
) -> Solution:
    """`Machine.solve` with options that are at hand."""
    s = solve_call(machine.compiled, Call(position, wrench, options))[0]
    hint_metres(machine, position, bool((s.status == Status.UNREACHABLE).all()))
    return s


def hint_metres(machine: Machine, position: ArrayLike, failed: bool) -> None:
    """Warn, at the caller's line, of positions that are no numbers, and where every pose failed and lies as far outside as
    millimetres read as metres do."""
    finite = np.isfinite(np.asarray(position, dtype=float))
    if not finite.all():
        rows = np.atleast_1d(finite.all(axis=-1))
        text = f"{int((~rows).sum())} of {rows.size} positions are not finite numbers (nan or inf); their status is UNREACHABLE"
        warnings.warn(text, stacklevel=frames_of_this_package())
        return
    text = metres_expected(machine.compiled, position) if failed else ""
    if text:
        warnings.warn(f"no pose can be reached: {text}", stacklevel=frames_of_this_package())


def metres_expected(machine: CompiledMachine, position: ArrayLike) -> str:
    """Why positions look like millimetres; empty where they do not."""
    far = float(np.abs(np.asarray(position, dtype=float)).max(initial=0.0))
    if not far > METRES_TOO_FAR * machine.length:
        return ""
    return (
        f"positions up to {far:g} m, the machine measures {machine.length:.2g} m; "
        "metres are expected (200 mm is 0.2)"
    )
