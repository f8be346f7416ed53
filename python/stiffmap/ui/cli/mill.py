"""``stiffmap mill``."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import replace
from typing import Annotated, Any

import numpy as np
import typer

from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import StiffmapError
from stiffmap.machining.milling import mill_job
from stiffmap.machining.milling.entry import best_entry
from stiffmap.machining.milling.placement import placements
from stiffmap.machining.milling.redundancy import Redundancy
from stiffmap.machining.milling.redundancy import redundancy as choose_turns
from stiffmap.machining.milling.setting import Setting, setting
from stiffmap.machining.milling.speed import other_side
from stiffmap.machining.process import Process, load_process
from stiffmap.machining.toolpath import Toolpath, box, load_path, sampled
from stiffmap.machining.toolpath.entry import entered_at, turned_round
from stiffmap.solve.machine import load_machine
from stiffmap.solve.status import Status
from stiffmap.ui.cli.inputs import (
    MM,
    CorrectedArgument,
    EffectsOption,
    FolderOption,
    SchedulerOption,
    ThreadsOption,
    finish,
    in_si,
    machine_with,
    numbers,
    pairs,
)
from stiffmap.ui.cli.output import JsonOption, show
from stiffmap.ui.report.milling import placement_summary, summary, write_report

IDLE = "no turn changes the error, as the last joint turns about the tool's own axis; a spindle across the flange would make use of it"


def command(
    machine: CorrectedArgument,
    path: Annotated[
        str,
        typer.Argument(
            help="G-code, CL or CSV file; or an outline: washbasin, bathtub, rectangle, circle, pocket."
        ),
    ],
    process: Annotated[str, typer.Option(help="Process file, or a shipped name: trimming, slot.")],
    output: FolderOption = None,
    at: Annotated[
        str | None, typer.Option(help="Origin of the part on the machine, mm. [default: the machine's home]")
    ] = None,
    turn: Annotated[float, typer.Option(help="Turn of the part about z, deg.")] = 0.0,
    size: Annotated[
        str | None, typer.Option(help="Of a built-in outline, mm, e.g. 340,240 (width,depth).")
    ] = None,
    offset: Annotated[
        list[str] | None, typer.Option(help="Work offset of the G-code, mm, e.g. 'G55=10,0,0'; repeatable.")
    ] = None,
    effect: EffectsOption = None,
    true_machine: Annotated[
        str | None, typer.Option("--true", help="Machine file that the program is also simulated on.")
    ] = None,
    step: Annotated[float, typer.Option(help="Distance of the points along the path, mm.")] = 2.0,
    within: Annotated[float, typer.Option(help="Chord error of the compensated program, mm.")] = 0.001,
    thickness: Annotated[
        float | None, typer.Option(help="Width to trim, mm; default: the process's.")
    ] = None,
    tolerance: Annotated[float | None, typer.Option(help="Tolerance, mm; default: the process's.")] = None,
    passes: Annotated[int, typer.Option(help="Passes along the same program.")] = 1,
    band: Annotated[bool, typer.Option(help="Also under 80 and 120 % of the force.")] = False,
    place: Annotated[
        int | None,
        typer.Option(
            help="Try so many placements first and take the best, refined; instead of --at and --turn."
        ),
    ] = None,
    stock: Annotated[
        str | None,
        typer.Option(
            help="Box of stock, mm, axes of the part: lowest and highest corner, e.g. -90,-60,-5,90,60,0."
        ),
    ] = None,
    reverse: Annotated[
        bool, typer.Option(help="Run the path the other way, conventional for climb and the other way round.")
    ] = False,
    entry: Annotated[
        str | None,
        typer.Option(
            help="Enter a closed outline elsewhere: so many mm along it, or 'best' (the least step)."
        ),
    ] = None,
    feeds: Annotated[
        bool,
        typer.Option(
            help="Choose the largest feed of each move that keeps the error within the tolerance before compensation."
        ),
    ] = False,
    redundancy: Annotated[
        int | None,
        typer.Option(help="Arms: choose the turn about the tool from so many over a full turn, e.g. 72."),
    ] = None,
    threads: ThreadsOption = None,
    scheduler: SchedulerOption = None,
    as_json: JsonOption = False,
) -> None:
    """The part as a machine will cut it, and a program that makes it right.

    The cutting force and the deflection are found together; the compensated program is read back and simulated.
    Exit code 1: a point without an equilibrium, an error beyond the tolerance after compensation, or a drive or joint beyond its limits.

    Examples:

      [cyan]stiffmap mill orthoglide-revised outline.ngc --process trimming --at 50,50,0 -o result[/cyan]

      [cyan]stiffmap mill linear-delta rectangle --size 120,80,15 --process trimming.yaml --at 0,0,300 -o result[/cyan]

      [cyan]stiffmap mill linear-delta circle --size 60 --process trimming --at 0,0,300 --entry best --feeds --tolerance 0.1 -o result[/cyan]

      [cyan]stiffmap mill corrected.yaml outline.ngc --process trimming --true my.yaml --band -o cut[/cyan]
    """
    m = machine_with(machine, effect)
    cut = _process(process, tolerance)
    p = load_path(
        path,
        feed=cut.feed,
        spindle=cut.spindle,
        size=None if size is None else tuple(in_si(size, "size").tolist()),
        offsets=_offsets(offset),
        progress=None if as_json or not sys.stderr.isatty() else _read,
    )
    if reverse:
        p, cut = turned_round(p), other_side(cut)
    corners = in_si(stock, "stock", 6)
    plate = None if corners is None else box(corners[:3], corners[3:])
    where = in_si(at, "at", 3)
    angle = float(np.radians(turn))
    out: dict[str, object] = {}
    if place is not None:
        best = placements(m, p, cut, count=place, threads=threads, scheduler=scheduler)
        where, angle = best.best.at, best.best.turn
        out["placement"] = {"words": best.words(cut.tolerance), **placement_summary(best)}

    def job(path: Toolpath, turns: Floats | None = None) -> Setting:
        place = path.placed(m.description.home.p if where is None else where, angle)
        return setting(
            m, path, cut, sampled(path, MM * step), place, stock=plate, angle=turns,
            thickness=in_si(thickness),
        )  # fmt: skip

    def turned(path: Toolpath) -> Redundancy | None:
        if redundancy is None:
            return None
        return choose_turns(job(path), redundancy, threads=threads, scheduler=scheduler)

    chosen = turned(p)
    if entry is not None:
        p, out["entry"] = _entered(p, entry, job(p, None if chosen is None else chosen.angle), threads)
        chosen = turned(p)
    if chosen is not None:
        out["redundancy"] = {
            "largest_mm": float(1e3 * np.abs(chosen.error).max()), "best_fixed_turn_mm": float(1e3 * chosen.fixed.min()),
            "as_at_home_mm": float(1e3 * np.interp(0.0, chosen.turns, chosen.fixed)),
            **({"note": IDLE} if chosen.idle else {}),
        }  # fmt: skip
    found = mill_job(
        m, p, cut, at=where, turn=angle, step=MM * step, within=MM * within, angle=None if chosen is None else chosen.angle, feeds=feeds, stock=plate,
        true_machine=None if true_machine is None else load_machine(true_machine),
        thickness=in_si(thickness), passes=passes, band=band, threads=threads,
    )  # fmt: skip
    out = {**summary(found), **out}
    if output is not None:
        out["files"] = {k: str(output / v) for k, v in write_report(found, output).items()}
    show(as_json, out, _lines(out))
    states: Any = found.dataset.status.values
    t = cut.tolerance
    after = np.abs(found.dataset.error_normal_after.values)
    beyond = t is not None and not (after <= t).all()
    finish(bool((states != Status.CONVERGED).any() or beyond or any(w.finding for w in found.warnings)))


def _entered(p: Toolpath, text: str, here: Setting, threads: int | None) -> tuple[Toolpath, dict[str, float]]:
    """The path entered elsewhere, and what the step there is."""
    if text == "best":
        best = best_entry(here, threads)
        said = {
            "way_mm": 1e3 * best.way,
            "step_there_mm": 1e3 * best.step,
            "step_as_given_mm": 1e3 * best.given,
        }
        return entered_at(p, best.way), said
    way = float(numbers(text, "entry", 1)[0])
    return entered_at(p, MM * way), {"way_mm": way}


def _read(count: int) -> None:
    """Progress of a long program, on a terminal only."""
    print(f"\r{count} lines read", end="", file=sys.stderr, flush=True)


def _process(name: str, tolerance: float | None) -> Process:
    p = load_process(name)
    if tolerance is None:
        return p
    if not tolerance > 0:
        raise StiffmapError(f"--tolerance: expected a number above zero, got {tolerance}")
    return replace(p, tolerance=MM * tolerance)


def _offsets(given: list[str] | None) -> dict[str, list[float]] | None:
    if not given:
        return None
    out = {"G54": [0.0, 0.0, 0.0]}
    for name, values in pairs(given, "offset").items():
        if name.upper() not in {f"G{n}" for n in range(54, 60)}:
            raise StiffmapError(f"--offset: expected such as G55=10,0,0; got '{name}={values}'")
        out[name.upper()] = [float(v) * MM for v in numbers(values, "offset", 3)]
    return out


def _lines(out: dict[str, object]) -> Iterator[str]:
    yield str(out["verdict"])
    for key, value in out.items():
        if key == "verdict" or value == [] or value is None:
            continue
        if key == "warnings" and isinstance(value, list):
            text = " ".join(w["text"] for w in value)
        elif isinstance(value, dict):
            numbers = {k: v for k, v in value.items() if k != "sentence" and v != []}
            text = ", ".join(f"{k} {_text(v)}" for k, v in numbers.items())
            text = (
                " ".join([value["sentence"], *([f"({text})"] if text else [])])
                if "sentence" in value
                else text
            )
        else:
            text = _text(value)
        yield f"{key}: {text}"


def _text(value: object) -> str:
    """A value in a line: numbers short, a table of numbers in brackets."""
    if isinstance(value, dict):
        return f"({', '.join(f'{k} {_text(v)}' for k, v in value.items())})"
    if isinstance(value, list):
        return ", ".join(_text(v) for v in value)
    return f"{value:.6g}" if isinstance(value, float) else str(value)
