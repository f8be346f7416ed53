"""The table of the fast path: every ratio beside its target, measured in one run.

    python bench/run.py [--bench build/bench/stiffmap_bench] [--rounds 15] [--out bench/results.json]

Needs the installed package and the executable (built into build/bench when --bench is left out: CMake, a C++
compiler). Peers that are not installed are left out with the reason: pip install pin openseespy.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from measure import Row, Stats, interleaved

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE / "peers"))


def executable(path: Path | None) -> Path:
    """The given executable, or the one built here."""
    if path:
        return path
    build = HERE.parent / "build" / "bench"
    configure = ["cmake", "-S", HERE.parent, "-B", build, "-DCMAKE_BUILD_TYPE=Release", "-DSTIFFMAP_BENCH=ON"]
    subprocess.run([*configure, "-DSTIFFMAP_PYTHON=OFF", f"-DPython_EXECUTABLE={sys.executable}"], check=True)
    subprocess.run(["cmake", "--build", build, "--target", "stiffmap_bench"], check=True)
    return build / "bench" / "stiffmap_bench"


def core(program: Path, *words: str) -> dict[str, Any]:
    """One command of stiffmap_bench."""
    answer = subprocess.run([program, *words, "--json"], check=True, capture_output=True, text=True)
    return dict(json.loads(answer.stdout))


def cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@contextmanager
def one_core() -> Iterator[None]:
    """Holds the process on its last core: wandering costs more than it gains."""
    if not hasattr(os, "sched_setaffinity"):
        yield
        return
    allowed = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {max(allowed)})
    try:
        yield
    finally:
        os.sched_setaffinity(0, allowed)


def stats(value: dict[str, float]) -> Stats:
    return Stats(value["median"], value["min"], value["max"])


def peer(name: str) -> Any:
    """Module of a peer, or the reason why it is missing."""
    try:
        return __import__(name)
    except ImportError as e:
        return str(e)


def tripteron_rows(rounds: int) -> list[Row]:
    """Peers and stiffmap.Machine.solve (all of its answers, one thread) in turn."""
    import numpy as np
    from tripteron import grid

    import stiffmap as sm

    machine, poses, some = sm.load_machine("tripteron"), grid(12), grid(4)[::4]
    force = np.array([0, 0, 1000.0, 0, 0, 0])
    works: dict[str, tuple[Callable[[], object], int]] = {
        "unloaded": (lambda: machine.solve(poses, threads=1), len(poses)),
        "loaded": (lambda: machine.solve(poses, force, threads=1), len(poses)),
    }
    pinocchio, opensees = peer("pinocchio_vjm"), peer("opensees")
    if not isinstance(pinocchio, str):
        works["pin unloaded"] = (lambda: [pinocchio.unloaded_stiffness(p) for p in some], len(some))
        works["pin loaded"] = (lambda: [pinocchio.loaded(p, force) for p in some], len(some))
    if not isinstance(opensees, str):
        works["opensees"] = (lambda: [opensees.loaded(p, force) for p in some[:6]], 6)
    times = interleaved(works, rounds)
    return [
        Row.against(
            "Tripteron, unloaded K / Pinocchio + numpy", times, "pin unloaded", "unloaded", 60, pinocchio
        ),
        Row.against("Tripteron, 1 kN + K / Pinocchio + numpy", times, "pin loaded", "loaded", 100, pinocchio),
        Row.against("Tripteron, 1 kN / OpenSees corotational", times, "opensees", "loaded", 200, opensees),
    ]


def core_row(program: Path, rounds: int) -> list[Row]:
    """What the kernels alone need for the Tripteron (displacement and stiffness)."""
    out = []
    for force in ("0", "1000"):
        a = core(
            program,
            "map",
            "--machine",
            "tripteron",
            "--grid",
            "12",
            "--force",
            force,
            "--repeat",
            str(rounds),
        )
        detail = f"{a['iterations']:.2f} iterations, {a['allocations_per_call']:.0f} allocations per call"
        out.append(
            Row(
                f"Tripteron, {force} N, core alone, µs/pose",
                stats(a["us_per_pose_and_thread"]),
                None,
                "",
                detail,
            )
        )
    return out


def orthoglide_rows(program: Path, rounds: int) -> list[Row]:
    """Core alone: reference path and yardstick beside the fast path."""
    a = core(
        program,
        "compare",
        "--machine",
        "orthoglide",
        "--grid",
        "12",
        "--force",
        "300",
        "--repeat",
        str(rounds),
    )
    b = core(program, "passes", "--machine", "orthoglide", "--grid", "4", "--force", "300", "--repeat", "5")
    level = next(n for n in ("v4", "v3", "base") if f"{n}_block_ns" in b)
    us = f"{a['fast_us']['median']:.2f} µs, {a['iterations']:.2f} iterations"
    reference = f"reference {a['reference_us']['median']:.0f} µs, fast {us}"
    unit = a["congruence_inverse_us"]
    inner = 1e-3 * b[f"{level}_iteration_ns"]
    alone = Stats(inner / unit["median"], inner / unit["max"], inner / unit["min"])
    yard = f"congruence + inverse {unit['median']:.3f} µs"
    return [
        Row(
            "Orthoglide, 300 N + K / dense reference path",
            stats(a["reference_over_fast"]),
            15,
            ">=",
            reference,
        ),
        Row(
            "whole pose per iteration / 6x6 yardstick",
            stats(a["iteration_over_congruence"]),
            4,
            "<=",
            f"{yard}, fast {us}",
        ),
        Row("one iteration alone / 6x6 yardstick", alone, 4, "<=", f"{yard}, iteration {inner:.3f} µs"),
    ]


def scaling_row(program: Path, pairs: int) -> Row:
    if cores() < 2:
        return Row("two threads / one", None, 1.9, ">=", "left out: this process may use one core only")
    a = core(program, "scaling", "--machine", "orthoglide", "--grid", "100", "--repeat", str(pairs))
    detail = f"{a['one_thread_us_per_pose']['median']:.2f} µs with one, {a['poses']:.0f} poses, {pairs} pairs"
    return Row("two threads / one", stats(a["ratio"]), 1.9, ">=", detail)


def serial_row(program: Path, rounds: int) -> Row:
    a = core(program, "serial", "--repeat", str(rounds))
    sizes = ", ".join(f"{n}: {a[f'springs_{n}_us']['median']:.2f}" for n in (4, 16, 64, 256))
    return Row(
        "serial leg, exponent of cost per pose",
        Stats(*[a["exponent"]] * 3),
        1.1,
        "<=",
        f"µs by springs {sizes}",
    )


def overhead_row(rounds: int) -> Row:
    """One call on one pose, less the core's time for that pose."""
    import stiffmap as sm

    machine = sm.load_machine("tripteron")
    many = [[0.3, 0.4, 0.5]] * 8
    works = {
        "one": (lambda: [machine.solve([0.3, 0.4, 0.5], threads=1) for _ in range(100)], 100),
        "eight": (lambda: [machine.solve(many, threads=1) for _ in range(100)], 100),
    }
    times = interleaved(works, rounds)
    whole = Stats.of([1e6 * t for t in times["one"]])
    return Row("Python call on one pose, µs (kernel included)", whole, 15, "<=", "Tripteron, unloaded")


def gradient_row(rounds: int) -> Row:
    """Twenty parameters of the Orthoglide: time of solve with derivatives over time of solve."""
    import inspect

    import numpy as np

    import stiffmap as sm

    name = "gradient of 20 parameters / solve alone"
    if "derivatives" not in inspect.signature(sm.Machine.solve).parameters:
        return Row(name, None, 5, "<=", "missing: Machine.solve has no derivatives")
    machine = sm.load_machine("orthoglide-revised")
    rng = np.random.default_rng(0)
    poses, force = rng.uniform(-0.15, 0.25, (2000, 3)), np.array([0, 0, 300.0, 0, 0, 0])
    wanted = twenty()
    works = {
        "solve": (lambda: machine.solve(poses, force, threads=1), len(poses)),
        "gradient": (lambda: machine.solve(poses, force, threads=1, derivatives=wanted), len(poses)),
    }
    times = interleaved(works, rounds)
    ratio = Stats.of([g / s for g, s in zip(times["gradient"], times["solve"], strict=True)])
    return Row(name, ratio, 5, "<=", f"solve {1e6 * Stats.of(times['solve']).median:.2f} µs")


def twenty() -> list[tuple[str, dict[str, Any]]]:
    """Effect parameters, all at zero: what a calibration would ask for."""
    out: list[tuple[str, dict[str, Any]]] = []
    for leg in "xyz":
        drive = {"element": "actuator", "legs": [leg]}
        out += [("zero_offset", {**drive, "error": 0.0}), ("lead_error", {**drive, "slope": 0.0})]
        out += [("length", {"element": "bar", "legs": [leg], "error": 0.0})]
        out += [("tilt", {**drive, "angle_x": 0.0, "angle_y": 0.0, "angle_z": 0.0})]
    out += [("tcp_offset", {"error_x": 0.0, "error_y": 0.0})]
    return out


def flops_row(program: Path) -> tuple[Row, dict[str, Any]]:
    """Arithmetic of a Newton iteration against the peak of the same instruction set."""
    a = core(program, "passes", "--machine", "orthoglide", "--grid", "5", "--repeat", "10")
    level = next(n for n in ("v4", "v3", "base") if f"{n}_block_ns" in a)
    rate, top = a[f"{level}_iteration_gflops"], a[f"{level}_peak_gflops"]
    share = Stats(*[rate / top] * 3)
    return Row(
        f"flop/s of an iteration / peak ({level})", share, None, "", f"{rate:.1f} of {top:.1f} Gflop/s"
    ), a


def machine_kind() -> str:
    """Processor's name and number of cores."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
        name = next(line.split(":", 1)[1].strip() for line in lines if line.startswith("model name"))
    except (OSError, StopIteration):
        name = platform.machine()
    return f"{name}, {os.cpu_count()} cores, {platform.system()}, Python {platform.python_version()}"


def attempt(work: Callable[[], Any], what: str) -> Any:
    """A row that could not be measured says why; the others are measured all the same."""
    try:
        return work()
    except Exception as e:
        return [Row(what, None, None, "", f"failed: {type(e).__name__}: {str(e)[:200]}")]


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--bench", type=Path, help="stiffmap_bench; built when left out")
    parser.add_argument("--rounds", type=int, default=15)
    parser.add_argument("--pairs", type=int, default=9, help="pairs of one and two threads")
    parser.add_argument("--out", type=Path, help="also write the figures as JSON")
    wanted = parser.parse_args()
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(name, "1")  # numpy is not loaded yet
    program = executable(wanted.bench)
    rows: list[Row] = []
    passes: dict[str, Any] = {}

    def flops() -> Row:
        row, found = flops_row(program)
        passes.update(found)
        return row

    alone: dict[str, Callable[[], Any]] = {
        "Tripteron": lambda: tripteron_rows(wanted.rounds),
        "core": lambda: core_row(program, wanted.rounds),
        "Orthoglide": lambda: orthoglide_rows(program, wanted.rounds),
        "serial leg": lambda: serial_row(program, max(3, wanted.rounds // 3)),
        "gradient": lambda: gradient_row(wanted.rounds),
        "Python call": lambda: overhead_row(wanted.rounds),
        "flop/s": flops,
    }
    with one_core():
        for what, work in alone.items():
            found = attempt(work, what)
            rows += found if isinstance(found, list) else [found]
    rows.append(scaling_row(program, wanted.pairs))
    print(machine_kind())
    print(Row.table(rows))
    print(roofline(passes))
    if wanted.out:
        answer = {"machine": machine_kind(), "rows": [r.as_dict() for r in rows], "passes": passes}
        wanted.out.write_text(json.dumps(answer, indent=1) + "\n")
    return 0


def roofline(passes: dict[str, Any]) -> str:
    """Where the time of one pose goes, highest level."""
    level = next((n for n in ("v4", "v3", "base") if f"{n}_block_ns" in passes), None)
    if level is None:
        return ""
    names = [k[len("operations_") :] for k in passes if k.startswith("operations_")]
    lines = [f"\n{'pass (' + level + ')':<22}{'ns/pose':>9}{'operations':>12}{'Gflop/s':>9}"]
    for n in names:
        ns, flop = passes[f"{level}_{n}_ns"], passes[f"operations_{n}"]
        lines.append(f"{n:<22}{ns:>9.1f}{flop:>12.0f}{flop / ns:>9.1f}")
    return "\n".join(lines)


if __name__ == "__main__":
    raise SystemExit(main())
