"""``experiment new`` and ``residual`` of a million rows: processor time and memory of each command.

python bench/million_rows.py --rows 1e6
"""

from __future__ import annotations

import argparse
import random
import resource
import subprocess
import sys
import tempfile
from pathlib import Path


def write(path: Path, rows: int) -> None:
    """Readings of a five-bar: five repeats of each pose, two loads in turn."""
    rng = random.Random(1)
    with path.open("w", encoding="utf-8") as f:
        f.write("id,x [mm],y [mm],z [mm],fx [N],fy [N],fz [N],dx [um],dy [um],repeat\n")
        for i in range(rows):
            p = i // 5
            at = f"{-60 + p % 120},{340 + (p // 120) % 100 + 1e-3 * (p // 12000):.3f}"
            f.write(
                f"r{i},{at},0,{80 if p % 2 else -80},0,0,{rng.gauss(10, 1):.3f},{rng.gauss(5, 1):.3f},{i % 5 + 1}\n"
            )


def run(words: list[str], folder: str) -> None:
    """One command, its time and its memory."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    code = "import resource, sys\nfrom stiffmap.ui.cli import main\ncode = main(sys.argv[1:])\n" \
           "print(f'{resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6:.2f} GB', file=sys.stderr)\nsys.exit(code)"  # fmt: skip
    done = subprocess.run(
        [sys.executable, "-c", code, *words], cwd=folder, capture_output=True, text=True, check=False
    )
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    seconds = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    print(
        f"{' '.join(words[:2])}: {seconds:.1f} s of processor time, {done.stderr.strip()}, exit code {done.returncode}"
    )


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--rows", type=float, default=1e6)
    count = int(parser.parse_args().rows)
    with tempfile.TemporaryDirectory() as place:
        write(Path(place) / "a.csv", count)
        run(
            [
                "experiment",
                "new",
                "a.csv",
                "--machine",
                "five-bar",
                "-o",
                "e",
                "--noise",
                "dx=1",
                "--noise",
                "dy=1",
            ],
            place,
        )
        run(["residual", "five-bar", "e"], place)
