"""Speed beside programs that do the same by hand: the Tripteron's stiffness at a pose, unloaded and at the equilibrium under 1 kN."""

from __future__ import annotations

import re
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

CASES = ("stiffness, unloaded", "equilibrium and stiffness, 1 kN")
FORCE = np.array([0, 0, 1000.0, 0, 0, 0])
ROUNDS = 9


def speed(program: str | None) -> list[dict[str, Any]]:
    """Rows: case, package, microseconds a pose, note. All in turn in one run, one thread, the quickest of nine rounds of each.

    program: bench/peers/pinocchio_vjm.cpp, compiled as it says. A peer that is not here is a row that says so.
    """
    sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "peers"))
    from tripteron import grid

    import stiffmap as sm

    machine, poses, some = sm.load_machine("tripteron"), grid(12), grid(4)[::4]
    works: dict[str, tuple[Callable[[], object], Callable[[], object], int]] = {
        "stiffmap": (
            lambda: machine.solve(poses, threads=1),
            lambda: machine.solve(poses, FORCE, threads=1),
            len(poses),
        )
    }
    absent = {}
    try:
        import pinocchio_vjm as by_hand
    except ImportError as error:
        absent["Pinocchio, Python with NumPy"] = str(error)
    else:
        works["Pinocchio, Python with NumPy"] = (
            lambda: [by_hand.unloaded_stiffness(p) for p in some],
            lambda: [by_hand.loaded(p, FORCE) for p in some],
            len(some),
        )
    best = {name: [np.inf, np.inf] for name in works}
    cpp = "Pinocchio, C++ with Eigen"
    if program is None:
        absent[cpp] = "not given (compile bench/peers/pinocchio_vjm.cpp)"
    else:
        best[cpp] = [np.inf, np.inf]
    for _ in range(ROUNDS):
        for name, (*cases, count) in works.items():
            for i, work in enumerate(cases):
                begun = time.perf_counter()
                work()
                best[name][i] = min(best[name][i], 1e6 * (time.perf_counter() - begun) / count)
        if program is not None:
            best[cpp] = [min(a, b) for a, b in zip(best[cpp], of_program(program), strict=True)]
    rows = []
    for i, case in enumerate(CASES):
        rows += [{"case": case, "package": n, "microseconds": t[i], "note": ""} for n, t in best.items()]
        rows += [{"case": case, "package": n, "microseconds": None, "note": why} for n, why in absent.items()]
    return rows


def of_program(program: str) -> tuple[float, float]:
    """Microseconds a pose, unloaded and loaded, as the program prints them."""
    text = subprocess.run([program], check=True, capture_output=True, text=True).stdout
    found = re.search(r"unloaded ([\d.]+) us, loaded \(1 kN\) ([\d.]+) us", text)
    if found is None:
        raise SystemExit(f"{program}: expected a line 'unloaded N us, loaded (1 kN) N us', got {text!r}")
    return float(found[1]), float(found[2])
