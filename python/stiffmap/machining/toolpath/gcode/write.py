"""A program with its positions changed: the same lines, words and comments; moves that became several follow as lines of their own."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from math import nan

import numpy as np

from stiffmap.common.broadcasting import Floats
from stiffmap.machining.toolpath.gcode.read import Reader
from stiffmap.machining.toolpath.gcode.state import CENTRES, INCH, State
from stiffmap.machining.toolpath.path import Kind, Toolpath
from stiffmap.machining.toolpath.pieces import MovedPiece

_PARTS = re.compile(r"(\([^()]*\)|;.*)")
_MOTION = re.compile(r"G\s*0*[0123](?![\d.])|[XYZCIJKR]\s*[+-]?[\d.][\d.\s]*", re.IGNORECASE)
_TURNS = re.compile(r"P\s*[\d.]+", re.IGNORECASE)
_FEED = re.compile(r"F\s*[\d.][\d.\s]*", re.IGNORECASE)
SAME_TURN = 1e-7
"""rad."""
DIGITS = {True: 7, False: 6}
"""Decimals of inches and of millimetres."""


def rewritten(
    path: Toolpath,
    pieces: Mapping[int, Sequence[MovedPiece]],
    feeds: Floats | None = None,
) -> tuple[str, list[int]]:
    """Text of the program, and for each of its moves the move of `path` that it is a piece of.

    pieces: what each move (by number) becomes, m in the axes of the part; moves without pieces stay as they are
    but for the place where they start. feeds: (n,) m/s of the moves; None: as they are.
    """
    reader = Reader(path.name, path.offsets)
    speed = path.feed if feeds is None else feeds
    turned, driven = nan, (nan, 0.0)
    by_line = {int(line): i for i, line in enumerate(path.line)}
    out: list[str] = []
    origin: list[int] = []
    written: Floats = np.zeros(3)
    for number, text in enumerate(path.text, 1):
        if reader.state.ended:
            out.append(text)
            continue
        move = reader.block(text, number)
        i = by_line.get(number)
        if move is None and "F" in _PARTS.sub("", text).upper():
            driven = (nan, 0.0)
        if move is None or i is None:
            out.append(text)
            continue
        new = pieces.get(i)
        if new is None:
            new = [_as_it_was(path, i, written)]
        machine = bool(re.search(r"G\s*53(?![\d.])", _PARTS.sub("", text), re.IGNORECASE))
        shift = np.zeros(3) if machine else np.array(reader.offsets.get(reader.state.offset, (0.0, 0.0, 0.0)))
        for k, (piece, start) in enumerate(_with_starts(new, written)):
            words, written = _words(reader.state, path, i, piece, written, shift, machine)
            if np.isfinite(piece.turn) and not abs(piece.turn - turned) <= SAME_TURN:
                before = 0.0 if reader.state.absolute or np.isnan(turned) else turned
                angle = round(float(np.degrees(piece.turn - before)), 5)
                words += f" C{_number(angle, 5)}"
                turned = before + float(np.radians(angle))
            feed = ""
            if path.kind[i] != Kind.RAPID and path.length[i] > 0:
                now = (float(speed[i]), reader.state.unit)
                if reader.state.inverse_time:
                    driven = (nan, 0.0)
                    feed = f" F{_number(60 * speed[i] / max(_size(piece, start), 1e-12), 6)}"
                elif feeds is not None and now != driven:
                    feed, driven = f" F{_number(60 * speed[i] / reader.state.unit, 3)}", now
            out.append(_line(text, words + feed, bool(feed) or feeds is not None) if k == 0 else words + feed)
            origin.append(i)
    return "\n".join(out) + "\n", origin


def _with_starts(pieces: Sequence[MovedPiece], start: Floats) -> Iterator[tuple[MovedPiece, Floats]]:
    for piece in pieces:
        yield piece, start
        start = piece.end


def _size(piece: MovedPiece, start: Floats) -> float:
    """m along the piece."""
    if piece.kind != Kind.ARC:
        return float(np.linalg.norm(piece.end - start))
    return float(np.linalg.norm(start - piece.centre) * abs(piece.sweep))


def _as_it_was(path: Toolpath, i: int, written: Floats) -> MovedPiece:
    """The move itself; a line goes only along the axes along which it went."""
    end = path.end[i]
    if path.kind[i] != Kind.ARC:
        end = np.where(end == path.start[i], written, end)
    turn = nan if path.turn is None else float(path.turn[i])
    return MovedPiece(Kind(int(path.kind[i])), end, path.centre[i], float(path.sweep[i]), turn)


def _words(
    state: State, path: Toolpath, i: int, piece: MovedPiece, written: Floats, shift: Floats, machine: bool
) -> tuple[str, Floats]:
    """Words of a piece in the program's own unit and modes, and where it ends as written (m)."""
    inch = state.unit == INCH
    digits = DIGITS[inch]
    rapid = path.kind[i] == Kind.RAPID
    plane = int(path.normal[i])
    code = "G0" if rapid else "G1" if piece.kind != Kind.ARC else "G3" if piece.sweep > 0 else "G2"
    base = shift if state.absolute or machine else written
    values = np.round((piece.end - base) / state.unit, digits)
    now = values * state.unit + base
    words = [code]
    changed = np.abs(now - written) > 0.5 * 10.0**-digits * state.unit
    if piece.kind == Kind.ARC:
        flat = [a for a in range(3) if a != plane]
        changed[flat] = True
    if not changed.any():
        changed[:] = True
    words += [f"{'XYZ'[a]}{_number(values[a], digits)}" for a in range(3) if changed[a]]
    now = np.where(changed, now, written)
    if piece.kind == Kind.ARC:
        origin = shift if state.absolute_centres else written
        for word in CENTRES[plane]:
            a = "IJK".index(word)
            words.append(f"{word}{_number((piece.centre[a] - origin[a]) / state.unit, digits)}")
    return " ".join(words), now


def _line(text: str, words: str, feed: bool) -> str:
    """The line with its motion exchanged, other words and comments where they were."""
    parts, placed = [], False
    for part in _PARTS.split(text):
        if part.startswith(("(", ";")):
            parts.append(part)
            continue
        bare = _MOTION.sub("\0", _FEED.sub("", part) if feed else part)
        if "\0" in bare:
            bare = _TURNS.sub("", bare)
            head, _, tail = bare.partition("\0")
            bare = f"{head}{'' if placed else words}{tail.replace(chr(0), '')}"
            placed = True
        parts.append(re.sub(r"  +", " ", bare))
    line = " ".join(p.strip() for p in parts if p.strip())
    return line if placed else f"{line} {words}".strip()


def _number(value: float, digits: int) -> str:
    text = f"{value:.{digits}f}".rstrip("0").rstrip(".")
    return "0" if text in ("-0", "") else text
