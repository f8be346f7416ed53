"""Built-in outlines of parts, as paths of the tool's centre about the origin; clockwise around a part, counter-clockwise in a pocket."""

from __future__ import annotations

from collections.abc import Callable
from math import acos, cos, hypot, isfinite, sin
from typing import NamedTuple

import numpy as np

from stiffmap.common.broadcasting import real_array
from stiffmap.common.errors import StiffmapError
from stiffmap.machining.toolpath.gcode.load import load_gcode
from stiffmap.machining.toolpath.gcode.words import decimal
from stiffmap.machining.toolpath.path import Toolpath


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
    _positive(width=width, depth=depth)
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
    _positive(diameter=diameter)
    r = diameter / 2
    return (0.0, r), [Piece(0.0, -r, 0.0, 0.0, -1), Piece(0.0, r, 0.0, 0.0, -1)]


def washbasin(width: float, depth: float) -> Outline:
    """Straight back, rounded corners, a bow in front (the lower side): Figure 3 of the paper, size declared; m."""
    _positive(width=width, depth=depth)
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
    _positive(width=width, depth=depth)
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
    back = [
        Piece(*points[k], pieces[k].cx, pieces[k].cy, -pieces[k].way) for k in range(len(pieces) - 1, -1, -1)
    ]
    return start, back


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
        raise StiffmapError(f"{name}: expected the size {words}, got {len(given)} numbers")
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


def _positive(**sizes: float) -> None:
    for name, value in sizes.items():
        if not (value > 0 and isfinite(value)):
            raise StiffmapError(f"{name}: expected a length above zero, got {value}")
