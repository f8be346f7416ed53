"""Planning and monitoring as Python calls, with machines, experiments and effects as they are named elsewhere."""

from __future__ import annotations

from collections.abc import Sequence
from os import PathLike

from numpy.typing import ArrayLike

from stiffmap.broadcasting import real_array
from stiffmap.description import AppliedEffect
from stiffmap.effects import parse_effect
from stiffmap.effects.check import place_of
from stiffmap.effects.registry import get
from stiffmap.errors import StiffmapError
from stiffmap.experiment import Experiment, load_experiment
from stiffmap.files.load import Source
from stiffmap.machine import Machine, as_machine
from stiffmap.planning.design import Design, design
from stiffmap.planning.monitor import Comparison, compare

Effects = str | AppliedEffect | Sequence[str | AppliedEffect]
"""One effect or several, each as text (``compliance actuator x scale=1.2``) or as a record."""


def plan(
    machine: Machine | Source,
    identify: Effects,
    *,
    rows: int = 12,
    rival: Effects = (),
    aim: str | None = None,
    quantity: str = "deflection",
    poses: int = 60,
    force: float = 400.0,
    candidates: Experiment | str | PathLike[str] | None = None,
    at: ArrayLike | None = None,
    load: ArrayLike | None = None,
    frame: str = "known",
    tool: str = "known",
    axes: Sequence[str] = ("dx", "dy", "dz"),
    noise: float | None = None,
    seed: int = 0,
    done: Experiment | str | PathLike[str] | None = None,
) -> Design:
    """Which poses, loads and readings tell most, before the instrument is booked.

    Parameters
    ----------
    identify
        Effects whose numbers are wanted, at the values given: ``"compliance actuator x scale=1"``, or records.
    rows
        Number of rows to measure.
    rival
        Another explanation, to be told apart from `identify`.
    aim
        ``identify`` (D-optimal), ``separate`` (needs `rival`), ``map`` (the map at the workpiece); None: ``separate`` where there
        is a rival, else ``identify``.
    at, load
        With the aim ``map``: poses of the workpiece (m, 3) m and the wrench (6,) N, N·m there; None: corners of the
        workspace, `force` along x.
    candidates, done
        Rows to choose from, and rows that have been measured: experiments, their folders or files.
    quantity, poses, force, frame, tool, axes, noise, seed
        As in `stiffmap.planning.design.design`: N, m.

    Returns a `Design`: its `experiment` holds the rows, `sigma` (k,) the expected standard uncertainties (SI).
    Raises StiffmapError for bad input.
    """
    m = as_machine(machine)
    terms, others = _effects(m, identify), _effects(m, rival)
    if not terms:
        raise StiffmapError("identify: expected at least one effect, got none")
    return design(
        m,
        terms,
        rows=rows,
        aim=aim or ("separate" if others else "identify"),
        rival=others,
        quantity=quantity,
        poses=poses,
        force=force,
        candidates=None if candidates is None else _experiment(candidates),
        at=None if at is None else real_array(at, "at").reshape(-1, 3),
        load=None if load is None else real_array(load, "load"),
        frame=frame,
        tool=tool,
        axes=axes,
        noise=noise,
        seed=seed,
        done=None if done is None else _experiment(done),
    )


def monitor(
    machine: Machine | Source,
    before: Experiment | str | PathLike[str],
    after: Experiment | str | PathLike[str],
    effects: Effects,
) -> Comparison:
    """What changed between two experiments, or whether two machines of a type share their numbers.

    before, after
        Experiments, their folders or files.
    effects
        What is followed: its numbers are fitted to each experiment on its own.

    Returns a `Comparison`: `changes` in SI with uncertainty and p-value each, `common` where one set of numbers serves both.
    Raises StiffmapError for bad input.
    """
    m = as_machine(machine)
    terms = _effects(m, effects)
    if not terms:
        raise StiffmapError("effects: expected at least one effect to follow, got none")
    return compare(m, _experiment(before), _experiment(after), terms)


def _experiment(given: Experiment | str | PathLike[str]) -> Experiment:
    return given if isinstance(given, Experiment) else load_experiment(given)


def _effects(machine: Machine, given: Effects) -> list[AppliedEffect]:
    """Records with the machine's own names of element and legs filled in."""
    several = [given] if isinstance(given, str | AppliedEffect) else list(given)
    return [placed(machine, one) for one in several]


def placed(machine: Machine, given: str | AppliedEffect) -> AppliedEffect:
    """One effect, text or record, with the machine's own names of element and legs filled in; one of the measurement too."""
    d = machine.description
    term = parse_effect(given, d) if isinstance(given, str) else given
    effect = get(term.kind)
    if effect.measurement:
        element, legs = place_of(effect, d, term.element or None, term.legs or None)
        return AppliedEffect(term.kind, element, legs, term.parameters, term.options)
    more = {**dict(term.parameters), **dict(term.options)}
    added = machine.with_effect(term.kind, element=term.element or None, legs=term.legs or None, **more)
    return added.description.effects[-1]
