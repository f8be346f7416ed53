"""Where a closed outline begins: the same moves, entered elsewhere."""

from __future__ import annotations

from math import isnan, nan, pi

import numpy as np

from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import StiffmapError
from stiffmap.machining.toolpath.gcode.codes import AXES, CENTRES, PLANES
from stiffmap.machining.toolpath.gcode.load import load_gcode
from stiffmap.machining.toolpath.gcode.words import decimal
from stiffmap.machining.toolpath.path import Kind, Toolpath

CLOSED = 1e-6
"""m between the start and the end of an outline that counts as closed."""
NEAR = 1e-7
"""m from the end of a move, at which no move is divided."""


def outline_of(path: Toolpath) -> tuple[int, int]:
    """First and last move of the one closed outline that a path cuts. Raises StiffmapError where there is none, or more than one."""
    cuts = np.flatnonzero(path.cuts)
    if cuts.size:
        first, last = int(cuts[0]), int(cuts[-1])
        whole = last - first + 1 == cuts.size
        touch = np.linalg.norm(path.end[first:last] - path.start[first + 1 : last + 1], axis=1) < CLOSED
        if whole and touch.all() and np.linalg.norm(path.end[last] - path.start[first]) < CLOSED:
            return first, last
    raise StiffmapError(
        f"{path.name}: an entry can be chosen where the cuts are one closed outline; here they are open or several"
    )


def entered_at(path: Toolpath, way: float) -> Toolpath:
    """The same closed outline begun after `way` (m) of its cuts; approach and retreat go there. The feed is that of the move.

    A path read from G-code gets lines of its own; comments and modes of the old ones are not kept.
    """
    first, last = outline_of(path)
    length = path.length[first : last + 1]
    if not 0 <= way <= length.sum():
        raise StiffmapError(
            f"entry: expected 0 to {1e3 * length.sum():.6g} mm along the outline, got {1e3 * way:.6g} mm"
        )
    ends = np.cumsum(length)
    k = int(np.searchsorted(ends, way + NEAR))
    k, rest = (0, 0.0) if k == len(ends) else (k, way - (ends[k] - length[k]))
    whole = rest < NEAR
    if k == 0 and whole:
        return path
    loop = [*range(first + k, last + 1), *range(first, first + k)]
    here = first + k
    order = [*range(first), *loop, *([] if whole else [here]), *range(last + 1, len(path))]
    made = path.only(order)
    start, end, sweep = made.start, made.end, made.sweep
    place = path.start[here]
    if not whole:
        share = rest / length[k]
        place = path.at([here], [share])[0][0]
        start[first], end[last + 1] = place, place
        sweep[first], sweep[last + 1] = (1 - share) * path.sweep[here], share * path.sweep[here]
    shift = place - path.start[first]
    pre, post = slice(0, first), slice(last + (1 if whole else 2), len(order))
    for part, old in ((pre, path.start[first]), (post, path.end[last])):
        start[part] = _moved(start[part], old, shift)
        end[part] = _moved(end[part], old, shift)
    return with_lines(made, path)


def turned_round(path: Toolpath) -> Toolpath:
    """The same cuts run the other way, so that what was a climb cut is a conventional one; approach and retreat change places.

    A path read from G-code gets lines of its own; comments and modes of the old ones are not kept.
    """
    cuts = np.flatnonzero(path.cuts)
    if not cuts.size:
        raise StiffmapError(f"{path.name}: no move cuts (moves at a feed across the tool)")
    first, last = int(cuts[0]), int(cuts[-1])
    order = [*range(first), *range(last, first - 1, -1), *range(last + 1, len(path))]
    made = path.only(order)
    start, end, sweep, centre = made.start, made.end, made.sweep, made.centre
    middle, pre, post = slice(first, last + 1), slice(0, first), slice(last + 1, len(path))
    start[middle], end[middle] = end[middle].copy(), start[middle].copy()
    sweep[middle] *= -1
    arcs = np.flatnonzero(made.kind == Kind.ARC)
    axis = np.eye(3)[made.normal[arcs]]
    centre[arcs] = centre[arcs] * (1 - axis) + start[arcs] * axis
    shift = path.end[last] - path.start[first]
    for part, old, way in ((pre, path.start[first], shift), (post, path.end[last], -shift)):
        start[part], end[part] = _moved(start[part], old, way), _moved(end[part], old, way)
    return with_lines(made, path)


def _moved(points: Floats, old: Floats, shift: Floats) -> Floats:
    """Points over or at the old entry, over or at the new one."""
    over = np.abs(points[:, :2] - old[:2]).max(axis=1, initial=0.0) < CLOSED
    return np.asarray(np.where(np.reshape(over, (-1, 1)), points + shift, points))


COOLANT = ("M7", "M8", "M9")


def fresh_text(path: Toolpath) -> str:
    """Lines in mm, absolute, one per move, with the coolant of the first cut; the controller adds the first of the work offsets again, if there are any."""
    offset, shift = next(iter(path.offsets.items()), ("", (0.0, 0.0, 0.0)))
    out = [f"({path.name})", f"G21 G90 G94 G40 G17 G91.1 {offset}".strip()]
    cooled: list[str] = []
    for word, before in path.actions:
        if before <= int(np.argmax(path.cuts)) and word in COOLANT:
            cooled = [] if word == "M9" else [*cooled, word]
    out += dict.fromkeys(cooled)
    at, plane, feed, spindle, turn = np.full(3, nan), 2, nan, nan, nan
    for i in range(len(path)):
        words = []
        if path.spindle[i] != spindle and not isnan(path.spindle[i]):
            spindle = float(path.spindle[i])
            sense = "M5" if spindle == 0 else "M3" if spindle > 0 else "M4"
            out.append(sense if spindle == 0 else f"S{decimal(abs(spindle) * 30 / pi, 7)} {sense}")
        kind, end = Kind(int(path.kind[i])), path.end[i]
        if kind == Kind.ARC and path.normal[i] != plane:
            plane = int(path.normal[i])
            words.append(next(f"G{code:g}" for code, normal in PLANES.items() if normal == plane))
        words.append({Kind.RAPID: "G0", Kind.LINE: "G1"}.get(kind, "G3" if path.sweep[i] > 0 else "G2"))
        # nothing sends an axis anywhere before the path does; a move at feed says all that is not known
        free = (kind == Kind.RAPID) & (path.line[i] < np.array(path.given)) & (end == path.start[i])
        changed = ~free & ((end != at) | ((kind == Kind.ARC) & (np.arange(3) != plane)))
        axes = np.flatnonzero(changed if changed.any() else ~free)
        words += [f"{AXES[a]}{decimal(1e3 * (end[a] - shift[a]), 7)}" for a in axes]
        if kind == Kind.ARC:
            for word in CENTRES[plane]:
                a = "IJK".index(word)
                words.append(f"{word}{decimal(1e3 * (path.centre[i, a] - path.start[i, a]), 7)}")
            turns = int(np.ceil(abs(path.sweep[i]) / (2 * pi) - 1e-6))
            words += [f"P{turns}"] if turns > 1 else []
        if path.turn is not None and path.turn[i] != turn:
            turn = float(path.turn[i])
            words.append(f"C{decimal(np.degrees(turn), 7)}")
        if kind != Kind.RAPID and path.feed[i] != feed:
            feed = float(path.feed[i])
            words.append(f"F{decimal(6e4 * feed, 7)}")
        out.append(" ".join(words))
        at = np.where(free, at, end)
    return "\n".join([*out, *(["M9"] if cooled else []), "M5", "M2"]) + "\n"


def with_lines(path: Toolpath, like: Toolpath) -> Toolpath:
    """A path changed from another one that was read from G-code, with lines of its own; others stay as they are."""
    if not like.text:
        return path
    return load_gcode(fresh_text(path).splitlines(), name=path.name, offsets=like.offsets or None)
