"""Compensated commands as a program: pieces of each move, joined where the error jumps."""

from __future__ import annotations

import csv
from dataclasses import dataclass, replace
from io import StringIO

import numpy as np
from numpy.typing import NDArray

from stiffmap.common.broadcasting import Floats
from stiffmap.machining.milling.setting import Setting
from stiffmap.machining.toolpath.gcode.load import load_gcode
from stiffmap.machining.toolpath.gcode.write import rewritten
from stiffmap.machining.toolpath.path import Kind, Toolpath, path_of
from stiffmap.machining.toolpath.pieces import MovedPiece, arc_pieces, line_pieces

WITHIN = 1e-6
"""m: chord error of the pieces."""
TOUCH = 2e-7
"""m: ends of neighbouring moves that are nearer than this are one point."""


@dataclass(frozen=True, eq=False)
class Program:
    """A path with compensated positions."""

    text: str
    suffix: str
    path: Toolpath
    """The program as its own reader sees it."""
    origin: NDArray[np.int64]
    """(moves of `path`,) the move of the wanted path that each is a piece of."""
    pieces: int
    """Cutting moves that were written."""
    command: Floats
    """(m, 3) m, part's axes: what the cuts of the program go through, in this order."""
    within: float


def program(job: Setting, command: Floats, within: float = WITHIN, feeds: Floats | None = None) -> Program:
    """G-code with the structure of the original, or a table where the path came from one.

    command: (m, 3) m, base axes. within: chord error, m. feeds: (moves,) m/s of the path's moves; None: as they are.
    """
    turn = np.full(len(job), np.nan) if job.angle is None else np.unwrap(job.angle)
    path, points = job.path, job.points
    part = job.place.back(command)
    first = np.flatnonzero(np.diff(points.move, prepend=-1) != 0)
    last = np.r_[first[1:], len(points)]
    if not path.text:
        return _table(job, part, turn)
    moved: dict[int, list[MovedPiece]] = {}
    starts: dict[int, tuple[Floats, float]] = {}
    end_before: Floats | None = None
    for a, b in zip(first, last, strict=True):
        i = int(points.move[a])
        q, t = part[a:b], turn[a:b]
        if points.share[a] > 0:  # the joint with the move before stands there
            assert end_before is not None
            q, t = np.vstack([end_before, q]), turn[a - 1 : b]
        pieces = []
        joined = end_before is not None and i > 0 and path.cuts[i - 1]
        if joined and np.linalg.norm(q[0] - end_before) > TOUCH:
            pieces.append(MovedPiece(Kind.LINE, q[0], np.full(3, np.nan), 0.0, float(t[0])))
        if path.kind[i] == Kind.ARC:
            pieces += arc_pieces(q, int(path.normal[i]), float(np.sign(path.sweep[i])), within, t)
        else:
            pieces += line_pieces(q, within, t)
        moved[i], starts[i], end_before = pieces, (q[0], float(t[0])), q[-1]
    for i in starts:  # what leads to a cut ends where the cut now starts
        if i > 0 and i - 1 not in starts:
            end, angle = starts[i]
            moved[i - 1] = [MovedPiece(Kind(int(path.kind[i - 1])), end, np.full(3, np.nan), 0.0, angle)]
    if job.angle is not None:
        path = _turning(path, points.move[first], turn[first], turn[last - 1])
    text, origin = rewritten(path, moved, feeds)
    again = load_gcode(StringIO(text), name=path.name, offsets=path.offsets or None)
    return Program(text, ".ngc", again, np.array(origin), sum(map(len, moved.values())), part, within)


def _turning(path: Toolpath, cuts: NDArray[np.int64], begin: Floats, end: Floats) -> Toolpath:
    """The path with the tool's turn (rad, where each of the `cuts` begins and ends) on the moves between: a retreat keeps it, what
    follows turns to where the next cut begins."""
    now = np.append(begin, end[-1])[np.searchsorted(cuts, np.arange(len(path)))]
    now[cuts] = end
    retreats = cuts[np.diff(cuts, append=len(path)) > 2] + 1
    now[retreats] = now[retreats - 1]
    return replace(path, turn=now)


def _table(job: Setting, part: Floats, turn: Floats) -> Program:
    """Points of the compensated path with feed, spindle and tool axis."""
    points, path = job.points, job.path
    buffer = StringIO()
    out = csv.writer(buffer, lineterminator="\n")
    # what leads from one cut to the next stands in it as well: a table without it would go straight across the part
    idle = np.flatnonzero(~path.cuts)
    lead = np.searchsorted(points.move, idle + 1)
    leads = np.isin(idle + 1, points.move)
    ends = np.where(leads[:, None], part[np.minimum(lead, len(part) - 1)], path.end[idle])
    head = idle[:1][idle[:1] == 0]  # where the path begins, if not in a cut
    move = np.r_[head, idle, points.move]
    order = np.argsort(move, kind="stable")

    def column(of_moves: Floats, of_points: Floats) -> Floats:
        return np.concatenate([of_moves[head], of_moves[idle], of_points])[order]

    way = np.concatenate([path.start[head], ends, part])[order]
    move = move[order]
    feed = column(np.where(np.isfinite(path.feed), path.feed, job.process.feed), job.feed)
    spindle = column(path.spindle, points.spindle)
    spindle = np.where(np.isfinite(spindle), spindle, job.process.spindle)
    tool = column(path.tool, points.tool)
    names = ["x_mm", "y_mm", "z_mm", "feed_mm_min", "spindle_rpm", "i", "j", "k"]
    columns, turned = [1e3 * way, 6e4 * feed, spindle * 30 / np.pi, tool], None
    if job.angle is not None:
        turned = column(np.full(len(path), turn[0]) if path.turn is None else path.turn, turn)
        names, columns = [*names, "turn_deg"], [*columns, np.degrees(turned)]
    out.writerow(names)
    for row in np.column_stack(columns):
        out.writerow([f"{v:.9g}" if k > 2 else f"{v:.6f}" for k, v in enumerate(row)])
    again = path_of(np.round(way, 9), feed=feed, spindle=spindle, tool=tool, name=path.name, turn=turned)
    return Program(buffer.getvalue(), ".csv", again, move[1:], len(points) - 1, part, WITHIN)
