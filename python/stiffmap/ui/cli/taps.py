from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from stiffmap.experiment import load_experiment
from stiffmap.identification.taps import TapDiagnosis, TapTest, explain_taps, load_taps
from stiffmap.identification.taps.problem import HAMMER, with_causes
from stiffmap.solve.machine import Machine
from stiffmap.ui.cli import options
from stiffmap.ui.cli.inputs import machine_with, percent, words
from stiffmap.ui.cli.options import argument, option
from stiffmap.ui.cli.output import Answer, write_files


def command(
    machine: options.Machine,
    table: options.TablePath = argument(
        "CSV: x_mm, y_mm, z_mm, frequency_Hz; u_Hz, damping_percent, dir_x, dir_y, dir_z; or response, along, hammer."
    ),
    statics: Path | None = option("Experiment folder of the same machine, explained together."),
    only: str | None = option("Kinds of effects to try, separated by commas."),
    mass_u: str = option("Standard uncertainty of masses that declare none, %.", "5"),
    effect: options.Effects = None,
    output: options.Folder = None,
) -> Answer:
    """Which effect explains the frequencies and damping that tap tests found, typed or from measured responses.

    Effects of stiffness, masses of links, dampers, and a hammer held otherwise are tried. Modes are paired by the direction in which
    the tool moves and by frequency. With -o: the corrected machine (corrected.yaml) and a picture of the frequency response before and
    after.

    Exit codes: 0 nothing is missing, 1 an effect was named or the readings do not fit, 2 bad input.

    Examples:
      [cyan]stiffmap taps examples/taps/kr210.yaml examples/taps/taps.csv -o result[/cyan]
      [cyan]stiffmap taps examples/taps/kr210.yaml examples/taps/taps.csv --only compliance --json[/cyan]
    """
    default_u = float(percent(mass_u, "mass-u", 1)[0])
    m = machine_with(machine, effect)
    measured = load_taps(table, m)
    readings = None if statics is None else load_experiment(statics)
    found = explain_taps(m, measured, readings, default_u=default_u, only=words(only))
    rows = found.modes(m, measured)
    files = write_files(output, _files(m, measured, found))
    data = {"machine": m.name, **found.as_plain(), "modes": rows}
    missing = bool(found.named) or not found.fits
    return Answer(data, [found.sentence, *map(_row, rows)], files, finding=missing)


def _row(r: dict[str, Any]) -> str:
    after = "" if r["after_Hz"] is None else f", after {r['after_Hz']:.2f}"
    mac = "" if r["mac"] is None or np.isnan(r["mac"]) else f", MAC {r['mac']:.2f}"
    text = f"  {r['measured_Hz']:8.2f} Hz measured, {r['before_Hz']:8.2f} before{after}{mac}"
    if np.isnan(r["damping_percent"]):
        return text
    text += f"; damping {r['damping_percent']:.2f} % measured, {r['damping_before_percent']:.2f} before"
    return text if (d := r["damping_after_percent"]) is None else f"{text}, after {d:.2f}"


def _files(machine: Machine, measured: TapTest, found: TapDiagnosis) -> Iterator[tuple[str, Any]]:
    from stiffmap.ui.plot.modes import response_figure
    from stiffmap.workspace.vibration import frequency_response

    f = np.geomspace(0.3 * measured.frequency.min(), 2 * measured.frequency.max(), 600)
    at = measured.position[0]
    many = {"before": frequency_response(machine, at, f)}
    own = [(e.place, e.value) for e in found.named if e.place.kind not in HAMMER]
    if own and found.machine is not None:
        many["after"] = frequency_response(found.machine, at, f)
        yield "corrected.yaml", Machine(with_causes(machine.description, own), like=machine)
    yield "response.png", response_figure(many)
