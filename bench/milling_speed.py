"""Milling: points to equilibrium and commands, placements, and a long G-code file.

python bench/milling_speed.py [--points 100000] [--placements 10000] [--lines 1000000] [--machine orthoglide-revised] [--threads 2]
"""

from __future__ import annotations

import argparse
import resource
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

import stiffmap as sm
from stiffmap.common.texts import lines_of
from stiffmap.machining.milling.equilibrium import Plant, commanded, equilibrium
from stiffmap.machining.milling.placement import PlacementSearch
from stiffmap.machining.milling.setting import setting
from stiffmap.machining.toolpath import outline, sampled
from stiffmap.machining.toolpath.gcode.load import load_gcode
from stiffmap.machining.toolpath.gcode.read import ProgramReader, read_moves


def main() -> None:
    """Print one line per step; fails where a command is further than 1e-9 m from the path."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--machine", default="orthoglide-revised")
    parser.add_argument("--points", type=int, default=100_000)
    parser.add_argument("--placements", type=int, default=10_000)
    parser.add_argument("--lines", type=int, default=1_000_000)
    parser.add_argument("--threads", type=int, default=2)
    given = parser.parse_args()
    machine = sm.load_machine(given.machine)
    if given.points:
        points(machine, given.points, given.threads)
    if given.placements:
        many(machine, given.placements, given.threads)
    if given.lines:
        program(given.lines)


def points(machine: sm.Machine, count: int, threads: int) -> None:
    """Loaded equilibrium and compensated commands of a washbasin's outline."""
    low, high = machine.workspace
    width, depth = np.minimum(0.7 * (high - low)[:2], (0.34, 0.24))
    path, process = outline("washbasin", (float(width), float(depth))), sm.load_process("trimming")
    size = float(path.length[path.cuts].sum())
    here = sampled(path, size / count)
    middle = machine.workspace.mean(axis=0)
    Plant(setting(machine, path, process, sampled(path), path.placed(middle)))  # the machine is ready
    start, cpu = time.perf_counter(), time.process_time()
    job = setting(machine, path, process, here, path.placed(middle), threads=threads)
    plant = Plant(job)
    e = equilibrium(plant, job.position)
    half, busy = time.perf_counter(), time.process_time() - cpu
    command, _, _ = commanded(plant, e)
    end, all_busy = time.perf_counter(), time.process_time() - cpu
    left = equilibrium(plant, command).error
    print(
        f"{machine.name}, {len(job)} points: equilibrium {half - start:.2f} s ({e.steps} solves), commands {end - half:.2f} s, together "
        f"{end - start:.2f} s; of processor {busy:.2f} s, {all_busy - busy:.2f} s, {all_busy:.2f} s; furthest from the path at the commands "
        f"{np.abs(left).max():.1e} m"
    )
    assert np.abs(left).max() < 1e-9


def many(machine: sm.Machine, count: int, threads: int) -> None:
    """Placements of a part of 500 points."""
    search = PlacementSearch(machine, outline("rectangle"), sm.load_process("trimming"), 500, threads)
    rng = np.random.default_rng(0)
    low, high = machine.workspace
    turn = rng.uniform(-np.pi, np.pi, count)
    at = search.inside(rng.uniform(size=(count, 3)), turn, low, high)
    start, cpu = time.perf_counter(), time.process_time()
    largest = search.largest((at, turn))
    seconds, cpu = time.perf_counter() - start, time.process_time() - cpu
    fits = largest[np.isfinite(largest)]
    print(
        f"{count} placements of {len(search.points)} points: {seconds:.1f} s ({cpu:.1f} s of processor), {len(fits)} in reach, largest error "
        f"{1e3 * fits.min():.3f} to {1e3 * fits.max():.3f} mm"
    )


def program(count: int) -> None:
    """A program of many lines: read one by one, and kept."""
    file = Path(tempfile.mkdtemp()) / "p.nc"
    file.write_text("\n".join(lines(count)), encoding="utf-8")
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    start = time.process_time()
    moves = sum(1 for _ in read_moves(lines_of(file, "\n"), ProgramReader("p")))
    seconds = time.process_time() - start
    streamed = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    start = time.process_time()
    path = load_gcode(file, keep_text=False)
    kept = time.process_time() - start
    most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    print(
        f"{count} lines of G-code, {moves} moves: read in {seconds:.1f} s of processor and {(streamed - before) / 1024:.0f} MB more, kept as arrays in "
        f"{kept:.1f} s of processor and {(most - before) / 1024:.0f} MB more ({len(path)} moves)"
    )


def lines(count: int) -> Iterator[str]:
    """A spiral of short lines with an arc every tenth."""
    yield "G21 G90 G17 S6000 M3 F600"
    for k in range(count - 1):
        x, y = 50 * np.cos(k * 1e-3), 50 * np.sin(k * 1e-3)
        yield f"G2 X{x:.4f} Y{y:.4f} R80" if k % 10 == 9 else f"N{k} G1 X{x:.4f} Y{y:.4f} (pass {k})"


if __name__ == "__main__":
    main()
