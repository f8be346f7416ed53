"""The measured sets: a reader and a question for each. A set is a folder of the data's folder."""

from __future__ import annotations

import math
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import stiffmap as sm
from board.peers import beside_arm, plain_places
from board.row import Row
from board.sources import SOURCES, absent
from stiffmap.experiment import Experiment
from stiffmap.experiment.files.load import load_experiment
from stiffmap.identification.calibration import Calibration
from stiffmap.identification.diagnosis import Diagnosis

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
sys.path.insert(0, str(EXAMPLES))
LENGTH = 1e3 * math.sqrt(3.0)
"""From rms of the coordinates in m to rms of the length in mm."""


@dataclass(frozen=True)
class Asked:
    """What the command line wants."""

    quick: bool
    peers: dict[str, str]
    """Pythons that have a peer, by its name."""


@dataclass(frozen=True)
class MeasuredSet:
    """A set that stiffmap can read."""

    folder: str
    name: str
    authors: str
    rows: Callable[[Path, Asked], Iterator[dict[str, Any]]]
    """Fields of its rows, one after the other."""

    @property
    def source(self) -> str:
        """Where it is to be had, and its licence."""
        return str(SOURCES[self.folder])


def all_rows(
    data: Path, asked: Asked, say: Callable[[str], None], only: list[str] | None = None
) -> Iterator[Row]:
    """Every row: sets that are read, sets that are absent, folders that nothing here reads; or `only` some folders."""
    for one in (s for s in SETS if only is None or s.folder in only):
        known = {"source": one.source, "authors": one.authors}
        if not (data / one.folder).is_dir():
            say(f"{one.name}: {absent(one.folder)}")
            yield Row(one.name, **known, status="absent", note=absent(one.folder))
            continue
        try:
            for fields in one.rows(data / one.folder, asked):
                row = Row(**{"set": one.name, **known, **fields})
                say(f"{row.set}: {row.before:.3g} -> {row.after:.3g}, {row.cause} ({row.seconds:.0f} s)")
                yield row
        except Exception as error:  # a set that cannot be read is a row as well, and the others follow
            say(f"{one.name}: {error}")
            yield Row(one.name, **known, status="failed", note=f"{type(error).__name__}: {error}")
    known_folders = {one.folder for one in SETS}
    for folder in sorted(data.iterdir()) if data.is_dir() and only is None else ():
        if folder.is_dir() and folder.name not in known_folders:
            yield Row(
                folder.name, "see the folder", "unknown", status="absent", note="no reader for this set yet"
            )


@contextmanager
def _scratch() -> Iterator[Path]:
    with tempfile.TemporaryDirectory() as folder:
        yield Path(folder)


def ur5(data: Path, asked: Asked) -> Iterator[dict[str, Any]]:
    """The grid is diagnosed; 20 random poses judge. Frame and reflector are those of the grid."""
    import measured_ur5 as example

    with _scratch() as folder:
        begun = time.process_time()
        declared = sm.load_machine(example.MACHINE)
        t, seen = example.joined(data, 1000)
        example.write(declared, t, seen, folder / "all")
        whole = load_experiment(folder / "all")
        new = np.arange(len(whole)) >= seen
        d = sm.diagnose(declared, whole.rows(~new), seed=0)
        d.machine.save(folder / "machine.yaml")
        corrected = sm.load_machine(folder / "machine.yaml")
        used = time.process_time() - begun
        before, after = (_mean(example.unseen(m, whole, new)) for m in (declared, corrected))
        q = np.radians(np.column_stack([t[f"joint_{i}"] for i in range(1, 7)]))
        place = 1e-3 * np.column_stack([t[f"{a}_t"] - t[f"{a}_dif"] for a in "xyz"])
        yield {
            "quantity": "mean length of the position error, mm",
            "before": before,
            "after": after,
            "unseen_rows": int(new.sum()),
            "unseen_by": "random poses of the authors, never fitted",
            "cause": _cause(d),
            "seconds": used,
            "peers": (plain_places(declared, q, place, new),),
        }


def _mean(left: Any) -> float:
    return float(1e3 * np.linalg.norm(left[:, :3], axis=1).mean())


def ur10(data: Path, asked: Asked) -> Iterator[dict[str, Any]]:
    """Each series by itself: five folds of its poses."""
    import measured_arm as example

    every = 8 if asked.quick else 1
    for series, kind in (
        ("C", "random poses"),
        ("B", "a grid in other configurations"),
        ("D", "cubes of ISO 9283"),
    ):
        with _scratch() as folder:
            begun = time.process_time()
            example.write(data, [series], every, folder)
            d = sm.diagnose("ur10", folder, seed=0)
            yield {
                "set": f"UR10, laser tracker, series {series} ({kind})",
                "quantity": "rms length of the position error, mm",
                **_left_out(d, _cause(d), LENGTH, begun),
                "unseen_by": "five folds of poses" + (f", one row of {every}" if every > 1 else ""),
                "peers": beside_arm(folder, asked.peers) if series == "C" else (),
            }


def board(data: Path, asked: Asked) -> Iterator[dict[str, Any]]:
    """A camera at the wrist over a board: every fourth pose is unseen, frame and tool fitted to what is judged."""
    import measured

    with _scratch() as folder:
        (_, machine, fit) = next(measured.board(data, folder, 1))
        unseen = measured.board_poses(data, folder / "unseen", "unseen")
        yield _fitted(machine, fit, unseen, "every fourth pose, its frame and tool fitted")


def sockets(data: Path, asked: Asked) -> Iterator[dict[str, Any]]:
    """A ball in two sockets: fitted at the first half of the places of the sockets, judged at the others."""
    import measured

    with _scratch() as folder:
        for case, machine, e in measured.sockets(data, folder, 1):
            places = list(dict.fromkeys(e.setup))
            fit = np.isin(e.setup, places[: len(places) // 2])
            how = f"other places of the sockets ({len(places) // 2} of {len(places)} fitted), frames and tool fitted"
            row = _fitted(machine, e.rows(fit), e.rows(~fit), how)
            yield {"set": f"Franka Panda, a ball in two sockets, {case}", **row}


def _fitted(machine: sm.Machine, fit: Experiment, unseen: Experiment, how: str) -> dict[str, Any]:
    begun = time.process_time()
    d = sm.diagnose(machine, fit, seed=0)
    used = time.process_time() - begun
    before, after = (
        1e3
        * float(
            np.linalg.norm([v for k, v in sm.residual(m, unseen).summary.per_axis.items() if k[0] == "d"])
        )
        for m in (machine, d.machine)
    )
    return {
        "quantity": "rms length of the position error, mm",
        "before": before,
        "after": after,
        "unseen_rows": len(unseen),
        "unseen_by": how,
        "cause": _cause(d),
        "seconds": used,
    }


def _cause(d: Diagnosis) -> str:
    """The verdict, and what is named, the largest share first."""
    found = [(e.evidence.get("share", 0.0), " ".join([e.kind, e.element, *e.legs])) for e in d.effects]
    found += [(n.share, n.name) for n in (d.calibration.beyond if d.calibration else ())]
    return (
        f"{d.verdict}: " + ", ".join(name for _, name in sorted(found, reverse=True)) if found else d.verdict
    )


def _left_out(found: Diagnosis | Calibration, cause: str, factor: float, begun: float) -> dict[str, Any]:
    """Fields of a set that is predicted fold by fold, begun at a processor time; factor: from SI."""
    assert found.held_out is not None
    return {
        "before": factor * found.held_out.before.size[0],
        "after": factor * found.held_out.after.size[0],
        "unseen_rows": len(found.experiment),
        "cause": cause,
        "seconds": time.process_time() - begun,
    }


def delta(data: Path, asked: Asked) -> Iterator[dict[str, Any]]:
    """Heights of a bed; each session is predicted from the other three."""
    import measured_delta_files as example

    every = 7 if asked.quick else 1
    with _scratch() as folder:
        begun = time.process_time()
        (folder / "heights").mkdir()
        (folder / "flsun.yaml").write_text(example.machine(), encoding="utf-8")
        columns = "".join(f"  q{t}: {{actuator: {t}.carriage, unit: mm}}\n" for t in example.TOWERS)
        head = example.HEAD.replace(", dd: 0.04", "")
        (folder / "heights" / "experiment.yaml").write_text(head + columns, encoding="utf-8")
        lines = [["id", "setup", "qa", "qb", "qc", "contact"], *example.rows(data, every)]
        text = "\n".join(",".join(map(str, line)) for line in lines)
        (folder / "heights" / "data.csv").write_text(text + "\n", encoding="utf-8")
        # a diagnosis of all rows takes more than ten minutes
        c = sm.calibrate(folder / "flsun.yaml", folder / "heights")
        assert c.held_out is not None
        yield {
            "quantity": "rms of the height, mm",
            **_left_out(c, f"calibration: {c.verdict}", 1e3, begun),
            "unseen_by": f"left out: {c.held_out.by}, one after the other",
        }


def gearbox(data: Path, asked: Asked) -> Iterator[dict[str, Any]]:
    """A test of each variant and state of a gearbox; ramps of torque are left out in turn."""
    import measured_actuator_files as example

    with _scratch() as folder:
        tests = example.write(data, folder, "")
        first: dict[tuple[str, str], str] = {}
        for test, kind in sorted(tests.items()):
            first.setdefault(kind, test)
        for (variant, state), test in sorted(first.items())[: 2 if asked.quick else None]:
            begun = time.process_time()
            d = sm.diagnose(folder / "gear.yaml", folder / test, seed=0)
            yield {
                "set": f"Cycloidal actuator, {variant.replace('_', ' ')}, {state.replace('_', ' ')}",
                "quantity": "rms of the twist, deg",
                **_left_out(d, _cause(d), math.degrees(1.0), begun),
                "unseen_by": "ramps of torque, one after the other",
            }


SETS = (
    MeasuredSet(
        "ur5_tracker",
        "UR5, laser tracker",
        "0.155 mm mean (P. Jacobi's network on top of a geometric calibration; probably after compensation)",
        ur5,
    ),
    MeasuredSet(
        "ipa_ur10_accuracy",
        "UR10, laser tracker",
        "no calibrated figure is published with the data",
        ur10,
    ),
    MeasuredSet(
        "franka_board",
        "Franka Panda, a camera at the wrist over a board",
        "no calibrated figure is published with the data",
        board,
    ),
    MeasuredSet(
        "ball_in_socket",
        "Franka Panda, a ball in two sockets",
        "0.27 for robot 6, 0.31 for robot 7 (the authors' calibrated files on the same rows)",
        sockets,
    ),
    MeasuredSet(
        "flsun_v400_delta",
        "FLSUN V400 delta printer, bed heights",
        "at most 0.05 mm at the 7 points that the firmware's calibration was fitted to",
        delta,
    ),
    MeasuredSet(
        "cycloidal_actuator_play",
        "Cycloidal actuator, torque ramps",
        "no model of the loops is published with the data",
        gearbox,
    ),
)
