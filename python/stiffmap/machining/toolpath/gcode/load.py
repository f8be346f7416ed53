"""A G-code file as a toolpath."""

from __future__ import annotations

from array import array
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import FileError
from stiffmap.common.texts import lines_of
from stiffmap.machining.toolpath.gcode.codes import NEVER, ModalState
from stiffmap.machining.toolpath.gcode.read import ProgramReader, read_moves
from stiffmap.machining.toolpath.path import Kind, Toolpath

NUMBERS = 10
KINDS = {"G0": Kind.RAPID, "G1": Kind.LINE, "G2": Kind.ARC, "G3": Kind.ARC}


def load_gcode(
    source: Path | Iterable[str],
    *,
    name: str = "",
    offsets: Mapping[str, Sequence[float]] | None = None,
    progress: Callable[[int], None] | None = None,
    keep_text: bool = True,
    start: Sequence[float] | None = None,
) -> Toolpath:
    """Moves of a program.

    offsets: work offsets by name (``G54``), m; None: all zero. progress: called with the number of lines read.
    keep_text: False where the program will not be written again, so that memory holds numbers only.
    start: where a controller stands of whose modes nothing is known (3,), m, NaN: not known either; None: at 0, as usual.
    Raises FileError naming file and line.
    """
    file = str(source) if isinstance(source, Path) else name or "program"
    reader = ProgramReader(file, offsets)
    if start is not None:
        reader.state = ModalState.unknown(start)
    text: list[str] = []
    lines: Iterable[str] = lines_of(source, "\n") if isinstance(source, Path) else source
    if keep_text:
        lines = _kept(lines, text)
    numbers, codes = array("d"), array("l")
    for m in read_moves(lines, reader, progress):
        if not codes:
            first = m.start
        numbers.extend((*m.end, *m.centre, m.sweep, m.feed, m.spindle, m.turn))
        codes.extend((KINDS[m.motion], m.plane, m.line))
    n = len(codes) // 3
    if n == 0:
        raise FileError("the program has no moves", file=file)
    v, c = np.frombuffer(numbers).reshape(n, NUMBERS), np.frombuffer(codes, dtype="l").reshape(n, 3)
    state = reader.state
    missing = [a for a, line in zip("XYZ", state.given, strict=True) if line == NEVER]
    notes = [f"line {line}: {note}" for note, line in reader.notes.items()]
    if missing:
        notes.append(f"{', '.join(missing)} is never given: taken as 0")
    return Toolpath(
        kind=c[:, 0].astype(np.uint8),
        start=np.vstack([first, v[:-1, 0:3]]),
        end=v[:, 0:3],
        centre=v[:, 3:6],
        normal=c[:, 1].astype(np.int8),
        sweep=v[:, 6],
        feed=v[:, 7],
        spindle=v[:, 8],
        line=c[:, 2].astype(np.int64),
        tool=np.tile([0.0, 0.0, 1.0], (n, 1)),
        name=Path(file).stem,
        notes=tuple(notes),
        text=tuple(text),
        turn=_turns(v[:, 9]),
        offsets=dict(reader.offsets),
        actions=tuple(reader.actions),
        given=(state.given[0], state.given[1], state.given[2]),
    )


def _turns(given: Floats) -> Floats | None:
    """The tool's turns; before the first one it stands as there."""
    said = np.flatnonzero(np.isfinite(given))
    if not said.size:
        return None
    return np.where(np.isfinite(given), given, given[said[0]])


def _kept(lines: Iterable[str], text: list[str]) -> Iterator[str]:
    for line in lines:
        text.append(line.rstrip("\r\n"))
        yield line
