"""Built-in outlines of parts, as paths of the tool's centre about the origin; clockwise around a part, counter-clockwise in a pocket; and
where a closed outline begins: the same moves, entered elsewhere or run the other way."""

from __future__ import annotations

from collections.abc import Callable
from math import acos, cos, hypot, isfinite, isnan, nan, pi, sin
from typing import NamedTuple

import numpy as np

from stiffmap.common.broadcasting import Floats, real_array
from stiffmap.common.errors import StiffmapError
from stiffmap.machining.toolpath.gcode.codes import AXES, CENTRES, PLANES
from stiffmap.machining.toolpath.gcode.load import load_gcode
from stiffmap.machining.toolpath.gcode.words import decimal
from stiffmap.machining.toolpath.path import Kind, Toolpath


class Piece(NamedTuple):
    """A straight line to (x, y) m, or an arc to it about a centre; `way` 1 counter-clockwise, -1 clockwise, 0 straight."""

    x: float
    y: float
    cx: float = 0.0
    cy: float = 0.0
    way: int = 0


Outline = tuple[tuple[float, float], list[Piece]]


def rectangle(width: float, depth: float, corner: float) -> Outline:
    """Clockwise from the middle of the upper edge; m."""
    if not 0 <= corner <= min(width, depth) / 2:
        raise StiffmapError(f"corner: expected 0 to half the shorter edge, got {corner}")
    a, b, r = width / 2, depth / 2, corner
    out = []
    for x, y, cx, cy, ex, ey in (
        (a - r, b, a - r, b - r, a, b - r),
        (a, -b + r, a - r, -b + r, a - r, -b),
        (-a + r, -b, -a + r, -b + r, -a, -b + r),
        (-a, b - r, -a + r, b - r, -a + r, b),
    ):
        out += [Piece(x, y), *([Piece(ex, ey, cx, cy, -1)] if r > 0 else [])]
    return (0.0, b), [*out, Piece(0.0, b)]


def circle(diameter: float) -> Outline:
    """Clockwise from the top; m."""
    r = diameter / 2
    return (0.0, r), [Piece(0.0, -r, 0.0, 0.0, -1), Piece(0.0, r, 0.0, 0.0, -1)]


def washbasin(width: float, depth: float) -> Outline:
    """Straight back, rounded corners, a bow in front (the lower side): Figure 3 of the paper, size declared; m."""
    if not width / 4 <= depth <= 2 * width:
        raise StiffmapError(f"depth: expected a quarter to twice the width, got {depth} for {width}")
    a, b, r = width / 2, depth / 2, min(width, depth) / 8
    sag = min(0.45 * depth, 0.9 * a)
    bow = (a * a + sag * sag) / (2 * sag)  # radius of an arc of this height over the whole width
    return (0.0, b), [
        Piece(a - r, b), Piece(a, b - r, a - r, b - r, -1), *_front(a, b, bow, r),
        Piece(-a, b - r), Piece(-a + r, b, -a + r, b - r, -1), Piece(0.0, b),
    ]  # fmt: skip


def _front(a: float, b: float, bow: float, r: float) -> list[Piece]:
    """Front arc about (0, bow - b) with fillets of radius r where it meets the sides x = ±a."""
    cy = bow - b
    x = a - r  # centres of the fillets touch the side from within and the bow from within
    y = cy - (((bow - r) ** 2 - x * x) ** 0.5)
    size = hypot(x, y - cy)
    tx, ty = x * bow / size, cy + (y - cy) * bow / size
    return [
        Piece(a, y), Piece(tx, ty, x, y, -1), Piece(-tx, ty, 0.0, cy, -1), Piece(-a, y, -x, y, -1),
    ]  # fmt: skip


def bathtub(width: float, depth: float) -> Outline:
    """Rim: two half circles' worth of rounding at one end, a gentle taper to the other; m."""
    if not width > depth:
        raise StiffmapError(f"width: expected more than the depth of {depth}, got {width}")
    big, small = depth / 2, depth * 0.4
    left, right = -width / 2 + big, width / 2 - small
    lean = acos((big - small) / (right - left))  # of the tangent points, seen from both centres
    c, s = cos(lean), sin(lean)
    a, b = (left + big * c, big * s), (right + small * c, small * s)
    return a, [
        Piece(*b), Piece(b[0], -b[1], right, 0.0, -1), Piece(a[0], -a[1]), Piece(a[0], a[1], left, 0.0, -1),
    ]  # fmt: skip


def pocket(width: float, depth: float, corner: float) -> Outline:
    """The wall of a pocket, counter-clockwise, corners of the centre's path rounded; m."""
    start, pieces = rectangle(width, depth, corner)
    points = [start, *((p.x, p.y) for p in pieces)]
    before = zip(points, pieces, strict=False)
    return start, [Piece(*point, p.cx, p.cy, -p.way) for point, p in reversed([*before])]


SHAPES: dict[str, tuple[Callable[..., Outline], tuple[float, ...], str]] = {
    "washbasin": (washbasin, (0.34, 0.24), "width,depth"),
    "bathtub": (bathtub, (0.36, 0.18), "width,depth"),
    "rectangle": (rectangle, (0.2, 0.12, 0.02), "width,depth,corner"),
    "circle": (circle, (0.2,), "diameter"),
    "pocket": (pocket, (0.12, 0.08, 0.01), "width,depth,corner"),
}


def outline_names() -> list[str]:
    """Names that `outline` knows."""
    return sorted(SHAPES)


def outline_text(
    name: str, size: tuple[float, ...] | None = None, *, feed: float = 0.1, rpm: float = 18000.0
) -> str:
    """G-code (mm) of a built-in outline at z = 0; size in m, feed in m/s. Raises StiffmapError."""
    if name not in SHAPES:
        raise StiffmapError(f"unknown outline {name!r}; known: {', '.join(outline_names())}")
    make, usual, words = SHAPES[name]
    given = usual if size is None else tuple(np.atleast_1d(real_array(size, "size")).tolist())
    if len(given) != len(usual) or not all(isfinite(v) for v in given):
        raise StiffmapError(f"{name}: expected the size {words}, got {list(given)}")
    for word, value in zip(words.split(","), given, strict=True):
        if word != "corner" and not value > 0:
            raise StiffmapError(f"{word}: expected a length above zero, got {value}")
    (x, y), pieces = make(*given)
    out = [
        f"({name} {' x '.join(f'{1e3 * v:g}' for v in given)} mm, path of the tool's centre)", "G21 G90 G17 G94 G40 G91.1",
        f"S{rpm:g} M3", f"G0 X{_mm(x)} Y{_mm(y)} Z5", f"G1 Z0 F{60e3 * feed:g}",
    ]  # fmt: skip
    for p in pieces:
        word = {0: "G1", 1: "G3", -1: "G2"}[p.way]
        centre = f" I{_mm(p.cx - x)} J{_mm(p.cy - y)}" if p.way else ""
        out.append(f"{word} X{_mm(p.x)} Y{_mm(p.y)}{centre}")
        x, y = p.x, p.y
    return "\n".join([*out, "G0 Z5", "M5", "M2"]) + "\n"


def outline(name: str, size: tuple[float, ...] | None = None, **speeds: float) -> Toolpath:
    """A built-in outline as a path; size in m."""
    return load_gcode(outline_text(name, size, **speeds).splitlines(), name=name)


def _mm(v: float) -> str:
    return decimal(1e3 * v, 6)


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
    first, last = (int(i) for i in path.cutting()[[0, -1]])
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
