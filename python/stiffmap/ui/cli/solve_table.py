"""``stiffmap solve --at poses.csv``: a row per pose."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from rich import box
from rich.console import Console
from rich.table import Table

from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import StiffmapError
from stiffmap.common.outputs import write_rows
from stiffmap.common.plain import plain
from stiffmap.common.pose_tables import PoseTable, read_pose_table
from stiffmap.solve.machine import Machine
from stiffmap.solve.solution import Solution
from stiffmap.solve.status import Status
from stiffmap.ui.cli.inputs import MM, force_given
from stiffmap.ui.cli.output import print_json

NAMES = ("dx", "dy", "dz", "rx", "ry", "rz")
SHOWN = 20


def is_file_name(text: str) -> bool:
    """Whether a position is the name of a file: it holds letters other than those of numbers."""
    return Path(text).suffix.lower() in (".csv", ".txt", ".tsv") or Path(text).is_file()


def force_vector(text: str) -> Floats:
    """A force in N as a vector; StiffmapError for a size alone, whose worst direction would differ from pose to pose."""
    vector = force_given(text)[1]
    if vector is None:
        raise StiffmapError("--force: with a file of poses, expected a vector, such as 0,0,-100")
    return vector


def solve_table(
    m: Machine, file: Path, load: Floats, how: dict[str, Any], output: Path | None, as_json: bool
) -> bool:
    """Solve, print, write; whether every pose converged."""
    table = read_pose_table(file, at_home=_stand_in(m))
    turned = table.rotation(m.description.home.r)
    if turned is not None and how["rotation"] is not None:
        raise StiffmapError(f"--rotation: {file} has orientations of its own (rx, ry, rz)")
    wrench = table.wrench if table.loaded else np.broadcast_to(load, (len(table), 6))
    s = m.solve(table.position, wrench, **{**how, "rotation": how["rotation"] if turned is None else turned})
    words = [Status(int(v)).name for v in s.status]
    files = []
    if output is not None:
        head = [
            "x [mm]",
            "y [mm]",
            "z [mm]",
            *(f"{n} [{'mm' if n[0] == 'd' else 'rad'}]" for n in NAMES),
            "status",
        ]
        in_mm = np.hstack([table.position / MM, s.displacement * np.r_[np.full(3, 1 / MM), np.ones(3)]])
        write_rows(output, head, ([*map(repr, row.tolist()), w] for row, w in zip(in_mm, words, strict=True)))
        files = [str(output)]
    if as_json:
        rows = [
            {"position": p, "wrench": w, "status": state, "displacement": d}
            for p, w, state, d in zip(table.position, wrench, words, s.displacement, strict=True)
        ]
        print_json(plain({"machine": m.name, "point": s.point, "poses": rows, "files": files}))
    else:
        _show(table, s, words, files)
    return bool(s.ok.all())


def _stand_in(m: Machine) -> Floats | None:
    """Home, for coordinates that a machine is not commanded along; None where it is along all three."""
    return None if {"x", "y", "z"} <= set(m.description.task) else m.description.home.p


def _show(table: PoseTable, s: Solution, words: list[str], files: list[str]) -> None:
    out = Table(box=box.SIMPLE, title=f"displacement of {s.point}")
    for name in ("x", "y", "z", "dx, µm", "dy, µm", "dz, µm", "|d|, µm", ""):
        out.add_column(name, justify="right")
    sizes = np.linalg.norm(s.displacement[:, :3], axis=1)
    for i in range(min(len(table), SHOWN)):
        moved = [f"{1e6 * v:.2f}" for v in (*s.displacement[i, :3], sizes[i])]
        where = [f"{v / MM:g}" for v in table.position[i]]
        word = "" if words[i] == "CONVERGED" else words[i].lower()
        out.add_row(*where, *(["-"] * 4 if not np.isfinite(sizes[i]) else moved), word)
    console = Console(highlight=False)
    console.print(out)
    if len(table) > SHOWN:
        console.print(f"{len(table) - SHOWN} more rows (-o answers.csv writes all)")
    if np.isfinite(sizes).any():
        worst = int(np.nanargmax(sizes))
        console.print(f"largest: {1e6 * sizes[worst]:.2f} µm in row {worst + 1} (line {table.lines[worst]})")
    if files:
        console.print(f"wrote {', '.join(files)}", soft_wrap=True)
