"""Makes a folder of the measured sets from a clone of its authors' repository; no value is changed.

    git clone https://github.com/christianlandgraf/ipa-robot-accuracy CLONE && git -C CLONE checkout 507fba6
    python bench/convert_set.py ipa_ur10_accuracy CLONE

Repositories and commits are in bench/board/sources.py; the folder is made in `measured`, or where --data says.
"""

from __future__ import annotations

import argparse
import csv
import shutil
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
SERIES = {
    "B": "measurements_joint_configurations",
    "C": "measurements_random_poses",
    "D": "measurements_iso_cubes",
}
READ = [
    f"meas_{s}{a}_{'mm' if a in 'xyz' else 'deg'}"
    for a in ("x", "y", "z", "rx", "ry", "rz")
    for s in ("", "std_")
]
GOAL = [*(f"goal_{a}_m" for a in "xyz"), *(f"goal_{a}_rad" for a in ("roll", "pitch", "yaw"))]


def ur5(clone: Path, out: Path) -> None:
    """The tables are taken as they are."""
    for name in ("grid", "random"):
        found = sorted(clone.glob(f"**/3D_UR5_uncalibrated_{name}*.csv"))
        if not found:
            raise SystemExit(f"{clone}: no table 3D_UR5_uncalibrated_{name}*.csv")
        shutil.copyfile(found[0], out / f"{name}.csv")


def ur10(clone: Path, out: Path) -> None:
    """Names of columns with units, decimal points; times that have lost their digits are left out."""
    head = ["index", *GOAL, *(f"q{k}_rad" for k in range(1, 7)), "temperature_C", *READ]
    for series, name in SERIES.items():
        with (clone / f"Series_{series}" / f"{name}.csv").open(encoding="utf-8-sig", newline="") as stream:
            rows = list(csv.reader(stream, delimiter=";"))[1:]
        cells = ([k, *(c.replace(",", ".") for c in row[1:])] for k, row in enumerate(rows))
        _write(out / f"series_{series}.csv", head, cells)


def sockets(clone: Path, out: Path) -> None:
    """A table for each robot: place of the plate, socket, joints."""
    for robot in ("panda_2", "panda_6", "panda_7"):
        rows = []
        clean = clone / "data" / f"{robot}_clean"
        for file in sorted((clean if clean.is_dir() else clone / "data" / robot).glob("*/hole_[01].csv")):
            with file.open(encoding="utf-8", newline="") as stream:
                rows += [[file.parent.name, file.stem[-1], *row] for row in csv.reader(stream)]
        if not rows:
            raise SystemExit(f"{clone}: no tables data/{robot}/*/hole_[01].csv")
        _write(out / f"{robot}.csv", ["position", "socket", *(f"joint_{k}_rad" for k in range(1, 8))], rows)


def _write(file: Path, head: list[str], rows: Iterable[Sequence[object]]) -> None:
    with file.open("w", encoding="utf-8", newline="") as stream:
        csv.writer(stream, lineterminator="\n").writerows([head, *rows])


SETS: dict[str, Callable[[Path, Path], None]] = {
    "ur5_tracker": ur5,
    "ipa_ur10_accuracy": ur10,
    "ball_in_socket": sockets,
}


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("set", choices=SETS)
    parser.add_argument("clone", type=Path)
    parser.add_argument("--data", type=Path, default=ROOT / "measured", help="folder of the sets [measured]")
    a = parser.parse_args()
    folder = a.data / a.set
    folder.mkdir(parents=True, exist_ok=True)
    try:
        SETS[a.set](a.clone, folder)
    except OSError as error:
        parser.error(str(error))
    print(f"wrote {folder}: {', '.join(sorted(p.name for p in folder.glob('*.csv')))}")


if __name__ == "__main__":
    main()
