# SPDX-License-Identifier: MIT
"""One inference on measured sets: names, numbers out of tolerance, the rest and the size of each part.

    OPENBLAS_NUM_THREADS=1 python -m bench.measured DATA [SET ...] [--draws 1] [--readings 240]

DATA holds a folder for each set (bench/board/sources.py says where they are to be had; none is part of stiffmap); SET: some of them by name.
"""

from __future__ import annotations

import argparse
import csv
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

import stiffmap as sm
from stiffmap.experiment import Experiment
from stiffmap.experiment.files.load import load_experiment
from stiffmap.experiment.prediction.predict import Predictor
from stiffmap.identification.candidates.sensitivity import plan_of
from stiffmap.identification.inference import columns as of_columns
from stiffmap.identification.inference.chosen import Chosen
from stiffmap.identification.inference.names import infer
from stiffmap.identification.inference.places import Place
from stiffmap.identification.inference.verdict import judged

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent / "examples")]
from board.sources import absent  # noqa: E402

SEEN = -6.0
"""ln variance from which a part is printed."""
PANDA = ((0, 0, 333), (-90, 0, 0), (90, 0, 316), (90, 82.5, 0), (-90, -82.5, 384), (90, 0, 0), (90, 88, 0))
"""Turn about x (deg), way along x and along z (mm): the maker's modified Denavit-Hartenberg table."""
HOME = (0, -45, 0, -135, 0, 90, 0)
CONTROL = [f"j{k}" for k in range(1, 8)]
Case = tuple[str, sm.Machine, Experiment]


def panda() -> str:
    """A Franka Panda whose controller compensates its weight: rigid, without masses."""
    lines, along = [], 0.0
    for k, ((turn, x, z), home) in enumerate(zip(PANDA, HOME, strict=True), 1):
        if k > 1:
            lines.append(
                f"{{offset: l{k}, translation: [{x}, 0, {along}], turns: [{{about: x, by: {turn}}}]}}"
            )
            along = 0.0
        lines.append(
            f"{{actuator: j{k}, kind: revolute, axis: z, home: {home}, rigid: true, range: [-360, 360]}}"
        )
        if k == 1:
            lines.append(f"{{offset: l1, translation: [0, 0, {z}]}}")
        else:
            along = z
    lines.append("{offset: flange, translation: [0, 0, 107]}")
    elements = "\n".join(f"      - {line}" for line in lines)
    return f"""name: panda
title: Franka Panda
units: {{length: mm, force: N, angle: deg}}
home: {{translation: [306.8905665916, 0, 590.2820522970], axes: x-y-z}}
legs:
  arm:
    elements:
{elements}
"""


def ur5(data: Path, folder: Path, draws: int) -> Iterator[Case]:
    """All rows of the grid."""
    import measured_ur5 as example

    machine = sm.load_machine(example.MACHINE)
    t, seen = example.joined(data, 1000)
    example.write(machine, t, seen, folder)
    whole = load_experiment(folder)
    yield "grid", machine, whole.rows(np.arange(len(whole)) < seen)


def ur10(data: Path, folder: Path, draws: int) -> Iterator[Case]:
    """Some 200 rows of each series, and 150 of the home configuration of one."""
    import measured_arm as arm
    import measured_ur10 as home

    machine = sm.load_machine("ur10")
    for series, every in (("C", 14), ("B", 8), ("D", 3)):
        arm.write(data, [series], every, folder / series)
        yield f"series {series}", machine, load_experiment(folder / series)
    home.write(folder / "home", machine, home.table(data / "series_B.csv"), 150)
    yield "series B, one configuration", machine, load_experiment(folder / "home")


def _panda_files(folder: Path, head: str, columns: list[str], rows: list[list[object]]) -> Experiment:
    folder.mkdir(parents=True)
    command = "".join(f"  {j}: {{actuator: arm.{j}, unit: rad}}\n" for j in CONTROL)
    text = f"machine: panda\nquantity: position\nunits: {{length: mm, angle: deg}}\n{head}command:\n{command}"
    (folder / "experiment.yaml").write_text(text, encoding="utf-8")
    with (folder / "data.csv").open("w", newline="", encoding="utf-8") as stream:
        csv.writer(stream).writerows([[*CONTROL, *columns], *rows])
    return load_experiment(folder)


def _rows(file: Path) -> list[dict[str, str]]:
    with file.open(newline="", encoding="utf-8") as stream:
        return list(csv.DictReader(stream))


def _joints(row: dict[str, str]) -> list[object]:
    return [row[f"joint_{k}_rad"] for k in range(1, 8)]


def _panda(folder: Path) -> sm.Machine:
    (folder / "panda.yaml").write_text(panda(), encoding="utf-8")
    return sm.load_machine(folder / "panda.yaml")


def board(data: Path, folder: Path, draws: int) -> Iterator[Case]:
    """Poses of the camera that a fit may see."""
    yield "fit", _panda(folder), board_poses(data, folder / "board", "fit")


def board_poses(data: Path, folder: Path, part: str) -> Experiment:
    """Poses of the camera: those to `fit`, or those that are `unseen`."""
    head = "noise: {dx: 0.5, dy: 0.5, dz: 0.5, rx: 0.06, ry: 0.06, rz: 0.06}\nframe: unknown\ntool: unknown\n"
    seen = [*(f"camera_{a}_mm" for a in "xyz"), *(f"camera_q{a}" for a in "xyzw")]
    rows = [[*_joints(r), *(r[k] for k in seen)] for r in _rows(data / "poses.csv") if r["part"] == part]
    columns = [*(f"p{a}" for a in "xyz"), *(f"pq{a}" for a in "xyzw")]
    return _panda_files(folder, head, columns, rows)


def sockets(data: Path, folder: Path, draws: int) -> Iterator[Case]:
    """A ball in one of two sockets, each robot by itself."""
    machine = _panda(folder)
    head = "noise: {dx: 0.1, dy: 0.1, dz: 0.1}\nframe: unknown\ntool: offset_unknown\n"
    for number in (2, 6, 7):
        rows = [
            [*_joints(r), r["position"], "ball", 50 * int(r["socket"]), 0, 0]
            for r in _rows(data / f"panda_{number}.csv")
        ]
        columns = ["setup", "target", "px", "py", "pz"]
        yield f"panda {number}", machine, _panda_files(folder / f"{number}", head, columns, rows)


def delta(data: Path, folder: Path, draws: int) -> Iterator[Case]:
    """Draws of 200 heights."""
    import measured_delta_files as example

    (folder / "heights").mkdir()
    (folder / "flsun.yaml").write_text(example.machine(), encoding="utf-8")
    columns = "".join(f"  q{t}: {{actuator: {t}.carriage, unit: mm}}\n" for t in example.TOWERS)
    head = example.HEAD.replace(", dd: 0.04", "")
    (folder / "heights" / "experiment.yaml").write_text(head + columns, encoding="utf-8")
    lines = [["id", "setup", "qa", "qb", "qc", "contact"], *example.rows(data, 1)]
    text = "\n".join(",".join(map(str, line)) for line in lines)
    (folder / "heights" / "data.csv").write_text(text + "\n", encoding="utf-8")
    whole, machine = load_experiment(folder / "heights"), sm.load_machine(folder / "flsun.yaml")
    for seed in range(draws):
        chosen = np.random.default_rng(seed).permutation(len(whole))[:200]
        yield f"draw {seed}", machine, whole.rows(np.isin(np.arange(len(whole)), chosen))


def gearbox(data: Path, folder: Path, draws: int) -> Iterator[Case]:
    """A test of each variant and state."""
    import measured_actuator_files as example

    tests = example.write(data, folder, "")
    first: dict[tuple[str, str], str] = {}
    for test, kind in sorted(tests.items()):
        first.setdefault(kind, test)
    machine = sm.load_machine(folder / "gear.yaml")
    for kind, test in sorted(first.items())[: max(3, draws)]:
        yield " ".join(kind), machine, load_experiment(folder / test)


SETS: dict[str, Callable[[Path, Path, int], Iterator[Case]]] = {
    "ur5_tracker": ur5,
    "ipa_ur10_accuracy": ur10,
    "franka_board": board,
    "ball_in_socket": sockets,
    "flsun_v400_delta": delta,
    "cycloidal_actuator_play": gearbox,
}


def said(machine: sm.Machine, experiment: Experiment) -> Iterator[str]:
    """Lines of one answer."""
    begun = time.perf_counter()
    predictor = Predictor(machine, experiment)
    found = infer(predictor, plan_of(predictor))
    columns, search = found.columns, found.search
    v = judged(columns, search)
    took = time.perf_counter() - begun
    model = search.best
    r = float(np.sqrt(np.mean(columns.residual**2)))
    yield (
        f"{v.word} ({took:.0f} s, {len(columns)} of {len(experiment)} rows' readings in use, rms {r:.2f} noise, "
        f"world {model.world}, {len(columns.places)} places, evidence {model.score - search.null.score:+.1f})"
    )
    for n in v.named:
        instead = [*map(_place, n.equivalents), *(f"{b.unknown.name} out of tolerance" for b in n.numbers)]
        near = "; or " + ", ".join(instead) if instead else ""
        yield f"  {_chosen(n.chosen)}, {n.share:.2f} noise, ln odds {n.log_odds:.1f}, scatter {n.scatter:.2f}{near}"
    for c, why in v.refused:
        yield f"  refused: {_chosen(c)}, {model.fit.amplitude(c.part.name):.2f} noise: {why}"
    for b in v.beyond:
        yield f"  out of tolerance: {b.unknown.name} {b.value:+.1f} ± {b.sd:.1f} standard uncertainties of {b.unknown.u:.3g} {b.unknown.unit}"
    for what, text in (("rest", v.rest), ("time", v.time)):
        if text:
            yield f"  {what}: {text}"
    sizes = zip(model.fit.parts, model.fit.t[1:], strict=True)
    yield f"  noise {model.fit.noise:.2f}; " + "; ".join(
        f"{p.name} {np.exp(0.5 * t):.2f}" for p, t in sizes if t > SEEN
    )


def _place(p: Place) -> str:
    return " = ".join(map(str, (p.candidate, *p.aliases)))


def _chosen(c: Chosen) -> str:
    shape = ", ".join(f"{k} {x:.3g}" for k, x in c.place.shapes[c.shape].variant.shape)
    strengths = ", ".join(f"{p.name} {x:.3g} {p.unit}" for p, x in c.strengths)
    return f"{_place(c.place)} ({'; '.join(filter(None, (strengths, shape)))})"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("data", type=Path)
    parser.add_argument("sets", nargs="*", metavar="SET", help=f"some of {', '.join(SETS)}; default all")
    parser.add_argument("--draws", type=int, default=1, help="of sets that are drawn from")
    parser.add_argument(
        "--readings", type=int, default=240, help="in use at most, drawn by poses; effort only"
    )
    o = parser.parse_args()
    of_columns.MOST_READINGS = o.readings
    for name in o.sets or SETS:
        if not (o.data / name).is_dir():
            print(f"{name}: skipped, {absent(name)}")
            continue
        with tempfile.TemporaryDirectory() as scratch:
            for case, machine, experiment in SETS[name](o.data / name, Path(scratch), o.draws):
                print(f"{name}, {case}: ", *said(machine, experiment), sep="\n", flush=True)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
