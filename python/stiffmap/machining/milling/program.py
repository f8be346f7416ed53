"""Compensated commands as a program, pieces of each move joined where the error jumps; and a program run on a machine: where the tool
then is, against the path that was wanted."""

from __future__ import annotations

from dataclasses import dataclass, replace
from io import StringIO

import numpy as np
from numpy.typing import NDArray

from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import StiffmapError
from stiffmap.machining.milling.equilibrium import Equilibrium, Plant, equilibrium
from stiffmap.machining.milling.setting import Setting, setting
from stiffmap.machining.toolpath import Engagement, Points, sampled
from stiffmap.machining.toolpath.gcode.load import load_gcode
from stiffmap.machining.toolpath.gcode.write import rewritten
from stiffmap.machining.toolpath.path import Kind, Toolpath, path_of
from stiffmap.machining.toolpath.pieces import MovedPiece, arc_pieces, line_pieces
from stiffmap.solve.machine import Machine

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
    table = np.column_stack(columns)
    rows = ([f"{v:.9g}" if k > 2 else f"{v:.6f}" for k, v in enumerate(row)] for row in table)
    text = "".join(f"{','.join(row)}\n" for row in (names, *rows))
    again = path_of(np.round(way, 9), feed=feed, spindle=spindle, tool=tool, name=path.name, turn=turned)
    return Program(text, ".csv", again, move[1:], len(points) - 1, part, WITHIN)


ROUNDS = 3
TOLERANCE = 1e-7
"""m: numbers are written to 1e-9 m, inches to 3e-9 m."""


@dataclass(frozen=True, eq=False)
class Run:
    """k points of a program, base axes."""

    job: Setting
    """Points of the wanted path that belong to those of the program."""
    state: Equilibrium
    normal: Floats
    """(k,) m: error across the wall, positive where material stays."""


def run(
    job: Setting,
    made: Program,
    machine: Machine | None = None,
    *,
    step: float = 2e-3,
) -> Run:
    """Simulate a program on the job's machine or on another one, the force re-evaluated at the true distance from the wall."""
    must_cut_whole(job, made)
    p = made.path
    own, first = sampled(p, step), np.searchsorted(job.points.move, made.origin).clip(max=len(job) - 1)
    joint = (p.kind == Kind.LINE) & (job.points.share[first] == 0)  # its two ends are those of its neighbours
    joint &= np.linalg.norm(p.end - made.command[first], axis=1) < TOLERANCE
    own = own.only((job.path.cuts[made.origin] & ~joint)[own.move])
    wanted, u = made.origin[own.move], job.place.points(own.position)
    at = job.place.back(u)
    start = np.r_[0.0, np.cumsum(np.where(job.path.cuts, job.path.length, 0.0))][:-1]
    for _ in range(ROUNDS):
        share = nearest(job.path, wanted, at)
        position, tangent, bend = job.path.at(wanted, share)
        way = start[wanted] + share * job.path.length[wanted]
        points = Points(
            wanted, share, position, tangent, job.path.tool[wanted], bend, way, own.feed, own.spindle
        )
        here = _job(job, points, p.turn_at(own.move, own.share))
        state = equilibrium(Plant(here, machine), u)
        at = job.place.back(here.position + np.nan_to_num(state.error))
    return Run(here, state, here.across(state.error))


def must_cut_whole(job: Setting, made: Program) -> None:
    """The text, read by a controller that starts anywhere, cuts what is commanded, whole and in order, and nothing else; what
    goes with a cut (feed, spindle, coolant, dwell, stop) goes with its pieces. Raises StiffmapError.
    """
    path = job.path
    if not path.text:
        return
    first = path.line[int(np.argmax(path.cuts))]
    start = [np.nan if line <= first else 0.0 for line in path.given]
    p = load_gcode(StringIO(made.text), name=path.name, offsets=path.offsets or None, start=start)
    n, of = len(path), made.origin
    if not np.array_equal(np.unique(of), np.arange(n)) or (np.diff(of) < 0).any() or len(p) != len(of):
        raise _wrong(path, f"has {len(p)} moves, {len(of)} were expected", min(len(p), len(of)) - 1, of)
    cuts = path.cuts[of]
    slack = TOLERANCE + float(np.linalg.norm(made.command - job.points.position, axis=1).max())
    far = np.linalg.norm(np.nan_to_num(p.end - path.end[of]), axis=1) > slack
    same_feed = np.isclose(p.feed, path.feed[of], rtol=1e-3, atol=1e-7, equal_nan=True) | ~(
        p.length > TOLERANCE
    )
    for what, wrong in (
        (
            "is rapid where a cut is wanted, or the other way round",
            (p.kind == Kind.RAPID) != (path.kind[of] == Kind.RAPID),
        ),
        ("has another feed", ~same_feed),
        ("has another speed of the spindle", ~np.isclose(p.spindle, path.spindle[of], equal_nan=True)),
        ("starts where nobody knows", cuts & ~np.isfinite(p.start).all(axis=1)),
        ("goes elsewhere", ~cuts & far),
        ("cuts elsewhere", _elsewhere(job, made, p)),
    ):
        if wrong.any():
            raise _wrong(path, what, int(np.argmax(wrong)), of)
    after = np.r_[of, n]
    whole = np.r_[True, np.diff(after) > 0]
    if [(w, int(after[k])) for w, k in p.actions if whole[k]] != list(path.actions):
        raise _wrong(path, "does not keep dwells, spindle, coolant or stops where they were", len(of) - 1, of)


def _wrong(path: Toolpath, what: str, k: int, of: NDArray[np.int64]) -> StiffmapError:
    return StiffmapError(
        f"{path.name}, line {path.line[of[k]]}: the compensated program {what} there; it is not to be run"
    )


def _elsewhere(job: Setting, made: Program, p: Toolpath) -> NDArray[np.bool_]:
    """(pieces,) cuts that do not follow the commanded points: each ends at one, passes the others in between in order, and is no longer than their way."""
    of, q, move = made.origin, made.command, job.points.move
    near = made.within + TOLERANCE
    wrong = np.zeros(len(p), bool)
    piece = np.full(len(q), -1)
    last = np.searchsorted(move, np.arange(len(job.path)), side="right") - 1
    at, way = 0, np.zeros(len(p))
    for k in np.flatnonzero(job.path.cuts[of]):
        if k == 0 or of[k] != of[k - 1]:
            at = int(np.searchsorted(move, of[k]))
        begin = at
        while at <= last[of[k]] and np.abs(q[at] - p.end[k]).max() > TOLERANCE:
            at += 1
        wrong[k] = at > last[of[k]] or ((k + 1 == len(of) or of[k + 1] != of[k]) and at != last[of[k]])
        piece[begin : at + 1] = k
        way[k] = np.linalg.norm(np.diff(np.vstack([p.start[k], q[begin : at + 1]]), axis=0), axis=1).sum()
        at += at < last[of[k]]
    here = np.flatnonzero(piece >= 0)
    mine = piece[here]
    share = nearest(p, mine, q[here])
    off = np.linalg.norm(p.at(mine, share)[0] - q[here], axis=1) > near
    back = np.r_[False, (np.diff(share) < -1e-6) & (np.diff(mine) == 0)]
    wrong[mine[off | back]] = True
    wrong |= (of >= 0) & job.path.cuts[of] & ~(np.nan_to_num(p.length) <= 1.6 * way + near)
    return wrong


def _job(job: Setting, points: Points, angle: Floats | None) -> Setting:
    """The job at other points, the tool turned by `angle`; width and depth as at the nearest of its own."""
    order = np.argsort(job.points.way, kind="stable")
    way = job.points.way[order]
    made = setting(job.machine, job.path, job.process, points, job.place, angle=angle, threads=job.threads)
    k = np.clip(np.searchsorted(way, points.way), 1, len(way) - 1)
    k -= np.abs(points.way - way[k - 1]) < np.abs(points.way - way[k])
    old = order[k]
    same = job.points.move[old] == points.move
    other = np.clip(k + 1, 0, len(way) - 1)
    old = np.where(same, old, np.where(job.points.move[order[other]] == points.move, order[other], old))
    e = job.engaged
    bent = np.interp(points.way, way, e.curvature[order])
    engaged = Engagement(e.radial[old], bent, e.corner[old], e.axial[old], e.wall[old])
    return replace(made, engaged=engaged, scale=job.scale)


def nearest(path: Toolpath, move: NDArray[np.int64], p: Floats) -> Floats:
    """(k,) shares of the moves (k,) whose points are nearest to positions (k, 3), m, in the axes of the part."""
    a, b = path.start[move], path.end[move]
    way = b - a
    size = (way**2).sum(axis=1)
    share = np.divide(((p - a) * way).sum(axis=1), size, out=np.zeros(len(p)), where=size > 0)
    arcs = np.flatnonzero(path.kind[move] == Kind.ARC)
    if arcs.size:
        i = move[arcs]
        axis = np.eye(3)[path.normal[i]]
        spoke = (a[arcs] - path.centre[i]) * (1 - axis)
        seen = (p[arcs] - path.centre[i]) * (1 - axis)
        angle = np.arctan2((np.cross(spoke, seen) * axis).sum(axis=1), (spoke * seen).sum(axis=1))
        sweep = path.sweep[i]
        turns = np.round((sweep / 2 - angle) / (2 * np.pi))  # the turn that lies about the middle of the arc
        share[arcs] = (angle + 2 * np.pi * turns) / sweep
    return np.asarray(np.clip(share, 0.0, 1.0))
