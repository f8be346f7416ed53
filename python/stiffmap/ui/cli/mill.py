from __future__ import annotations

import math
import sys
from collections.abc import Iterator

from stiffmap.machining.milling import mill_job
from stiffmap.ui.cli import options
from stiffmap.ui.cli.inputs import MM, in_si, machine_with, pairs
from stiffmap.ui.cli.options import argument, how_many, option
from stiffmap.ui.cli.output import Answer
from stiffmap.ui.report.milling import summary, write_report


def command(
    machine: options.Corrected,
    path: options.TableText = argument(
        "G-code, CL or CSV file; or an outline: washbasin, bathtub, rectangle, circle, pocket."
    ),
    process: str = option("Process file, or a shipped name: trimming, slot.", ...),
    output: options.Folder = None,
    at: str | None = option("Origin of the part on the machine, mm. [default: the machine's home]"),
    turn: float = option("Turn of the part about z, deg.", 0.0),
    size: str | None = option("Of a built-in outline, mm, e.g. 340,240 (width,depth)."),
    offset: list[str] | None = option("Work offset of the G-code, mm, e.g. 'G55=10,0,0'; repeatable."),
    effect: options.Effects = None,
    true_machine: str | None = option("Machine file that the program is also simulated on.", None, "--true"),
    step: float = option("Distance of the points along the path, mm.", 2.0),
    within: float = option("Chord error of the compensated program, mm.", 0.001, min=0),
    thickness: float | None = option("Width to trim, mm; default: the process's."),
    tolerance: float | None = option("Tolerance, mm; default: the process's."),
    passes: int = how_many("Passes along the same program.", 1),
    band: bool = option("Also under 80 and 120 % of the force.", False),
    place: int | None = how_many(
        "Try so many placements first and take the best, refined; instead of --at and --turn."
    ),
    stock: str | None = option(
        "Box of stock, mm, axes of the part: lowest and highest corner, e.g. -90,-60,-5,90,60,0."
    ),
    reverse: bool = option(
        "Run the path the other way, conventional for climb and the other way round.", False
    ),
    entry: str | None = option(
        "Enter a closed outline elsewhere: so many mm along it, or 'best' (the least step)."
    ),
    feeds: bool = option(
        "Choose the largest feed of each move that keeps the error within the tolerance before compensation.",
        False,
    ),
    redundancy: int | None = option(
        "Arms: choose the turn about the tool from so many over a full turn, e.g. 72."
    ),
    threads: options.Threads = None,
    scheduler: options.Scheduler = None,
    as_json: options.Json = False,
) -> Answer:
    """The part as a machine will cut it, and a program that makes it right.

    The cutting force and the deflection are found together; the compensated program is read back and simulated.
    Exit code 1: a point without an equilibrium, an error beyond the tolerance after compensation, or a drive or joint beyond its limits.

    Examples:
      [cyan]stiffmap mill orthoglide-revised outline.ngc --process trimming --at 50,50,0 -o result[/cyan]
      [cyan]stiffmap mill linear-delta rectangle --size 120,80,15 --process trimming.yaml --at 0,0,300 -o result[/cyan]
      [cyan]stiffmap mill linear-delta circle --size 60 --process trimming --at 0,0,300 --entry best --feeds --tolerance 0.1 -o result[/cyan]
      [cyan]stiffmap mill corrected.yaml outline.ngc --process trimming --true my.yaml --band -o cut[/cyan]
    """
    found = mill_job(
        machine_with(machine, effect), path, process, at=in_si(at, "at", 3), turn=math.radians(turn), size=in_si(size, "size"),
        offset=_offsets(offset), true_machine=true_machine, step=MM * step, within=MM * within, thickness=in_si(thickness),
        tolerance=in_si(tolerance), passes=passes, band=band, place=place, stock=in_si(stock, "stock", 6), reverse=reverse,
        entry="best" if entry == "best" else None if entry is None else float(in_si(entry, "entry", 1)[0]), feeds=feeds,
        redundancy=redundancy, threads=threads, scheduler=scheduler, progress=None if as_json or not sys.stderr.isatty() else _read,
    )  # fmt: skip
    out = summary(found)
    if output is not None:
        out["files"] = {k: str(output / v) for k, v in write_report(found, output).items()}
    return Answer(out, _lines(out), finding=found.finding)


def _read(count: int) -> None:
    print(f"\r{count} lines read", end="", file=sys.stderr, flush=True)


def _offsets(given: list[str] | None) -> dict[str, list[float]] | None:
    found = pairs(given, "offset")
    return {name.upper(): in_si(values, "offset", 3).tolist() for name, values in found.items()} or None


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
            if "sentence" in value:
                text = f"{value['sentence']} ({text})" if text else value["sentence"]
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
