"""A program with its positions changed: the same lines, words and comments; moves that became several follow as lines of their own."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import nan

import numpy as np
from numpy.typing import NDArray

from stiffmap.common.broadcasting import Floats
from stiffmap.machining.toolpath.gcode.codes import AXES, CENTRES, INCH, STARTS, TRACKING, ModalState
from stiffmap.machining.toolpath.gcode.read import ProgramReader, read_moves
from stiffmap.machining.toolpath.gcode.words import bare, decimal, names_program, plain, tokens_of
from stiffmap.machining.toolpath.path import Kind, Toolpath
from stiffmap.machining.toolpath.pieces import MovedPiece

STOPS = ("M0", "M1", "M2", "M30", "M60")
MOTIONS = ("G0", "G1", "G2", "G3")
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
    reader = ProgramReader(path.name, path.offsets)
    speed = path.feed if feeds is None else feeds
    starts = _starts(path)
    turned, driven = nan, (nan, 0.0)
    by_line = {int(line): i for i, line in enumerate(path.line)}
    out: list[str] = []
    origin: list[int] = []
    written: Floats = np.zeros(3)
    held, breaks = np.zeros(3, bool), 0  # axes of which the controller provably holds `written`
    for number, text in enumerate(path.text, 1):
        if reader.state.ended:
            out.append(text)
            continue
        if starts and not names_program(bare(text)):
            out.append(starts)
            starts = ""
        tokens = list(tokens_of(text))
        plainly = [plain(t) for t in tokens]
        units = [w for w in plainly if w in ("G20", "G21")]
        rated = "F" in bare(text)
        if units and rated:  # ahead of F, which LinuxCNC takes in the unit that stood before its line
            out.append("/" * (tokens[0] == "/") + units[0])
        move = reader.block(text, number)
        state = reader.state
        if state.breaks != breaks:
            held, breaks, driven = np.zeros(3, bool), state.breaks, (nan, 0.0)
            turned = nan if state.absolute else turned
        i = by_line.get(number)
        if (move is None and rated) or "G94" in plainly:
            driven = (nan, 0.0)
        if move is None or i is None:
            out.append(text)
            continue
        new = pieces.get(i)
        if new is None:
            new = [_as_it_was(path, i, written)]
        machine = "G53" in plainly
        shift = np.zeros(3) if machine else np.array(reader.offsets.get(state.offset, (0.0, 0.0, 0.0)))
        asked = np.array([i in pieces or any(t[0] == a for t in tokens) for a in AXES])
        lines, start = [], written
        for piece in new:
            needed = asked & ~held & state.absolute
            words, written, named = _words(state, path, i, piece, written, shift, machine, needed)
            # without its offset a position in the axes of the machine says nothing in those of the part
            held = (held | (named & state.absolute)) & ~(named & (machine and not reader.offsets))
            if np.isfinite(piece.turn) and not abs(piece.turn - turned) <= SAME_TURN:
                before = 0.0 if state.absolute or np.isnan(turned) else turned
                angle = round(float(np.degrees(piece.turn - before)), 5)
                words += f" C{decimal(angle, 5)}"
                turned = before + float(np.radians(angle))
            feed = ""
            if path.kind[i] != Kind.RAPID:
                now = (float(speed[i]), state.unit)
                if state.inverse_time:
                    driven = (nan, 0.0)
                    size = _size(piece, start)
                    rate = 60 * speed[i] / size if speed[i] > 0 and size > 0 else state.feed or 1.0
                    feed = f" F{decimal(rate, 6)}"
                elif feeds is not None and now != driven:
                    feed, driven = f" F{decimal(60 * speed[i] / state.unit, 3)}", now
            lines.append(words + feed)
            origin.append(i)
            start = piece.end
        out += _lines(tokens, lines, state.inverse_time or feeds is not None)
    return "\n".join(out) + "\n", origin


def _starts(path: Toolpath) -> str:
    """What is taken without being said before the first move and matters: a controller may hold something else."""
    reader = ProgramReader(path.name, path.offsets)
    next(read_moves(path.text, reader), None)
    silent = [w for group, w in STARTS.items() if group not in reader.state.said]
    if not (path.kind == Kind.ARC).any():
        silent = [w for w in silent if w not in ("G17", "G91.1")]
    return " ".join(w for w in silent if w != "G54" or path.offsets)


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
    state: ModalState,
    path: Toolpath,
    i: int,
    piece: MovedPiece,
    written: Floats,
    shift: Floats,
    machine: bool,
    needed: NDArray[np.bool_],
) -> tuple[str, Floats, NDArray[np.bool_]]:
    """Words of a piece in the program's own unit and modes, where it ends as written (m), and (3,) axes with a word; those `needed` have one."""
    inch = state.unit == INCH
    digits = DIGITS[inch]
    rapid = path.kind[i] == Kind.RAPID
    plane = int(path.normal[i])
    code = "G0" if rapid else "G1" if piece.kind != Kind.ARC else "G3" if piece.sweep > 0 else "G2"
    base = shift if state.absolute or machine else written
    values = np.round((piece.end - base) / state.unit, digits)
    now = values * state.unit + base
    words = ["G53", code] if machine else [code]
    changed = needed | (np.abs(now - written) > 0.5 * 10.0**-digits * state.unit)
    if piece.kind == Kind.ARC:
        changed[[a for a in range(3) if a != plane]] = True
    if not changed.any():
        changed[:] = True
    words += [f"{AXES[a]}{decimal(values[a], digits)}" for a in range(3) if changed[a]]
    now = np.where(changed, now, written)
    if piece.kind == Kind.ARC:
        origin = shift if state.absolute_centres else written
        for word in CENTRES[plane]:
            a = "IJK".index(word)
            words.append(f"{word}{decimal((piece.centre[a] - origin[a]) / state.unit, digits)}")
    return " ".join(words), now, changed


def _lines(tokens: list[str], pieces: list[str], feed: bool) -> list[str]:
    """A line with its motion exchanged by pieces; the other words and comments stay in front of or in the first, for there they
    act before the motion, but what stops or ends the program comes after the last. A slash goes before each."""
    own: list[str] = []
    stops: list[str] = []
    tracking = any("P" in TRACKING.get(plain(t), "") for t in tokens)
    placed = -1
    for token in tokens:
        word = plain(token)
        if word in STOPS:
            stops.append(token)
        elif word in MOTIONS or word[0] in "XYZCIJKR" or (word[0] == "F" and feed):
            placed = len(own) if placed < 0 else placed
        elif word not in ("G53", "/") and not (word[0] == "P" and not tracking):
            own.append(token)
    out = [" ".join([*own[:placed], pieces[0], *own[placed:]]), *pieces[1:]]
    if stops and len(out) > 1:
        out[-1] = " ".join([out[-1], *stops])
    elif stops:
        comment = next((k for k, t in enumerate(own) if k >= placed and t[0] in "(;"), len(own))
        out = [" ".join([*own[:placed], pieces[0], *own[placed:comment], *stops, *own[comment:]])]
    return ["/" + line for line in out] if "/" in tokens else out
