"""Words to moves, line by line: memory does not grow with the file unless the moves are kept."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from math import atan2, copysign, hypot, isfinite, nan, pi, radians, sqrt
from typing import NamedTuple

from stiffmap.machining.toolpath.gcode.codes import AXES, CENTRES, MOVING, REFERENCES, STRAIGHT, Codes
from stiffmap.machining.toolpath.gcode.words import bare, read_block

Point = tuple[float, float, float]
CLOSES, CLOSES_SHARE = 5e-6, 1e-3
"""m and share of the radius by which an arc's ends may differ from one circle."""
LEAST_RADIUS, LEAST_SWEEP = 1.27e-6, 1e-6
"""m and rad: LinuxCNC refuses arcs by a smaller radius, or ends further than twice the radius by it; a smaller turn is a full one."""
NOWHERE, NO_CENTRE = (0.0, 0.0, 0.0), (nan, nan, nan)
_SIGNED = r"(-?\d+(?:\.\d*)?) ?)?"
_PLAIN = re.compile(
    rf"(?:N\d+ ?)?(?:G0?([01]) ?)?(?:X{_SIGNED}(?:Y{_SIGNED}(?:Z{_SIGNED}(?:F(\d{{1,7}}(?:\.\d*)?) ?)?(?:\([^()]*\))?\r?\n?",
    re.ASCII,
).fullmatch
EVERY = 20_000
"""Lines between two calls of `progress`."""
FARTHEST = 1e4
"""m: a coordinate beyond is a slip of the pen."""


class Move(NamedTuple):
    """A move of the tip, m, rad, s."""

    motion: str
    start: Point
    end: Point
    centre: Point
    plane: int
    sweep: float
    feed: float
    spindle: float
    line: int
    turn: float
    """rad of the tool about its axis; NaN where never given."""


class ProgramReader(Codes):
    """Reads blocks one after the other."""

    def block(self, text: str, number: int) -> Move | None:
        """The move of a line, if it has one."""
        words, optional = read_block(text, self.file, number)
        self.number = number
        if not words:
            if bare(text) == "%":
                self.state.ended, self.begun = self.begun, True
            return None
        self.begun = True
        if self.optional or optional:
            self.state.breaks += self.optional
            self.optional = optional
            if optional:
                self.note("lines with a slash (block delete) are carried out")
        s = self.state
        values, own, motion = self.sort(words)
        if own:
            self.one_line(values, own, motion)
        if motion:
            s.motion = "" if motion == "G80" else motion
        if values.keys().isdisjoint(MOVING) or not own.isdisjoint(REFERENCES):
            if motion in ("G2", "G3"):
                self.fail(f"{motion} without an end, a centre or a radius")
            self.stop()
            return None
        if not s.motion:
            first = next(a for a in MOVING if a in values)
            self.fail(
                f"{first} without a motion: expected G0, G1, G2 or G3 {'in it' if motion else 'before it'}"
            )
        if not s.unit:
            self.fail("the unit is missing: expected G21 (mm) or G20 (inch) before the first move")
        move = self._move(values, "G53" in own, number)
        self.moves += 1
        self.stop()
        return move

    def plain(self, line: re.Match[str], number: int) -> Move | None:
        """The move of a line of the commonest form in the commonest state, as `block` has it but faster; None: ask there."""
        s = self.state
        code, *axes, feed = line.groups()
        motion = f"G{code}" if code else s.motion
        rate = float(feed) if feed else s.feed
        usual = (
            s.unit
            and s.absolute
            and s.spindle is not None
            and not (s.inverse_time or s.lost or self.optional)
        )
        if not (usual and rate and motion in STRAIGHT and any(axes)):
            return None
        end = s.position.copy()
        shift = self.offsets.get(s.offset, NOWHERE)
        for i in range(3):
            if word := axes[i]:
                end[i] = float(word) * s.unit + shift[i]
                if s.given[i] > number:
                    s.given[i] = number
                if abs(end[i]) >= FARTHEST:
                    return None
        start, s.position, s.motion, s.feed = s.position, end, motion, rate
        self.moves += 1
        speed = nan if motion == "G0" else rate * s.unit / 60
        return Move(motion, start, end, NO_CENTRE, s.plane, 0.0, speed, s.rate, number, s.turn)  # type: ignore[arg-type]

    def _move(self, values: dict[str, float], machine: bool, number: int) -> Move:
        s = self.state
        shift = NOWHERE if machine else self.offsets.get(s.offset, NOWHERE)
        start = (s.position[0], s.position[1], s.position[2])
        end = list(start)
        if s.lost and s.motion != "G0":
            self.fail(
                f"where {', '.join(sorted(s.lost))} stands after a reference point is not known: expected a rapid there (G90 G0)"
            )
        for i, axis in enumerate(AXES):
            if axis in values:
                step = values[axis] * s.unit
                end[i] = step + shift[i] if s.absolute or machine else start[i] + step
                if abs(end[i]) >= FARTHEST:
                    self.fail(f"{axis}{values[axis]:g} is {end[i]:.3g} m: beyond any machine")
                if s.absolute or machine:
                    if s.given[i] > number:
                        s.given[i] = number
                    s.lost.discard(axis)
        goal = (end[0], end[1], end[2])
        centre, sweep = NO_CENTRE, 0.0
        if s.motion in ("G2", "G3"):
            centre, sweep = self._arc(values, start, goal, shift)
        elif not values.keys().isdisjoint("IJKR"):
            self.fail(f"I, J, K and R go with G2 or G3, not with {s.motion}")
        feed = nan
        if s.motion != "G0":
            feed = self._feed(values, start, goal, sweep, centre)
            if s.spindle is None:
                self.note("no M3 stands before a move at feed: the spindle's speed is taken from the process")
        if "C" in values:  # the turn of the tool about its own axis
            s.turn = radians(values["C"]) + (0.0 if s.absolute or not isfinite(s.turn) else s.turn)
        s.position = end
        return Move(s.motion, start, goal, centre, s.plane, sweep, feed, s.rate, number, s.turn)

    def _feed(self, values: dict[str, float], start: Point, end: Point, sweep: float, centre: Point) -> float:
        s = self.state
        if s.inverse_time:
            if "F" not in values:
                self.fail("under G93 every move needs its own F")
            way = hypot(*(b - a for a, b in zip(start, end, strict=True)))
            if sweep:
                flat = [i for i in range(3) if i != s.plane]
                radius = hypot(*(start[i] - centre[i] for i in flat))
                way = hypot(radius * sweep, end[s.plane] - start[s.plane])
            return way * values["F"] / 60
        if s.feed is None:
            self.fail(f"{s.motion} without a feed: F was never given, or before G94")
        return s.feed * s.unit / 60

    def _arc(
        self, values: dict[str, float], start: Point, end: Point, shift: Sequence[float]
    ) -> tuple[Point, float]:
        """Centre and sweep about the plane's normal."""
        s = self.state
        i, j = {2: (0, 1), 1: (2, 0), 0: (1, 2)}[s.plane]  # right-handed about the normal
        sense = -1.0 if s.motion == "G2" else 1.0
        ax, ay, bx, by = start[i], start[j], end[i], end[j]
        if "R" in values:
            if any(w in values for w in "IJK"):
                self.fail("an arc has a centre (I J K) or a radius (R), not both")
            x, y = self._centre_of_radius(values["R"] * s.unit, sense, (ax, ay), (bx, by))
        else:
            given = CENTRES[s.plane]
            wrong = [w for w in "IJK" if w in values and w not in given]
            if wrong:
                self.fail(
                    f"{wrong[0]} does not lie in the plane of the arc (G{ {2: 17, 1: 18, 0: 19}[s.plane] })"
                )
            if not any(w in values for w in given):
                self.fail(f"{s.motion} without a centre ({' '.join(given)}) or a radius (R)")
            if s.absolute_centres and not all(w in values for w in given):
                self.fail("under G90.1 both words of the centre are needed")
            base = shift if s.absolute_centres else start
            x, y = (base[axis] + values.get("IJK"[axis], 0.0) * s.unit for axis in (i, j))
        ra, rb = hypot(ax - x, ay - y), hypot(bx - x, by - y)
        if ra < LEAST_RADIUS:
            self.fail(f"the arc has no radius: {1e3 * ra:.6g} mm")
        if abs(ra - rb) > CLOSES and abs(ra - rb) > CLOSES_SHARE * max(ra, rb):
            self.fail(f"the arc does not close: its radius is {1e3 * ra:.6g} mm at the start and {1e3 * rb:.6g} mm at the end")  # fmt: skip
        turn = atan2(by - y, bx - x) - atan2(ay - y, ax - x)
        turn = (sense * turn) % (2 * pi)
        if (ax, ay) == (bx, by):
            turn = 2 * pi
        elif turn < LEAST_SWEEP:
            turn += 2 * pi
        turns = values.get("P", 1.0)
        if turns != int(turns) or not 1 <= turns <= 1000:
            self.fail(f"P: expected a whole number of turns from 1 to 1000, found {turns:g}")
        centre = [0.0, 0.0, 0.0]
        centre[i], centre[j], centre[s.plane] = x, y, start[s.plane]
        return (centre[0], centre[1], centre[2]), sense * (turn + 2 * pi * (turns - 1))

    def _centre_of_radius(
        self, radius: float, sense: float, a: tuple[float, float], b: tuple[float, float]
    ) -> tuple[float, float]:
        """Negative radius: the longer of the two arcs."""
        dx, dy = b[0] - a[0], b[1] - a[1]
        half = hypot(dx, dy) / 2
        if half == 0.0:
            self.fail("an arc by its radius needs an end that is not its start")
        if radius == 0.0 or half > abs(radius) + LEAST_RADIUS:
            self.fail(f"the arc does not close: its ends are {2e3 * half:.6g} mm apart, more than twice its radius of {1e3 * abs(radius):.6g} mm")  # fmt: skip
        height = copysign(sqrt(max(radius**2 - half**2, 0.0)), radius * sense)
        ux, uy = dx / (2 * half), dy / (2 * half)
        return a[0] + dx / 2 - height * uy, a[1] + dy / 2 + height * ux


def read_moves(
    lines: Iterable[str], reader: ProgramReader, progress: Callable[[int], None] | None = None
) -> Iterator[Move]:
    """Moves of a program, one after the other; raises FileError with the line of what is not understood."""
    for number, text in enumerate(lines, 1):
        if reader.state.ended:
            break
        plain = _PLAIN(text)
        move = (reader.plain(plain, number) if plain else None) or reader.block(text, number)
        if move is not None:
            yield move
        if progress is not None and number % EVERY == 0:
            progress(number)
