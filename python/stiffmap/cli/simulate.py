"""``stiffmap simulate``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from stiffmap.effects import parse_effect
from stiffmap.experiment import load_experiment, random_plan, save_experiment
from stiffmap.experiment import simulate as run
from stiffmap.experiment.experiment import Experiment
from stiffmap.machine import Machine, load_machine


def simulate(
    machine: Annotated[str, typer.Argument(help="Machine: shipped name or machine file.")],
    output: Annotated[Path, typer.Option("-o", "--output", help="Folder of the virtual experiment.")],
    effect: Annotated[
        list[str] | None,
        typer.Option(
            "--effect", help="Effect that the machine has, e.g. 'dead_zone actuator y half_width=12um'."
        ),
    ] = None,
    plan: Annotated[
        str, typer.Option(help="deflection or position (random poses), or an experiment folder to repeat.")
    ] = "deflection",
    noise: Annotated[
        float | None, typer.Option(help="One standard deviation, mm; default: the plan's.")
    ] = None,
    poses: Annotated[int, typer.Option(help="Poses of a random plan.")] = 30,
    loads: Annotated[int, typer.Option(help="Loads per pose of a random plan.")] = 9,
    repeats: Annotated[int, typer.Option(help="Repeats of a random plan.")] = 2,
    outliers: Annotated[float, typer.Option(help="Share of rows that are wild.")] = 0.0,
    seed: Annotated[int, typer.Option(help="Seed of poses and noise.")] = 0,
) -> None:
    """Write a virtual experiment, to try a plan before the instrument is booked.

    Examples:

      [cyan]stiffmap simulate orthoglide-revised --effect 'length bar x error=0.1mm' -o twin[/cyan]
    """
    chosen = load_machine(machine)
    scale = None if noise is None else noise * 1e-3
    layout = _plan(chosen, plan, poses, loads, repeats, scale, seed)
    twin = run(chosen, layout, [_placed(chosen, e) for e in effect or []], seed=seed, outliers=outliers)
    save_experiment(twin, output, "virtual experiment" + "".join(f"; {e}" for e in effect or []))
    print(f"{output}: {len(twin)} rows of {twin.quantity}")


def _plan(
    machine: Machine, plan: str, poses: int, loads: int, repeats: int, noise: float | None, seed: int
) -> Experiment:
    if plan in ("deflection", "position"):
        return random_plan(machine, plan, poses=poses, loads=loads, repeats=repeats, noise=noise, seed=seed)
    return load_experiment(plan)


def _placed(machine: Machine, text: str):  # type: ignore[no-untyped-def]
    """The effect with the machine's own names of element and legs filled in."""
    from stiffmap.effects import registry

    term = parse_effect(text)
    if registry.get(term.kind).measurement:
        return term
    given = {**dict(term.parameters), **dict(term.options)}
    added = machine.with_effect(term.kind, element=term.element or None, legs=term.legs or None, **given)
    return added.description.effects[-1]
