"""A map of many poses into Zarr: time, memory, size; then its figures without storage.

python bench/big_map.py --poses 10000000 [--machine NAME] [--threads 2]
"""

from __future__ import annotations

import argparse
import resource
import tempfile
import time
from pathlib import Path

import numpy as np

import stiffmap as sm


def main() -> None:
    """Print one line per step."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--machine", default="orthoglide-revised")
    parser.add_argument("--poses", type=float, default=1e7)
    parser.add_argument("--threads", type=int, default=2)
    given = parser.parse_args()
    machine = sm.load_machine(given.machine)
    low, high = machine.workspace
    n = round(given.poses ** (1 / 3))
    axes = {a: np.linspace(low[i], high[i], n) for i, a in enumerate("xyz")}
    call = {**axes, "wrench": [100.0, 50.0, -200.0, 0, 0, 0], "plane": None, "threads": given.threads}
    print("estimate:", sm.map_estimate(machine, **call))
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "m.zarr"
        seconds = clock(lambda: sm.error_map(machine, **call, out=out, progress=False).close())
        size = sum(p.stat().st_size for p in out.rglob("*") if p.is_file())
    print(
        f"error_map to Zarr: {n**3} poses in {seconds:.1f} s, {1e6 * seconds / n**3:.2f} us a pose on "
        f"{given.threads} threads, {size / 1e6:.0f} MB on the disk, {peak():.0f} MB resident"
    )
    seconds = clock(lambda: sm.map_statistics(machine, **call, progress=False))
    print(f"map_statistics: {seconds:.1f} s, {1e6 * seconds / n**3:.2f} us a pose, {peak():.0f} MB resident")
    some = np.stack(np.meshgrid(*(a[:: max(1, n // 60)] for a in axes.values())), -1).reshape(-1, 3)
    wrench = np.array(call["wrench"])
    machine.solve(some[:64], wrench, threads=given.threads)
    seconds = clock(lambda: machine.solve(some, wrench, threads=given.threads, stiffness=False))
    print(f"solve alone: {1e6 * seconds / len(some):.2f} us a pose ({len(some)} poses)")


def clock(work: object) -> float:
    """Seconds that a call takes."""
    start = time.perf_counter()
    work()  # type: ignore[operator]
    return time.perf_counter() - start


def peak() -> float:
    """Largest resident memory so far, MB."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


if __name__ == "__main__":
    main()
