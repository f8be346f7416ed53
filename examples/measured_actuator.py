# SPDX-License-Identifier: MIT
"""Report on a real gearbox: what twists between motor and clamped output, held out by torque ramp.

    python examples/measured_actuator.py [DATA]

DATA is the folder with tests.csv and torque_ramps.csv; default measured/cycloidal_actuator_play. The
data (CC BY-SA 4.0, JelmerV, Anti-Backlash Cycloidal Actuator) are not part of stiffmap; without them the script
says so and ends. docs/measured_actuator.md tells the result.

Four models of one joint, each containing the one before: a spring; play; play operators in series, so that the
twist remembers the last extremes of torque (Prandtl and Ishlinskii); a spring that stiffens, besides. Each is
linear in its parameters, fitted to all ramps of a test but one and judged on that one; every ramp has its own zero.
"""

from __future__ import annotations

import csv
import sys
from collections import defaultdict
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
DATA = Path(__file__).resolve().parents[1] / "measured" / "cycloidal_actuator_play"
PLAY = 2.0  # N·m: torque that closes the gap, against friction
MEMORY = (0.5, 1.0, 2.0, 4.0, 8.0, 16.0)  # N·m, half widths of the play operators
LEVELS = (1.0, 2.0, 4.0, 8.0, 16.0)  # N·m, where stiffness may change
MODELS = ("linear", "play", "hysteresis", "stiffening")
SATURATED = 0.9


def operator(torque: Floats, half: float) -> Floats:
    """(n,) play operator: what follows the torque with a slack of `half` on either side, in order of time."""
    out, now = np.empty(len(torque)), 0.0
    for i, t in enumerate(torque):
        now = min(max(now, t - half), t + half)
        out[i] = now
    return out


def features(torque: Floats, model: str) -> Floats:
    """(n, p) columns of one ramp."""
    columns = [torque]
    if model != "linear":
        columns.append(np.clip(torque / PLAY, -1.0, 1.0))
    if model in ("hysteresis", "stiffening"):
        columns += [operator(torque, h) for h in MEMORY]
    if model == "stiffening":
        columns += [np.clip(torque, -k, k) for k in LEVELS]
        columns += [operator(np.clip(torque, -k, k), h) for k in (4.0, 16.0) for h in (1.0, 2.0)]
    return np.column_stack(columns)


def held_out(ramps: list[tuple[Floats, Floats]], model: str) -> tuple[float, float]:
    """rms (deg) of each ramp predicted from the others, and of its hysteresis: loading less unloading."""
    squares, number = 0.0, 0
    built = [(features(t, model), x) for t, x in ramps]
    built = [(f - f.mean(axis=0), x - x.mean()) for f, x in built]
    for k, (f, x) in enumerate(built):
        others = [b for j, b in enumerate(built) if j != k]
        a, y = np.vstack([o[0] for o in others]), np.concatenate([o[1] for o in others])
        ridge = 1e-3 * np.sqrt(np.mean(a**2, axis=0)) * np.sqrt(len(a))
        fit = np.linalg.lstsq(np.vstack([a, np.diag(ridge)]), np.append(y, np.zeros(a.shape[1])), rcond=None)[
            0
        ]
        squares, number = squares + float(np.sum((x - f @ fit) ** 2)), number + len(x)
    return float(np.sqrt(squares / number)), number


def repeat(ramps: list[tuple[Floats, Floats]]) -> float:
    """rms difference (deg) of two ramps at the same torque and direction, over the square root of two."""
    gaps = []
    for (t1, x1), (t2, x2) in pairwise(ramps):
        for sign in (1.0, -1.0):
            one, two = (np.sign(np.gradient(t)) == sign for t in (t1, t2))
            if one.sum() > 5 and two.sum() > 5:
                o = np.argsort(t2[two])
                gaps.append((x1[one] - x1.mean()) - (np.interp(t1[one], t2[two][o], x2[two][o]) - x2.mean()))
    return float(np.sqrt(np.mean(np.concatenate(gaps) ** 2) / 2)) if gaps else np.nan


def main() -> int:
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else DATA
    if not (folder / "torque_ramps.csv").is_file():
        print(f"skipped: no measured data in {folder} (torque_ramps.csv, see docs/measured_actuator.md)")
        return 0
    with (folder / "tests.csv").open(newline="", encoding="utf-8") as stream:
        names = {r["test_id"]: f"{r['variant']} {r['state']}" for r in csv.DictReader(stream)}
    rows: dict[str, dict[int, list[tuple[float, float, float, float]]]] = defaultdict(
        lambda: defaultdict(list)
    )
    with (folder / "torque_ramps.csv").open(newline="", encoding="utf-8") as stream:
        for r in csv.DictReader(stream):
            if int(r["ramp"]) >= 100:
                cells = (float(r[c]) for c in ("time_s", "torque_est_Nm", "position_deg", "torque_cmd_Nm"))
                rows[r["test_id"]][int(r["ramp"])].append(tuple(cells))  # type: ignore[arg-type]
    report(rows, names)
    return 0


def report(rows: dict, names: dict[str, str]) -> None:  # type: ignore[type-arg]
    """One line per variant and state, then all."""
    found: dict[str, list[list[float]]] = defaultdict(list)
    stops = set()
    for test, ramps in rows.items():
        arrays = [np.array(sorted(v)) for v in ramps.values()]
        torque = [(a[:, 1], a[:, 2]) for a in arrays]
        reached = max(float(np.abs(a[:, 1]).max()) for a in arrays)
        if reached < SATURATED * max(float(np.abs(a[:, 3]).max()) for a in arrays):
            stops.add((names[test].split()[0], round(reached)))
        if len(torque) > 1:
            values = [held_out(torque, m)[0] for m in MODELS]
            found[names[test]].append([*values, repeat(torque), repeat(torque[-2:])])
    print(
        f"{'held-out rms, deg':40}"
        + "".join(f"{m:>12}" for m in (*MODELS, "repeat", "last two"))
        + "  dominated by"
    )
    for name, values in sorted(found.items()):
        mean = np.sqrt(np.mean(np.array(values) ** 2, axis=0))
        gains = mean[:3] ** 2 - mean[1:4] ** 2
        print(f"{name:40}" + "".join(f"{v:12.2f}" for v in mean) + f"  {MODELS[1 + int(np.argmax(gains))]}")
    tests = np.array([v for values in found.values() for v in values])
    print(f"{'all tests, mean':40}" + "".join(f"{v:12.2f}" for v in tests.mean(axis=0)))
    print(f"{'all tests, median':40}" + "".join(f"{v:12.2f}" for v in np.median(tests, axis=0)))
    for variant, most in sorted(stops):
        print(f"saturated: {variant} stops at ±{most} N·m although more is commanded")


if __name__ == "__main__":
    raise SystemExit(main())
