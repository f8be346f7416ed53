"""``stiffmap simulate``."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from stiffmap.common.errors import StiffmapError
from stiffmap.common.outputs.option import written
from stiffmap.experiment import Loop, save_experiment, simulate
from stiffmap.experiment.virtual import plans as make
from stiffmap.solve.machine import load_machine
from stiffmap.ui.cli import plan_options as plans
from stiffmap.ui.cli.inputs import FrameOption, QuantityOption, TargetOption, in_si
from stiffmap.ui.cli.output import JsonOption, show


def command(
    machine: Annotated[str, typer.Argument(help="Machine: shipped name or machine file.")],
    output: Annotated[Path, written(help="Folder of the virtual experiment.")],
    effect: Annotated[
        list[str] | None,
        typer.Option(help="What the machine has beyond the declared one; repeatable."),
    ] = None,
    plan: Annotated[
        str,
        typer.Option(
            help="random (evenly over the workspace), grid:NXxNYxNZ, a CSV file of rows (x,y,z in mm; "
            "fx … in N and any other column of an experiment), or an experiment folder to repeat."
        ),
    ] = "random",
    quantity: QuantityOption = "deflection",
    poses: Annotated[int, typer.Option(help="Poses of a random plan.")] = 30,
    loads: Annotated[
        str, typer.Option(help="Loads per pose: axes, full (with sums of pairs and zero), or N at random.")
    ] = "9",
    forces: Annotated[str, typer.Option(help="Sizes of the forces, N.")] = "100,250,400",
    repeats: Annotated[int, typer.Option(help="Readings of each condition.")] = 2,
    read: Annotated[str, typer.Option(help="Axes read, of dx,dy,dz,rx,ry,rz, or none.")] = "dx,dy,dz",
    joint: Annotated[
        list[str] | None,
        typer.Option(help="Encoder read: NAME or NAME:motor, as x.actuator:motor; repeatable."),
    ] = None,
    distances: Annotated[
        bool, typer.Option(help="Read distances from each pose to the next instead of positions.")
    ] = False,
    command: Annotated[
        bool, typer.Option(help="Write commanded actuator coordinates instead of poses.")
    ] = False,
    noise: Annotated[
        float | None, typer.Option(help="One standard deviation, mm; default 0.003, positions 0.008.")
    ] = None,
    angle_noise: Annotated[float, typer.Option(help="The same of an angle, mrad.")] = 0.01,
    zero_noise: Annotated[float, typer.Option(help="Of the zero that a pose's readings share, mm.")] = 0.0,
    branches: Annotated[bool, typer.Option(help="Read every load loading and unloading.")] = False,
    shuffle: Annotated[bool, typer.Option(help="Visit the poses in random order.")] = False,
    temperature: Annotated[str | None, typer.Option(help="First and last temperature, °C, as 20,26.")] = None,
    setups: Annotated[int, typer.Option(help="Set-ups that the poses are dealt to.")] = 1,
    frame: FrameOption = "known",
    tool: TargetOption = "known",
    unloaded: Annotated[str, typer.Option(help="Unloaded state: centre, approach, unknown.")] = "centre",
    approach: Annotated[bool, typer.Option(help="Reach each pose along ±x, ±y or ±z.")] = False,
    instrument_on: Annotated[str, typer.Option(help="floor, base, or a point of the machine.")] = "floor",
    target_on: Annotated[str, typer.Option(help="tool or platform.")] = "tool",
    force_against: Annotated[str, typer.Option(help="floor, base, or a point of the machine.")] = "floor",
    gravity: Annotated[str | None, typer.Option(help="m/s², base axes, as 0,0,-9.81.")] = None,
    outliers: Annotated[float, typer.Option(help="Share of rows that are wild, 0 to 1.")] = 0.0,
    seed: Annotated[int, typer.Option(help="Seed of poses, loads and noise.")] = 0,
    as_json: JsonOption = False,
) -> None:
    """Write a virtual experiment, to try a plan before the instrument is booked.

    [bold]stiffmap diagnose[/bold] on it says what the plan would have found, and how small.

    Examples:

      [cyan]stiffmap simulate orthoglide-revised --effect 'dead_zone actuator y half_width=5um' -o twin[/cyan]

      [cyan]stiffmap simulate orthoglide-revised --effect 'length bar x error=0.1mm' --quantity position --plan grid:5x5x3 --noise 0.01 -o twin[/cyan]

      [cyan]stiffmap simulate orthoglide-revised --effect 'friction actuator y force=40N' --effect 'compliance actuator z scale=1.5' --branches --loads full --poses 8 -o twin[/cyan]

      [cyan]stiffmap simulate orthoglide-revised --plan my_poses.csv --temperature 20,26 --shuffle --outliers 0.02 -o twin[/cyan]

      [cyan]stiffmap simulate orthoglide-revised --plan experiments/servo --effect 'dead_zone actuator y half_width=5um' -o twin[/cyan]
    """
    chosen = load_machine(machine)
    size = in_si(noise)
    layout = plans.layout(
        chosen, plan, quantity, poses, loads, plans.sizes(forces), repeats, plans.axes(read),
        size, 1e-3 * angle_noise, seed,
    )  # fmt: skip
    layout = plans.channels(layout, chosen, joint or [], distances, size)
    layout = plans.history(layout, branches, shuffle, temperature, setups, approach, seed)
    layout = plans.unknowns(layout, frame, tool, unloaded, 1e-3 * zero_noise, gravity)
    if (instrument_on, target_on, force_against) != ("floor", "tool", "floor"):
        layout = replace(layout, loop=Loop(instrument_on, target_on, force_against))
    layout = make.with_command(layout, chosen) if command else layout
    if not 0 <= outliers < 1:
        raise StiffmapError(f"--outliers: expected a share from 0 to below 1, got {outliers:g}")
    twin = simulate(chosen, layout, effect or (), seed=seed, outlier_share=outliers)
    save_experiment(twin, output, "virtual experiment" + "".join(f"; {e}" for e in effect or []))
    number = int(twin.groups.max()) + 1
    data = {"machine": chosen.name, "rows": len(twin), "poses": number, "quantity": twin.quantity,
            "axes": twin.axes, "folder": output}  # fmt: skip
    told = f"{output}: {len(twin)} rows of {twin.quantity} at {number} poses; reads {', '.join(twin.axes)}"
    show(as_json, data, [told])
