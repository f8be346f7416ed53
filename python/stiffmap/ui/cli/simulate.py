from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from stiffmap.common.broadcasting import Floats, random_numbers
from stiffmap.common.errors import StiffmapError
from stiffmap.experiment import Experiment, Loop, load_experiment, save_experiment, simulate
from stiffmap.experiment.channels import AXES, SIDES, Channel
from stiffmap.experiment.files.load import load_plan
from stiffmap.experiment.virtual import plans as make
from stiffmap.solve.machine import Machine, load_machine
from stiffmap.ui.cli import options
from stiffmap.ui.cli.inputs import in_si, numbers
from stiffmap.ui.cli.options import argument, how_many, option, written
from stiffmap.ui.cli.output import Answer

GRID = re.compile(r"^grid:(\d+)x(\d+)x(\d+)$")
WORDS = {
    "frame": ("known", "offset_unknown", "unknown"),
    "tool": ("known", "offset_unknown"),
    "unloaded": ("centre", "approach", "unknown"),
}


def command(
    machine: str = argument("Machine: shipped name or machine file."),
    output: Path = written("Folder of the virtual experiment.", ...),
    effect: list[str] | None = option("What the machine has beyond the declared one; repeatable."),
    plan: str = option(
        "random (evenly over the workspace), grid:NXxNYxNZ, a CSV file of rows (x,y,z in mm; "
        "fx … in N and any other column of an experiment), or an experiment folder to repeat.",
        "random",
    ),
    quantity: options.Quantity = "deflection",
    poses: int = how_many("Poses of a random plan.", 30),
    loads: str = option("Loads per pose: axes, full (with sums of pairs and zero), or N at random.", "9"),
    forces: str = option("Sizes of the forces, N.", "100,250,400"),
    repeats: int = how_many("Readings of each condition.", 2),
    read: str = option("Axes read, of dx,dy,dz,rx,ry,rz, or none.", "dx,dy,dz"),
    joint: list[str] | None = option("Encoder read: NAME or NAME:motor, as x.actuator:motor; repeatable."),
    distances: bool = option("Read distances from each pose to the next instead of positions.", False),
    command: bool = option("Write commanded actuator coordinates instead of poses.", False),
    noise: float | None = option("One standard deviation, mm; default 0.003, positions 0.008."),
    angle_noise: float = option("The same of an angle, mrad.", 0.01),
    zero_noise: float = option("Of the zero that a pose's readings share, mm.", 0.0),
    branches: bool = option("Read every load loading and unloading.", False),
    shuffle: bool = option("Visit the poses in random order.", False),
    temperature: str | None = option("First and last temperature, °C, as 20,26."),
    setups: int = how_many("Set-ups that the poses are dealt to.", 1),
    frame: options.Frame = "known",
    tool: options.Target = "known",
    unloaded: str = option("Unloaded state: centre, approach, unknown.", "centre"),
    approach: bool = option("Reach each pose along ±x, ±y or ±z.", False),
    instrument_on: str = option("floor, base, or a point of the machine.", "floor"),
    target_on: str = option("tool or platform.", "tool"),
    force_against: str = option("floor, base, or a point of the machine.", "floor"),
    gravity: str | None = option("m/s², base axes, as 0,0,-9.81."),
    outliers: float = option("Share of rows that are wild, 0 to 1.", 0.0),
    seed: int = option("Seed of poses, loads and noise.", 0),
) -> Answer:
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
    strengths, axes, size = _sizes(forces), _axes(read), in_si(noise)
    if quantity not in make.MICRO:
        raise StiffmapError(f"--quantity: expected deflection or position, got {quantity!r}")
    if size is not None and size <= 0:
        raise StiffmapError(f"--noise: expected a standard deviation above zero, got {noise:g} mm")
    for name, value in (("poses", poses), ("repeats", repeats)):
        if value < 1:
            raise StiffmapError(f"--{name}: expected at least 1, got {value}")
    how: dict[str, Any] = {"axes": axes, "noise": size, "angle_noise": 1e-3 * angle_noise}
    if (path := Path(plan)).suffix == ".csv":
        layout = load_plan(path, chosen, quantity, **how)
    elif path.exists():
        layout = _repeated(load_experiment(path), size)
    else:
        where = _poses(chosen, plan, poses, seed)
        own = _loads(loads, strengths, len(where), seed)
        layout = make.plan_of_poses(chosen, quantity, where, own, repeats=repeats, **how)
    layout = _channels(layout, chosen, joint or [], distances, size)
    layout = make.with_branches(layout) if branches else layout
    layout = make.with_approach(layout, seed) if approach else layout
    layout = make.shuffled(layout, seed) if shuffle else layout
    layout = make.with_setups(layout, setups) if setups > 1 else layout
    if temperature is not None:
        layout = make.with_temperature(layout, *numbers(temperature, "temperature", 2).tolist())
    layout = _unknowns(layout, frame, tool, unloaded, 1e-3 * zero_noise, gravity)
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
    return Answer(data, [told])


def _sizes(text: str) -> list[float]:
    found: list[float] = numbers(text, "forces").tolist()
    if min(found) <= 0:
        raise StiffmapError(
            f"--forces: expected sizes above zero (signs are part of the loads), got '{text}'"
        )
    return found


def _axes(text: str) -> tuple[str, ...]:
    if text == "none":
        return ()
    wanted = tuple(a.strip() for a in text.split(",") if a.strip())
    wrong = [a for a in wanted if a not in AXES]
    if wrong or not wanted:
        raise StiffmapError(f"--read: expected axes of {', '.join(AXES)}, got '{text}'")
    return wanted


def _repeated(plan: Experiment, noise: float | None) -> Experiment:
    """An experiment's plan; another noise of its lengths where one is given."""
    if noise is None:
        return plan
    length = np.array([c.unit == "m" for c in plan.channels])
    return replace(plan, sigma=np.where(length & plan.read, noise, plan.sigma))


def _poses(machine: Machine, plan: str, poses: int, seed: int) -> Floats:
    if plan == "random":
        return make.random_poses(machine, poses, seed)
    found = GRID.match(plan)
    if not found or "0" in found.groups():
        raise StiffmapError(
            f"--plan: expected random, grid:NXxNYxNZ, a CSV file or an experiment folder, got '{plan}'"
        )
    return make.grid_poses(machine, [int(n) for n in found.groups()])


def _loads(text: str, forces: Sequence[float], poses: int, seed: int) -> list[Floats]:
    if not text.isdigit():
        return [make.load_set(text, forces)] * poses
    every, number = make.load_set("axes", forces), int(text)
    if not 1 <= number <= len(every):
        raise StiffmapError(f"--loads: expected 1 to {len(every)} of these forces, got {number}")
    rng = random_numbers(seed, 1)
    return [every[rng.permutation(len(every))[:number]] for _ in range(poses)]


def _channels(
    plan: Experiment, machine: Machine, joints: Sequence[str], distances: bool, noise: float | None
) -> Experiment:
    """The plan with distances, and with encoders; their noise is that of the lengths, or 10 µrad."""
    length = noise or make.MICRO[plan.quantity]
    if distances:
        if plan.quantity != "position":
            raise StiffmapError("--distances: a distance between two poses needs --quantity position")
        plan = make.with_distances(plan, length)
    found = [_encoder(machine, text) for text in joints]
    plan = make.with_joints(plan, found, [length if c.unit == "m" else 1e-5 for c in found])
    if not plan.read.any():
        raise StiffmapError("--read none: nothing is read; add --joint or --distances")
    return plan


def _encoder(machine: Machine, text: str) -> Channel:
    names = machine.compiled.names
    name, _, side = text.partition(":")
    if name not in names.joints or (side or "load") not in SIDES:
        there = ", ".join(names.joints)
        raise StiffmapError(f"--joint: expected NAME or NAME:motor with NAME of {there}, got '{text}'")
    column = f"q_{name.replace('.', '_')}{'_motor' if side == 'motor' else ''}"
    return Channel(column, "m" if names.is_prismatic(name) else "rad", name, side or "load")


def _unknowns(
    plan: Experiment, frame: str, tool: str, unloaded: str, zero_noise: float, gravity: str | None
) -> Experiment:
    """The plan with what it does not know; words that differ from the default replace the plan's own."""
    given = {"frame": frame, "tool": tool, "unloaded": unloaded}
    for name, word in given.items():
        if word not in WORDS[name]:
            raise StiffmapError(f"--{name}: expected {', '.join(WORDS[name])}, got '{word}'")
    if unloaded == "approach" and plan.approach is None:
        raise StiffmapError("--unloaded approach needs --approach, or a plan with the columns approach_x …")
    if zero_noise:
        plan = replace(plan, zero_sigma=np.array([zero_noise] * 3 + [0.0] * 3))
    if gravity is not None:
        x, y, z = (float(v) for v in numbers(gravity, "gravity", 3))
        plan = replace(plan, gravity=(x, y, z))
    return replace(plan, **{k: w for k, w in given.items() if w != WORDS[k][0]})  # type: ignore[arg-type]
