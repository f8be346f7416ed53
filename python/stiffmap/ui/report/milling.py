"""The page of a job: the verdict first, then numbers, pictures and where they come from."""

from __future__ import annotations

from collections.abc import Iterable
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from stiffmap.common.fingerprints import digest
from stiffmap.common.number_text import place_text
from stiffmap.common.outputs import make_folder, write_rows, write_text
from stiffmap.machining.milling.choices import Choices, part_lies
from stiffmap.machining.milling.dataset import sizes, verdict
from stiffmap.machining.milling.job import Milled
from stiffmap.machining.milling.limits import outside
from stiffmap.machining.milling.placement import Placements
from stiffmap.machining.milling.redundancy import IDLE
from stiffmap.machining.milling.speed import PathStability
from stiffmap.machining.process import cutting_force
from stiffmap.machining.process.force import force_uncertainty
from stiffmap.solve.kinematics import inverse_kinematics
from stiffmap.solve.status import Status
from stiffmap.ui.plot.milling import error_figure, machine_path_figure, outline_figure
from stiffmap.ui.plot.style import save
from stiffmap.ui.report.sheet import ReportSheet, write_sheet
from stiffmap.workspace.maps.files import write_dataset
from stiffmap.workspace.maps.loading import machine_digest


def summary(found: Milled) -> dict[str, object]:
    """Numbers of a job for JSON; mm, N, s."""
    ds, job = found.dataset, found.job
    force = np.linalg.norm(ds.force.values, axis=1)
    out: dict[str, object] = {
        "machine": job.machine.name,
        "process": job.process.name,
        "path": job.path.name,
        "at_mm": [float(1e3 * v) for v in job.place.at],
        "turn_deg": float(np.degrees(job.place.turn)),
        "points": len(job),
        "length_mm": float(1e3 * job.points.way[-1]),
        "time_s": float(np.sum(np.diff(job.points.way) / job.feed[1:])),
        "verdict": verdict(ds),
        "part_lies": part_lies(job),
        "stability": _stability(found),
        "statuses": {
            s.name: int((ds.status.values == s).sum()) for s in Status if (ds.status.values == s).any()
        },
        "error_normal_mm": sizes(ds.error_normal.where(ds.wall)),
        "error_normal_after_mm": sizes(ds.error_normal_after.where(ds.wall)),
        "error_along_mm": sizes(ds.error_along),
        "error_axial_mm": sizes(ds.error_axial),
        "mirror_leaves_mm": sizes(ds.mirror_left.where(ds.wall)),
        "command_left_mm": float(1e3 * np.nanmax(ds.command_left.values, initial=0.0)),
        "loop_gain": {"least": float(np.nanmin(ds.gain)), "largest": float(np.nanmax(ds.gain))},
        "force_N": {"least": float(np.nanmin(force)), "largest": float(np.nanmax(force))},
        "tolerance_mm": None if job.process.tolerance is None else 1e3 * job.process.tolerance,
        "taper_mm": sizes(ds.taper),
        "beyond_limits": {k: int(v.sum()) for k, v in outside(ds, job.machine).items()},
        "warnings": [{"name": w.name, "points": int(w.points.sum()), "text": w.text} for w in found.warnings],
        "moves_written": found.program.pieces,
        "notes": [*job.path.notes, *([job.process.note] if job.process.note else [])],
    }
    if "error_normal_after_low" in ds:
        out["error_normal_after_band_mm"] = {
            "force 80 %": sizes(ds.error_normal_after_low), "force 120 %": sizes(ds.error_normal_after_high),
        }  # fmt: skip
    if "error_normal_passes" in ds:
        out["error_normal_passes_mm"] = [sizes(p) for p in ds.error_normal_passes]
    if "true_error_normal" in ds:
        out["true_error_normal_mm"] = sizes(ds.true_error_normal.where(ds.wall))
        out["true_error_normal_after_mm"] = sizes(ds.true_error_normal_after.where(ds.wall))
    if found.feeds is not None:
        f = found.feeds
        out["feeds"] = {"time_s": f.time, "before_s": f.before, "held": bool(f.held.all())}
    waves = ds.ripple.values
    if np.isfinite(waves).any() and waves.any():
        out["ripple_mm"] = float(1e3 * np.nanmax(waves))
    return out | ({} if found.choices is None else _chosen(found.choices))


def _chosen(c: Choices) -> dict[str, object]:
    """What was asked for; mm."""
    out: dict[str, object] = {}
    if c.placement is not None:
        out["placement"] = {"words": c.placement.words(c.job.process.tolerance), **_placement(c.placement)}
    if (e := c.entry) is not None:
        steps = {"step_there_mm": e.step, "step_as_given_mm": e.given}
        out["entry"] = {"way_mm": 1e3 * e.way, **{k: 1e3 * v for k, v in steps.items() if v is not None}}
    if (r := c.redundancy) is not None:
        out["redundancy"] = {
            "largest_mm": float(1e3 * np.abs(r.error).max()), "best_fixed_turn_mm": float(1e3 * r.fixed.min()),
            "as_at_home_mm": float(1e3 * np.interp(0.0, r.turns, r.fixed)), **({"note": IDLE} if r.idle else {}),
        }  # fmt: skip
    return out


def _placement(found: Placements) -> dict[str, object]:
    """Numbers of a search for the placement; mm, deg."""
    fits = found.largest[np.isfinite(found.largest)]
    with np.errstate(invalid="ignore", divide="ignore"):
        ratio = np.abs(found.naive_along) / np.abs(found.best_along)
    return {
        "at_mm": [float(1e3 * v) for v in found.best.at], "turn_deg": float(np.degrees(found.best.turn)),
        "largest_error_mm": 1e3 * found.best_error,
        "naive_at_mm": [float(1e3 * v) for v in found.naive.at], "naive_error_mm": 1e3 * found.naive_error,
        "naive_over_best": found.gain,
        "naive_over_best_along": {"median": float(np.median(ratio)), "share_over_3": float((ratio > 3).mean())},
        "worst_over_best": float(fits.max() / found.best_error), "more_than_3_times_the_best": found.three_times,
        "worst_error_mm": float(1e3 * fits.max()), "tried": len(found.largest),
        "in_reach": float(np.isfinite(found.largest).mean()), "limited_by": found.limits,
    }  # fmt: skip


def _stability(found: Milled) -> dict[str, object]:
    """What is said of chatter; rpm."""
    s, spindle = found.stability, found.job.process.spindle
    if not isinstance(s, PathStability):
        return {"sentence": s}
    return {
        "sentence": s.sentence(spindle), "largest_multiplier": float(s.multiplier.max()), "unstable_places": s.unstable,
        "places": len(s.way), "stable_speeds_rpm": [float(60 * v / (2 * np.pi)) for v in s.offered],
        "damping": s.damping,
    }  # fmt: skip


def write_report(found: Milled, folder: str | PathLike[str]) -> dict[str, str]:
    """Write report.html, its pictures, the compensated program and part.nc into a folder; names of the files. Raises FileError."""
    target = Path(folder)
    made = {"report": "report.html", "program": f"compensated{found.program.suffix}", "data": "part.nc"}
    make_folder(target)
    write_text(target / made["program"], found.program.text)
    ds = found.dataset.copy()
    ds.attrs = {k: v if v else "" for k, v in ds.attrs.items()}
    write_dataset(ds, target / made["data"])
    if found.job.angle is not None:
        made["drives"] = "drives.csv"
        write_rows(target / made["drives"], *_drives(found))
    pictures = {}
    for name, caption, figure in (
        ("outline", "The wall of the part, wanted and cut.", outline_figure(found)),
        ("error", "Error across the wall along the path.", error_figure(found.dataset)),
        ("machine", "The path on the machine.", machine_path_figure(found)),
    ):
        made[name] = save(figure, target / f"{name}.png").name
        pictures[caption] = figure
    digests = {
        "machine": machine_digest(found.job.machine),
        "process": digest(found.job.process),
        "compensated program": digest(found.program.text),
    }
    write_sheet(target / made["report"], _sheet(found), pictures, digests)
    return made


def _drives(found: Milled) -> tuple[list[str], list[list[str]]]:
    """Names and rows: what an arm's drives stand at along the compensated path, and the turn about the tool."""
    job, machine = found.job, found.job.machine
    at = inverse_kinematics(machine, found.command, job.rotation).actuators
    prismatic = [machine.compiled.names.is_prismatic(a) for a in machine.actuators]
    scale = np.where(prismatic, 1e3, 180 / np.pi)
    units = ["mm" if p else "deg" for p in prismatic]
    names = ["way_mm", "turn_deg", *(f"{a}_{u}" for a, u in zip(machine.actuators, units, strict=True))]
    assert job.angle is not None
    columns = np.hstack([1e3 * job.points.way[:, None], np.degrees(job.angle)[:, None], at * scale])
    return names, [[f"{v:.9g}" for v in row] for row in columns]


def _range(values: Iterable[float]) -> str:
    """The least and the largest value; one number where they read the same."""
    numbers = list(values)
    return " to ".join(dict.fromkeys(f"{v:.3g}" for v in (min(numbers), max(numbers))))


def _sheet(found: Milled) -> ReportSheet:
    job = found.job
    s: dict[str, Any] = summary(found)
    force, u = cutting_force(job.process), force_uncertainty(job.process)
    mean = ", ".join(f"{v:.1f} ± {e:.1f}" for v, e in zip(force.mean, u, strict=True))
    p, gain = job.process, s["loop_gain"]["largest"]
    gain = abs(gain) if abs(gain) < 1e-9 else gain
    lines = [
        f"{job.path.name} on {job.machine.name}: {s['length_mm']:.0f} mm of cut, {s['time_s']:.1f} s, part at "
        f"{place_text(job.place.at, '.1f')}, turned by {s['turn_deg']:.1f} deg.",
        f"Process {p.name}: {p.cut.side} cut, {1e3 * p.cut.axial:g} mm deep. Along the path as simulated: feed "
        f"{_range(60 * job.feed)} m/min, force {_range(s['force_N'].values())} N.",
        f"At the process file's own feed ({60 * p.feed:.3g} m/min), speed and cut the mean force would be {mean} N along the feed, "
        f"to its left, along the tool, with {force.power:.0f} W at the spindle.",
        f"Error across the wall: positive where material stays on the part. Loop gain kp/k up to {gain:.3g}: "
        f"one mirrored program would leave {s['mirror_leaves_mm']['largest']:.4f} mm.",
        f"The compensated program has {found.program.pieces} cutting moves; it was read back and simulated with the force "
        "evaluated anew at the true distance from the wall.",
    ]
    lines += [*filter(None, [s["part_lies"]]), *(w.text for w in found.warnings)]
    if (f := found.feeds) is not None:
        kept = "the error stays within the tolerance"
        if over := int((~f.held).sum()):
            kept = f"{over} moves are beyond the tolerance at any feed"
        times = f"{f.time:.1f} s of cutting instead of {f.before:.1f} s"
        lines.append(f"Feed of each move chosen: {times}; {kept}.")
    if not any(w.name == "chatter" for w in found.warnings):
        lines.append(str(s["stability"]["sentence"]))
    lines += [f"Note: {n}" for n in s["notes"]]
    measured = [
        (label, s[key])
        for label, key in (
            ("across the wall, as it is", "error_normal_mm"), ("across the wall, compensated", "error_normal_after_mm"),
            ("across the wall, mirrored once", "mirror_leaves_mm"), ("along the path, as it is", "error_along_mm"),
            ("along the tool, as it is", "error_axial_mm"), ("true machine, as it is", "true_error_normal_mm"),
            ("true machine, compensated", "true_error_normal_after_mm"),
        ) if key in s
    ]  # fmt: skip
    band = s.get("error_normal_after_band_mm", {})
    measured += [(f"{force}, compensated", v) for force, v in band.items()]
    measured += [(f"after pass {k}", v) for k, v in enumerate(s.get("error_normal_passes_mm", []), 1)]
    rows = [[label, f"{v['rms']:.5f}", f"{v['largest']:.5f}"] for label, v in measured]
    head = ["error", "rms, mm", "largest, mm"]
    return ReportSheet(f"Milling: {job.path.name}", verdict(found.dataset), lines, head, rows, (2, 3))
