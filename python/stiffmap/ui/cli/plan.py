from __future__ import annotations

import itertools
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import typer

from stiffmap.common.errors import StiffmapError
from stiffmap.common.number_text import with_uncertainty
from stiffmap.common.outputs import write_rows
from stiffmap.experiment import simulate
from stiffmap.experiment.calls import effects_of
from stiffmap.experiment.files.save import plan_columns
from stiffmap.identification.planning import follow, plan
from stiffmap.identification.taps import where_to_tap
from stiffmap.solve.machine import Machine, load_machine
from stiffmap.ui.cli import options
from stiffmap.ui.cli.inputs import MM, in_si, numbers, refuse_unused
from stiffmap.ui.cli.options import argument, flag, how_many, option, written
from stiffmap.ui.cli.output import Answer

UNUSED = {"with taps": "rival for_map at rows quantity force read noise frame tool until twin", "with until": "output rival for_map at",
          "without until": "twin", "without for_map": "at"}  # fmt: skip


def command(
    context: typer.Context,
    machine: str = argument("Machine: shipped name or machine file."),
    identify: list[str] | None = option(
        "Effect whose numbers are to be identified, at the value given; repeatable.", None, "--identify"
    ),
    taps: int | None = how_many("In place of --identify: so many poses for tap tests, best first."),
    output: Path | None = written("CSV file of the rows chosen."),
    rival: list[str] | None = option("Explanation to separate from; repeatable.", None, "--rival"),
    for_map: bool = flag("Make the map at the workpiece certain instead of the numbers.", "--map"),
    at: list[str] | None = option("Point of the workpiece, mm, as 100,0,50; repeatable (with --map)."),
    rows: int = how_many("Rows to measure.", 12),
    quantity: options.Quantity = "deflection",
    poses: int = how_many("Candidate poses, at random in the workspace.", 60),
    force: float = option("Size of the forces, N.", 400.0),
    read: str = option("Axes read, of dx,dy,dz,rx,ry,rz.", "dx,dy,dz"),
    noise: float | None = option("One standard deviation of a reading, mm."),
    frame: options.Frame = "known",
    tool: options.Target = "known",
    until: float | None = option(
        "On a twin: go on in batches of --rows until every u is this share of a typical size."
    ),
    twin: list[str] | None = option("What the twin really has; default: --identify.", None, "--twin"),
    seed: int = option("Seed of candidates and of the twin's noise.", 0),
) -> Answer:
    """Which poses, loads and readings are most informative, before the instrument is booked.

    Identifies numbers (D-optimal), separates two explanations (--rival, T-optimal) or makes a map certain (--map).
    Rows are within reach and within the drives' range; the same number of random rows is shown for comparison.

    Examples:
      [cyan]stiffmap plan orthoglide-revised --identify 'compliance actuator x scale=1' --rows 8 -o plan.csv[/cyan]
      [cyan]stiffmap plan ur10 --identify 'zero_offset elbow error=1mrad' --quantity position --frame unknown[/cyan]
      [cyan]stiffmap plan examples/taps/kr210.yaml --taps 3 -o taps.csv[/cyan]
      [cyan]stiffmap plan orthoglide-revised --identify 'dead_zone actuator y half_width=10um' --rival 'compliance actuator y scale=1.2'[/cyan]
      [cyan]stiffmap plan orthoglide-revised --identify 'compliance actuator scale=1' --until 0.05 --twin 'compliance actuator scale=1.4'[/cyan]
    """
    refuse_unused(context, UNUSED)
    m = load_machine(machine)
    if (taps is None) == (not identify):
        raise StiffmapError(
            "expected either --identify, with the effects, or --taps, with the number of poses"
        )
    if taps is not None:
        return _taps(m, taps, poses, seed, output)
    if rival and for_map:
        raise StiffmapError("--map and --rival exclude each other")
    aim = "separate" if rival else "map" if for_map else "identify"
    how: dict[str, Any] = {
        "quantity": quantity, "poses": poses, "force": force, "axes": tuple(read.split(",")), "frame": frame,
        "tool": tool, "noise": in_si(noise), "seed": seed,
    }  # fmt: skip
    if until is not None:
        return _sequential(m, identify or (), twin, until, rows, how)
    workpiece = np.array([MM * numbers(t, "at", 3) for t in at]) if at else None
    found = plan(m, identify or (), rows=rows, aim=aim, rival=rival or (), position=workpiece, **how)
    if output is not None:
        columns = plan_columns(found.experiment)
        write_rows(output, list(columns), zip(*columns.values(), strict=True))
    return Answer(found.as_plain(), found.lines())


def _taps(m: Machine, count: int, tries: int, seed: int, output: Path | None) -> Answer:
    poses = [[round(float(v), 1) for v in p] for p in where_to_tap(m, count, tries=tries, seed=seed) / MM]
    if output is not None:
        write_rows(output, ["x_mm", "y_mm", "z_mm"], poses)
    none: dict[str, Any] = {"parameters": [], "value": None, "value_random": None}
    told = [f"{len(poses)} poses to tap, the most informative first (x, y, z in mm)"]
    told += ["  " + ", ".join(f"{v:.1f}" for v in p) for p in poses]
    return Answer({"aim": "taps", "rows": len(poses), "poses_mm": poses, **none}, told)


def _sequential(
    m: Machine, identify: Sequence[str], twin: list[str] | None, until: float, rows: int, how: dict[str, Any]
) -> Answer:
    """Plan, simulate, fit, again."""
    terms = effects_of(m, identify)
    seeds = itertools.count(how["seed"])
    steps = follow(
        m, terms, lambda e: simulate(m, e, twin or terms, seed=next(seeds)), until=until, batch=rows, **how
    )
    met = steps[-1][1].worst <= until
    told = []
    found: list[dict[str, Any]] = [{"rows": n, "parameters": e.as_plain()} for n, e in steps]
    for step in found:
        each = (f"{p['name']} {with_uncertainty(p['value'], p['u'])} {p['unit']}" for p in step["parameters"])
        told.append(f"{step['rows']} rows: {', '.join(each)}")
    why = f"every u is at most {until:g} of a typical size" if met else "rows used up"
    told.append(f"stopped: {why}")
    return Answer({"met": met, "steps": found}, told)
