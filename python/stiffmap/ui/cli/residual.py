"""``stiffmap residual``."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from stiffmap.common.json_text import json_text
from stiffmap.common.outputs import make_folder, write_picture, write_text
from stiffmap.experiment import Experiment, Residual, residual
from stiffmap.experiment.channels import Channel
from stiffmap.identification.validity import beyond
from stiffmap.solve.machine import load_machine
from stiffmap.ui.cli import options
from stiffmap.ui.cli.inputs import finish
from stiffmap.ui.cli.options import option
from stiffmap.ui.cli.output import show


def command(
    machine: options.Declared,
    data: options.Experiment,
    rows: int = option("Number of worst rows to print.", 5),
    effect: options.Effects = None,
    output: options.Folder = None,
    threads: options.Threads = None,
    as_json: options.Json = False,
) -> None:
    """Prediction for every reading: rms, per axis, worst rows, noise, lack of fit, model-free checks.

    With -o: residual.csv (mm, rad), residual.json (SI) and pictures. Exit codes: 0 the readings are as
    predicted, 1 they are not (p-value below 1e-3), 2 bad input.

    Examples:

      [cyan]stiffmap residual orthoglide-revised experiments/servo[/cyan]

      [cyan]stiffmap residual orthoglide-revised experiments/servo --rows 20 -o result[/cyan]

      [cyan]stiffmap residual orthoglide-revised experiments/servo --effect 'compliance actuator z scale=2.1'[/cyan]
    """
    declared = load_machine(machine)
    result = residual(declared, data, effect or (), threads=threads)
    if output is not None:
        _write(result, rows, output)
    far = beyond(declared, result.experiment)
    found, told = result.as_plain(rows), lines(result, rows)
    if far is not None:
        found["rows_beyond_calibration"] = int(far.sum())
        told.append(f"  beyond what the machine was calibrated by: {int(far.sum())} of {len(far)} rows")
    show(as_json, found, told)
    finish(result.lack_of_fit < 1e-3)


def _write(r: Residual, rows: int, output: Path) -> None:
    from stiffmap.ui.plot.experiment import figures

    place = make_folder(output)
    r.write_table(place / "residual.csv")
    write_text(place / "residual.json", json_text(r.as_plain(rows)))
    for name, figure in figures(r).items():
        write_picture(place / f"{name}.png", figure, dpi=130)


def lines(r: Residual, rows: int) -> list[str]:
    """The residual in words."""
    s, e = r.summary, r.experiment
    units = {c.name: c for c in e.channels}
    aside = [e.ids[i] for i in r.set_aside.nonzero()[0]]
    out = [f"{e.name}: {s.n} readings of {e.quantity} in {len(e)} rows; reading minus prediction"]
    if np.isfinite(s.rms):
        out.append(f"  all lengths: rms {_mm(s.rms)}, 95 % {_mm(s.p95)}, largest {_mm(s.max)}")
    if s.rotation_rms is not None:
        out.append(f"  all angles: rms {1e3 * s.rotation_rms:.4f} mrad")
    out += [f"  found: {line}" for line in _registered(e)]
    out += [
        f"  {a}: rms {_shown(units[a], v)}, noise {_shown(units[a], _floor(r, a))}"
        for a, v in s.per_axis.items()
    ]
    out.append(f"  rms / noise {s.ratio:.2f}; p-value of this residual {_p_value(r.lack_of_fit)}")
    out += [f"  unknown frames and zeros fitted: {r.nuisances}"] if r.nuisances else []
    out.append(f"  poses beyond noise: {r.groups_off} of {int(e.groups.max()) + 1}")
    out.append(f"  outliers (rows): {', '.join(aside) or 'none'}")
    for c in r.checks:
        told = f"rms/noise {c.rms:.2f}, p = {_p_value(c.p)}" if c.contrasts else c.note
        out.append(f"  {c.name} ({c.meaning}): {told}")
    worst = [f"{i} ({a} {_shown(units[a], v)})" for i, a, v in r.worst(rows)]
    out.append(f"  worst rows: {', '.join(worst) or 'none'}")
    return out + [f"  limit: {text}" for text in r.limitations]


def _registered(e: Experiment) -> list[str]:
    """Where instruments stand and targets sit, in words."""
    out = []
    for name, turn, shift in e.registration:
        angles = np.degrees(Rotation.from_matrix(turn).as_rotvec())
        at = ", ".join(f"{1e3 * v:.3f}" for v in shift)
        out.append(f"{name} at ({at}) mm, rotation vector ({', '.join(f'{a:.4f}' for a in angles)}) deg")
    return out


def _p_value(p: float) -> str:
    return f"{p:.2g}" if p > 1e-99 else "below 1e-99"


def _floor(r: Residual, name: str) -> float:
    return float(r.noise.floor[[c.name for c in r.experiment.channels].index(name)])


def _shown(channel: Channel, value: float) -> str:
    return _mm(value) if channel.unit == "m" else f"{1e3 * value:.4f} mrad"


def _mm(value: float) -> str:
    return f"{1e3 * value:.4f} mm"
