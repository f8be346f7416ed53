"""G-code of a path that has no lines of its own, as of one that was turned round or starts elsewhere."""

from __future__ import annotations

from math import isnan, nan, pi

import numpy as np

from stiffmap.machining.toolpath.gcode.load import load_gcode
from stiffmap.machining.toolpath.gcode.state import CENTRES
from stiffmap.machining.toolpath.path import Kind, Toolpath

COOLANT = ("M7", "M8", "M9")
PLANES = {2: "G17", 1: "G18", 0: "G19"}


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
            out.append(sense if spindle == 0 else f"S{_text(abs(spindle) * 30 / pi)} {sense}")
        kind, end = Kind(int(path.kind[i])), path.end[i]
        if kind == Kind.ARC and path.normal[i] != plane:
            plane = int(path.normal[i])
            words.append(PLANES[plane])
        words.append({Kind.RAPID: "G0", Kind.LINE: "G1"}.get(kind, "G3" if path.sweep[i] > 0 else "G2"))
        # nothing sends an axis anywhere before the path does; a move at feed says all that is not known
        free = [
            a
            for a in range(3)
            if kind == Kind.RAPID and path.line[i] < path.given[a] and end[a] == path.start[i, a]
        ]
        axes = [
            a for a in range(3) if a not in free and (end[a] != at[a] or (kind == Kind.ARC and a != plane))
        ]
        axes = axes or [a for a in range(3) if a not in free]
        words += [f"{'XYZ'[a]}{_text(1e3 * (end[a] - shift[a]))}" for a in axes]
        if kind == Kind.ARC:
            for word in CENTRES[plane]:
                a = "IJK".index(word)
                words.append(f"{word}{_text(1e3 * (path.centre[i, a] - path.start[i, a]))}")
            turns = int(np.ceil(abs(path.sweep[i]) / (2 * pi) - 1e-9))
            words += [f"P{turns}"] if turns > 1 else []
        if path.turn is not None and path.turn[i] != turn:
            turn = float(path.turn[i])
            words.append(f"C{_text(np.degrees(turn))}")
        if kind != Kind.RAPID and path.feed[i] != feed:
            feed = float(path.feed[i])
            words.append(f"F{_text(6e4 * feed)}")
        out.append(" ".join(words))
        at = np.where([a in free for a in range(3)], at, end)
    return "\n".join([*out, *(["M9"] if cooled else []), "M5", "M2"]) + "\n"


def with_lines(path: Toolpath, like: Toolpath) -> Toolpath:
    """A path changed from another one that was read from G-code, with lines of its own; others stay as they are."""
    if not like.text:
        return path
    return load_gcode(fresh_text(path).splitlines(), name=path.name, offsets=like.offsets or None)


def _text(value: float) -> str:
    text = f"{value:.7f}".rstrip("0").rstrip(".")
    return "0" if text in ("-0", "") else text
