from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from stiffmap.common.errors import StiffmapError
from stiffmap.common.number_text import place_text
from stiffmap.machining.chatter import stability_lobes
from stiffmap.machining.process import Process, load_process
from stiffmap.ui.cli import options
from stiffmap.ui.cli.inputs import MM, gravity, in_si, machine_with, numbers, percent, position, rotation
from stiffmap.ui.cli.options import PLANE, check_count, option
from stiffmap.ui.cli.output import Answer, write_files

RPM = 60 / (2 * math.pi)


def command(
    machine: options.Machine,
    process: str = option("Process file, or a shipped name: slot.", ...),
    at: options.Places = None,
    feed: str | None = option("Direction of the feed, base axes. [default: x, or y across the tool]"),
    tool: str | None = option(
        "Direction from the tool's tip to its holder, base axes. [default: the flange's]"
    ),
    rotation_: options.Rotation = None,
    speeds: str | None = option("Lowest and highest speed, rpm, e.g. 2000,12000."),
    depth: float | None = option("Top of the diagram, mm."),
    points: str = option("Number of speeds and of depths.", "120,80"),
    damping: str | None = option(
        "Damping ratios of the modes in %, e.g. 2 or 3,1.5; default: the machine file's."
    ),
    mode: list[str] | None = option(
        "A mode of spindle and tool besides: Hz, damping in %, modal mass in kg, direction x, y or z of the cut, e.g. "
        "1243,6.2,0.048,x; repeatable."
    ),
    method: str = option("semi-discretization or 'zero order'.", "semi-discretization"),
    effect: options.Effects = None,
    gravity_: options.Gravity = None,
    output: options.Folder = None,
    threads: options.Threads = None,
    scheduler: options.Scheduler = None,
) -> Answer:
    """Stability lobes: at which speed of the spindle what depth of cut does not chatter.

    The modes are the machine's at the pose, and those of spindle and tool that are given. Depths and speeds are those of the
    process where nothing else is said. With -o: diagrams (PNG) and data (NetCDF).

    Exit codes: 0 the process is stable at all poses, 1 it chatters at one, 2 bad input.

    Examples:
      [cyan]stiffmap lobes ur10 --process slot --at -800,-100,250 -o results[/cyan]
      [cyan]stiffmap lobes examples/taps/kr210.yaml --process examples/taps/cut.yaml --speeds 2000,12000 --damping 3[/cyan]
      [cyan]stiffmap lobes linear-delta --process slot --mode 1243,6.2,0.048,x --mode 1747,2.9,0.1,y --json[/cyan]
    """
    m = machine_with(machine, effect)
    p = load_process(process)
    sizes = numbers(points, "points", 2)
    check_count("--points", max(sizes), PLANE)
    many = sizes.astype(int)
    if min(many) < 2:
        raise StiffmapError(f"--points: expected two numbers from 2 on, got '{points}'")
    ends = in_si(speeds, "speeds", 2, 1 / RPM)
    if ends is not None and not 0 < ends[0] < ends[1]:
        raise StiffmapError(f"--speeds: expected a lowest and a highest speed in rpm, got '{speeds}'")
    if depth is not None and not depth > 0:
        raise StiffmapError(f"--depth: expected a depth above zero in mm, got {depth:g}")
    given: dict[str, Any] = {
        "speeds": None if ends is None else np.linspace(ends[0], ends[1], many[0]),
        "depths": None if depth is None else MM * np.linspace(0, depth, many[1] + 1)[1:],
        "diagram": tuple(many.tolist()),
        "feed": in_si(feed, "feed", 3, 1.0),
        "tool": in_si(tool, "tool", 3, 1.0), "also": _modes(mode), "method": method,
        "rotation": rotation(rotation_), "gravity": gravity(gravity_), "threads": threads,
        "scheduler": scheduler,
        "damping": None if damping is None else percent(damping, "damping"),
    }  # fmt: skip
    answers = [_one(m, p, text, given, output, i) for i, text in enumerate(at or [None])]
    data = {"machine": m.name, "process": p.name, "poses": answers}
    lines = (line for a in answers for line in _lines(a))
    return Answer(data, lines, finding=not all(a["stable"] for a in answers))


def _one(
    machine: Any, p: Process, at: str | None, given: dict[str, Any], output: Path | None, i: int
) -> dict[str, Any]:
    place = position(at, machine)
    ds = stability_lobes(machine, p, place, **given)
    a = ds.attrs
    out: dict[str, Any] = {
        "at_mm": (place / MM).tolist(), "modes": a["modes"], "damping": a["damping"],
        "tool": a["tool"], "feed": a["feed"],
        "least_limit_mm": a["least"] / MM, "chatter_frequency_Hz": a["frequency"],
        "least_on_diagram_mm": float(ds.limit.min()) / MM,
        "least_at_rpm": float(ds.speed.values[int(ds.limit.values.argmin())]) * RPM,
        "coupling_limit_mm": a["coupling"] / MM,
        "process": {"speed_rpm": p.spindle * RPM, "depth_mm": p.cut.axial / MM, "limit_mm": a["limit_at_process"] / MM,
            "multiplier": a["at_process"],
        },
        "stable": a["at_process"] < 1,
        "stable_speeds": [{"speed_rpm": s * RPM, "limit_mm": d / MM} for s, d in a["stable_speeds"]],
    }  # fmt: skip
    if output is not None:
        out["files"] = list(map(str, write_files(output, _files(ds, p, machine.name, place, i))))
    return out


def _modes(given: list[str] | None) -> list[tuple[float, float, float, str]]:
    out = []
    for text in given or []:
        parts = [t.strip() for t in text.split(",")]
        if len(parts) != 4:
            raise StiffmapError(
                f"--mode: expected Hz, damping in %, modal mass in kg, direction, e.g. 1243,6.2,0.048,x; got '{text}'"
            )
        f, mass = numbers(f"{parts[0]},{parts[2]}", "mode", 2)
        out.append((float(f), float(percent(parts[1], "mode", 1)[0]), float(mass), parts[3]))
    return out


def _files(ds: xr.Dataset, p: Process, name: str, place: Any, i: int) -> Iterator[tuple[str, Any]]:
    from stiffmap.ui.plot.modes import lobes_figure

    stem = "lobes" if i == 0 else f"lobes_{i + 1}"
    yield f"{stem}.png", lobes_figure(ds, f"{name} at {place_text(place)}: {p.name}", p.spindle, p.cut.axial)
    yield f"{stem}.nc", ds.assign_attrs(stable_speeds=np.ravel(ds.attrs["stable_speeds"]))


def _lines(a: dict[str, Any]) -> Iterator[str]:
    p, where = a["process"], ", ".join(f"{v:g}" for v in a["at_mm"])
    limit = p["limit_mm"]
    word = "stable" if a["stable"] else "chatters"
    verdict = f"{word}: {p['depth_mm']:.4g} mm at {p['speed_rpm']:.0f} rpm (multiplier {p['multiplier']:.3f})"
    if np.isfinite(limit):
        verdict += f"; from {_down(limit)} mm on it chatters"
    yield f"at ({where}) mm, damping {a['damping']}: {verdict}"
    axes = (", ".join(f"{v + 0.0:.3g}" for v in a[name]) for name in ("tool", "feed"))
    yield "  tool from tip to holder along ({}), feed along ({})".format(*axes)
    if np.isfinite(a["least_on_diagram_mm"]):
        yield f"  least limit {_down(a['least_on_diagram_mm'])} mm, at {a['least_at_rpm']:.0f} rpm"
    yield (
        f"  zero order, any speed: {_down(a['least_limit_mm'])} mm ({a['chatter_frequency_Hz']:.1f} Hz); without regeneration modes "
        f"couple from {_down(a['coupling_limit_mm'])} mm on"
    )
    if a["stable_speeds"]:
        pockets = (f"{s['speed_rpm']:.0f} rpm ({_down(s['limit_mm'])} mm)" for s in a["stable_speeds"])
        yield f"  deepest between lobes: {', '.join(pockets)}"
    yield f"  {a['modes']} modes"
    for f in a.get("files", []):
        yield f"  wrote {f}"


def _down(limit: float) -> str:
    """A limit (mm) of four digits, never rounded up."""
    if not 0 < limit < np.inf:
        return f"{limit:g}"
    unit = 10.0 ** (np.floor(np.log10(limit)) - 3)
    return f"{np.floor(limit / unit * (1 - 1e-12)) * unit:.4g}"
